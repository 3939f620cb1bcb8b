// Numbers that viewers tune, and what is written into a copy of the file.
#include <cmath>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "body_order.hpp"
#include "compliance_wish.hpp"
#include "scene_description.hpp"
#include "server/live_simulation.hpp"

namespace fork1s {
namespace {

using Json = nlohmann::json;

constexpr double kMostFactor = 1000;  // of a stiffness over the file's

Json SixOf(const Matrix3& C) { return {C(0, 0), C(1, 1), C(2, 2), C(0, 1), C(0, 2), C(1, 2)}; }

Json OrNull(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

}  // namespace

std::string LiveSimulation::TuningMessage() const {
  Json out = {{"type", "tuning"}, {"items", Json::array()}, {"writes", static_cast<bool>(file_.write)}};
  for (const Tunable& t : settings_.tunables)
    out["items"].push_back({{"of", Name(t.of)},
                            {"owner", t.owner},
                            {"quantity", Name(t.quantity)},
                            {"unit", t.unit},
                            {"value", OrNull(t.value)},
                            {"original", OrNull(t.original)}});
  return internal::Dump(out);
}

void LiveSimulation::ShowTuning() {
  ++latest_.tuning_version;
  latest_.tuning = std::make_shared<const std::string>(TuningMessage());
}

std::optional<Refusal> LiveSimulation::HandleShape(const Command& c) {
  const internal::BodyOrder order(simulation_);
  if (c.body < 0 || c.body >= order.size()) return Refusal{fmt::format("there is no body {}", c.body)};
  const SceneBody& body = simulation_.bodies()[static_cast<std::size_t>(order.InScene(c.body))];
  if (body.mechanism < 0) return Refusal{fmt::format("no spring holds body '{}'", body.name)};
  const auto at = static_cast<std::size_t>(body.mechanism);
  if (body.index >= static_cast<int>(original_.mechanisms[at].bodies.size()))
    return Refusal{fmt::format("body '{}' is held by others; take another detail level", body.name)};
  if (!(c.compliance.cwiseAbs().maxCoeff() > 0) || !(c.compliance.diagonal().minCoeff() > 0))
    return Refusal{"a body gives way along every axis, or along none that can be asked for"};
  if (!(c.factor > 1 && c.factor <= kMostFactor))
    return Refusal{fmt::format("stiffnesses change by a factor above 1 and up to {}, and {:.6g} was given",
                               kMostFactor, c.factor)};
  internal::ComplianceWish wish;
  wish.factor = c.factor;
  wish.mechanism = body.mechanism;
  wish.body = BodyIndex(body.index);
  // A mechanism that holds other bodies has further coordinates, behind its own.
  const VectorX& q = simulation_.world().mechanisms()[at].configuration().q;
  auto alone = BuildMechanism(original_.mechanisms[at]);
  if (!alone) return OrSay(tl::unexpected(alone.error()));
  wish.q = q.head(alone->num_coordinates());
  wish.C_R = c.compliance;
  LiveSettings changed = settings_;
  const auto followed = internal::FollowWish(original_, wish, changed);
  if (!followed) return OrSay(tl::unexpected(followed.error()));
  const KeyframeDef now = PresentState();
  auto refusal = OrSay(Rebuild(changed, &now));
  ShowTuning();
  if (refusal) return refusal;
  const Json reply = {{"type", "shaped"},
                      {"body", c.body},
                      {"asked", SixOf(c.compliance)},
                      {"reached", SixOf(followed->reached_R)},
                      {"stiffest", SixOf(followed->stiffest_R)},
                      {"softest", SixOf(followed->softest_R)},
                      {"stiffnesses", followed->num_stiffnesses},
                      {"at_bound", followed->num_at_bound}};
  replies_.push_back({c.viewer, internal::Dump(reply)});
  return {};
}

std::optional<Refusal> LiveSimulation::HandleWrite(const Command& c) {
  if (!file_.write) return Refusal{"this session has no file that a copy could be made of"};
  CopyRequest request;
  request.write_file = !c.text_only;
  request.scene = &original_;
  if (c.tuned)
    for (const Tunable& t : settings_.tunables)
      if (t.value != t.original) request.changed.push_back(t);
  if (c.moment == 0) {
    request.moment = simulation_.State();
    request.time = time_offset_ + simulation_.time();
  } else if (c.moment > 0) {
    const PastMoment* past = past_.Find(static_cast<std::uint32_t>(c.moment));
    if (!past) return Refusal{"that moment is no longer kept; scrub to a later one"};
    request.moment = past->state;
    request.time = past->time;
  }
  if (request.changed.empty() && !request.moment)
    return Refusal{"nothing differs from the file, so there is nothing to write", true};
  const auto written = file_.write(request);
  if (!written) return Refusal{written.error().Text()};
  Json reply = {
      {"type", "written"}, {"path", written->path}, {"text", written->text}, {"notes", written->notes}};
  replies_.push_back({c.viewer, internal::Dump(reply)});
  return {};
}

std::vector<LiveReply> LiveSimulation::PopReplies() { return std::exchange(replies_, {}); }

}  // namespace fork1s
