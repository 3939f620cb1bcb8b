#include "sim/point_springs.hpp"

#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <cmath>
#include <sstream>
#include <string>

#include "diagnostics/point_response.hpp"

namespace fork1s {

PointSpring PullSpring(const Simulation& simulation, int body, const Vector3& point_B,
                       const Vector3& target_start_W, const Vector3& target_W, double stiffness) {
  const SceneBody& b = simulation.bodies()[static_cast<std::size_t>(body)];
  const World& world = simulation.world();
  const auto index = static_cast<std::size_t>(b.mechanism < 0 ? b.index : b.mechanism);
  const PointResponse response =
      b.mechanism < 0 ? RespondAt(world.free_bodies()[index], point_B)
                      : RespondAt(world.mechanisms()[index], BodyIndex(b.index), point_B, simulation.dt());
  return {point_B, target_start_W, target_W, stiffness, CriticalDamping(response, stiffness)};
}

namespace internal {

Expected<void> Pull(int body, const std::optional<Vector3>& point_W, const Vector3& target_W,
                    double stiffness, std::optional<double> damping, Simulation& simulation) {
  const auto refuse = [](const char* what, double given, const char* wanted) {
    std::ostringstream text;
    text << given << wanted;
    return Fail(ErrorCode::kUsage, what, text.str());
  };
  if (!(std::isfinite(stiffness) && stiffness > 0))
    return refuse("stiffness", stiffness, " N/m is no finite stiffness above 0; release ends a pull");
  if (damping && !(std::isfinite(*damping) && *damping >= 0))
    return refuse("damping", *damping, " N s/m is no finite damping of 0 or more");
  const Vector3 point_B =
      point_W ? Vector3(simulation.Pose(body).inverse() * *point_W) : Vector3(Vector3::Zero());
  PointSpring spring = PullSpring(simulation, body, point_B, target_W, target_W, stiffness);
  if (damping) spring.damping = *damping;
  simulation.SetPointSpring(body, spring);
  return {};
}

void Release(int body, Simulation& simulation) {
  for (const Simulation::BodyPointSpring& spring : PointSprings(simulation))
    if (spring.body == body) simulation.SetPointSpring(body, {});
}

std::vector<Simulation::BodyPointSpring> PointSprings(const Simulation& simulation) {
  std::vector<Simulation::BodyPointSpring> springs;
  const World& world = simulation.world();
  for (std::size_t b = 0; b < simulation.bodies().size(); ++b) {
    const SceneBody& body = simulation.bodies()[b];
    const auto index = static_cast<std::size_t>(body.mechanism < 0 ? body.index : body.mechanism);
    if (body.mechanism < 0) {
      const PointSpring& spring = world.free_bodies()[index].point_spring();
      if (spring.IsActive()) springs.push_back({static_cast<int>(b), spring});
    } else if (const MechanismDynamics& m = world.mechanisms()[index];
               m.point_spring().IsActive() && m.point_spring_body().value() == body.index) {
      springs.push_back({static_cast<int>(b), m.point_spring()});
    }
  }
  return springs;
}

void SetPointSprings(const std::vector<Simulation::BodyPointSpring>& springs, Simulation& simulation) {
  for (const Simulation::BodyPointSpring& spring : springs)
    simulation.SetPointSpring(spring.body, spring.spring);
}

}  // namespace internal
}  // namespace fork1s
