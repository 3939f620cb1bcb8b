#include "many_hands.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

namespace fork1s::examples {
namespace {

MechanismDef Copy(MechanismDef m, const std::string& suffix, const Vector3& shift) {
  m.name += suffix;
  m.X_WR.translation() += shift;
  for (BodyDef& b : m.bodies) b.name += suffix;
  for (JointDef& j : m.joints) j.name += suffix;
  for (ClosureDef& c : m.closures) c.name += suffix;
  for (CouplingDef& c : m.couplings) c.name += suffix;
  for (SpringDef& s : m.springs) s.name += suffix;
  for (ControlDef& c : m.controls) c.name += suffix;
  for (std::string& name : m.interfaces) name += suffix;
  return m;
}

std::string Suffix(int copy) { return fmt::format("#{}", copy); }

Vector3 BoxInPalm(const Simulation& simulation, int palm, int box) {
  return simulation.Pose(palm).inverse() * simulation.Pose(box).translation();
}

}  // namespace

Scene Replicate(const Scene& scene, int count, double spacing) {
  FORK1S_REQUIRE(count >= 1, count);
  Scene many;
  many.name = scene.name;
  many.gravity = scene.gravity;
  many.timestep = scene.timestep;
  many.world = scene.world;
  for (const KeyframeDef& key : scene.keyframes) many.keyframes.emplace_back().name = key.name;
  const int columns = static_cast<int>(std::ceil(std::sqrt(count)));
  for (int k = 0; k < count; ++k) {
    const Vector3 shift(spacing * (k % columns), spacing * (k / columns), 0);
    const std::string suffix = Suffix(k);
    for (const MechanismDef& m : scene.mechanisms) many.mechanisms.push_back(Copy(m, suffix, shift));
    for (FreeBodyDef body : scene.free_bodies) {
      body.name += suffix;
      body.X_WB.translation() += shift;
      many.free_bodies.push_back(std::move(body));
    }
    for (const auto& [a, b] : scene.excluded_pairs)
      many.excluded_pairs.emplace_back(a == "world" ? a : a + suffix, b == "world" ? b : b + suffix);
    for (std::size_t i = 0; i < scene.keyframes.size(); ++i) {
      for (auto state : scene.keyframes[i].mechanisms) {
        state.X_WR.translation() += shift;
        many.keyframes[i].mechanisms.push_back(std::move(state));
      }
      for (auto state : scene.keyframes[i].free_bodies) {
        state.X_WB.translation() += shift;
        many.keyframes[i].free_bodies.push_back(state);
      }
    }
  }
  return many;
}

Expected<Simulation> CreateManyHands(const std::string& scene_path, const ManyHands& hands) {
  auto scene = LoadHandScene(scene_path, hands.scenario);
  if (!scene) return tl::unexpected(scene.error());
  SimulationOptions options;
  options.dt = hands.scenario.dt;
  options.initial_keyframe = 0;
  return Simulation::Create(Replicate(*scene, hands.count, hands.spacing), options);
}

ManyHandsMeasurement RunManyHands(Simulation& simulation, const ManyHands& hands,
                                  const std::function<void(const StepReport&)>& after_step) {
  const auto count = static_cast<std::size_t>(hands.count);
  // Places once: names are looked up one by one.
  std::vector<std::vector<int>> place(count);
  std::vector<int> palm(count), box(count);
  for (std::size_t k = 0; k < count; ++k) {
    const std::string suffix = Suffix(static_cast<int>(k));
    for (const auto& [name, value] : HandSetPoints(0, hands.scenario)) {
      const auto dot = name.find('.');  // of the driven palm: palm#3.z
      place[k].push_back(simulation.FindControl(
          dot == std::string::npos ? name + suffix : name.substr(0, dot) + suffix + name.substr(dot)));
      FORK1S_REQUIRE(place[k].back() >= 0, name, k);
    }
    palm[k] = simulation.FindBody("palm" + suffix);
    box[k] = simulation.FindBody("box" + suffix);
  }

  ManyHandsMeasurement m;
  std::vector<Vector3> at_rest(count);
  const double end = kHandRestStart + hands.scenario.rest;
  const auto steps = static_cast<int>(std::lround(end / hands.scenario.dt));
  for (int i = 0; i < steps && m.finite; ++i) {
    const double t = (i + 1) * hands.scenario.dt;
    const auto values = HandSetPoints(t, hands.scenario);
    for (const auto& of_hand : place)
      for (std::size_t c = 0; c < values.size(); ++c) simulation.SetControl(of_hand[c], values[c].second);
    const auto start = std::chrono::steady_clock::now();
    const StepReport report = simulation.Step();
    m.step_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    m.wall_s += 1e-6 * m.step_us.back();
    m.finite = report.finite;
    ++m.steps;
    m.contacts_max = std::max(m.contacts_max, report.contacts);
    m.penetration_max = std::max(m.penetration_max, report.max_penetration);
    const bool rests = t > kHandRestStart;
    (rests ? m.unconverged_rest : m.unconverged_closing) += report.solver.converged ? 0 : 1;
    for (std::size_t k = 0; k < count; ++k) {
      const Vector3 now = BoxInPalm(simulation, palm[k], box[k]);
      if (!rests) at_rest[k] = now;
      m.drift_at_rest = std::max(m.drift_at_rest, (now - at_rest[k]).norm());
    }
    if (after_step) after_step(report);
  }
  m.simulated_s = m.steps * hands.scenario.dt;
  // The palm rises by 0.15 m; what stayed on the table is left behind.
  for (std::size_t k = 0; k < count; ++k) m.held += simulation.Pose(box[k]).translation().z() > 0.15 ? 1 : 0;
  m.hash = simulation.HashState();
  return m;
}

}  // namespace fork1s::examples
