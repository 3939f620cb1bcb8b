#include "outside.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "child.hpp"
#include "record/scene_json.hpp"

namespace fork1s {
namespace {

constexpr double kLongestRun = 300;  // s

std::string WhyNotOfBodies(const MechanismDef& m) {
  std::vector<int> joints(m.bodies.size(), 0);
  for (const JointDef& j : m.joints) {
    if (j.kind != JointKind::kHinge && j.kind != JointKind::kSlide)
      return fmt::format("joint '{}' is neither a hinge nor a slide", j.name);
    if (++joints[j.body.u()] > 1)
      return fmt::format("body '{}' has more than one joint", m.bodies[j.body.u()].name);
    const FreedomDef& f = j.freedoms.front();
    if (std::isfinite(f.lower) || std::isfinite(f.upper)) return fmt::format("joint '{}' has stops", j.name);
  }
  std::ptrdiff_t that_touch = 0;
  for (const BodyDef& b : m.bodies) {
    that_touch +=
        std::any_of(b.geometries.begin(), b.geometries.end(), [](const auto& g) { return g.Collides(); });
    if (b.gravity_compensation != 0) return fmt::format("the weight of body '{}' is carried", b.name);
  }
  return that_touch > 1 ? "bodies may touch each other" : "";
}

}  // namespace

std::string WhyNoPlainTree(const Scene& scene) {
  if (scene.mechanisms.size() != 1 || !scene.free_bodies.empty()) return "it is not one mechanism alone";
  const bool touches =
      std::any_of(scene.world.begin(), scene.world.end(), [](const auto& g) { return g.Collides(); });
  if (touches) return "bodies may touch the still world";
  const MechanismDef& m = scene.mechanisms.front();
  if (m.base != BaseKind::kFixed) return "its base moves";
  if (!m.closures.empty() || !m.couplings.empty()) return "it has closed loops or coupled joints";
  if (!m.controls.empty() || !m.springs.empty() || !m.frictions.empty() || !m.length_limits.empty())
    return "it has motors, tendons or dry friction";
  return WhyNotOfBodies(m);
}

namespace internal {

Expected<PeerMotion> RunOutside(const OutsidePeer& peer, const Scene& scene,
                                const std::vector<std::string>& bodies, double dt, int samples,
                                int substeps) {
  const auto fail = [&](const std::string& why) { return Fail(ErrorCode::kModel, peer.name, why); };
  if (!peer.why_not.empty()) return fail(peer.why_not);
  if (const std::string why = WhyNoPlainTree(scene); !why.empty())
    return fail("takes plain trees alone: " + why);
  nlohmann::json request;
  request["scene"] = nlohmann::json::parse(WriteScene(scene).json);
  request["dt"] = dt / substeps;
  request["steps"] = samples * substeps;
  request["every"] = substeps;
  request["bodies"] = bodies;
  const MemoryFile file;
  const std::string text = request.dump();
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t wrote = write(file.descriptor(), text.data() + at, text.size() - at);
    if (wrote <= 0) return fail("gets no request: memory is short");
    at += static_cast<std::size_t>(wrote);
  }
  std::vector<std::string> command = peer.command;
  command.push_back(file.Path());
  const ChildEnd end = RunChild(command, kLongestRun);
  if (!end.done) {
    const auto last = end.error.find_last_of('\n', end.error.size() < 2 ? 0 : end.error.size() - 2);
    std::string said = end.error.substr(last == std::string::npos ? 0 : last + 1);
    while (!said.empty() && said.back() == '\n') said.pop_back();
    return fail(said.empty() ? end.how : end.how + ": " + said);
  }
  // What a simulator prints by itself comes before the answer.
  const auto begin = end.out.rfind("\n{") == std::string::npos ? 0 : end.out.rfind("\n{") + 1;
  const auto answer = nlohmann::json::parse(end.out.substr(begin), nullptr, false);
  if (!answer.is_object()) return fail("gave no answer");
  if (answer.contains("error")) return fail(answer["error"].get<std::string>());
  PeerMotion motion;
  motion.step_s = answer["step_s"].get<std::vector<double>>();
  for (const auto& sample : answer["positions"]) {
    motion.positions.emplace_back();
    for (const auto& p : sample)
      motion.positions.back().emplace_back(p[0].get<double>(), p[1].get<double>(), p[2].get<double>());
  }
  if (motion.step_s.size() != static_cast<std::size_t>(samples * substeps) ||
      motion.positions.size() != static_cast<std::size_t>(samples) + 1)
    return fail("gave another number of steps than asked for");
  return motion;
}

}  // namespace internal
}  // namespace fork1s
