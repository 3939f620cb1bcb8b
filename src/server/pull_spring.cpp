#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>

#include "server/pull_spring.hpp"

namespace fork1s {

double SceneRadius(const Simulation& simulation) {
  Vector3 low = Vector3::Constant(1e300), high = -low;
  auto add = [&](int body, const std::vector<GeometryDef>& geometries) {
    const RigidTransform X_WB = simulation.Pose(body);
    low = low.cwiseMin(X_WB.translation());
    high = high.cwiseMax(X_WB.translation());
    for (const GeometryDef& g : geometries) {
      const double radius = BoundingRadius(g.shape);
      if (!std::isfinite(radius)) continue;
      const Vector3 at = X_WB * g.X_BG.translation();
      low = low.cwiseMin(at.array().matrix() - Vector3::Constant(radius));
      high = high.cwiseMax(at.array().matrix() + Vector3::Constant(radius));
    }
  };
  int body = 0;
  for (const SceneBody& b : simulation.bodies()) {
    const auto index = static_cast<std::size_t>(b.index);
    if (b.mechanism < 0) {
      add(body++, simulation.present_scene().free_bodies[index].geometries);
      continue;
    }
    const Mechanism& m = simulation.world().mechanisms()[static_cast<std::size_t>(b.mechanism)].mechanism();
    add(body++, m.definition().bodies[index].geometries);
  }
  return body == 0 ? 1 : std::max(1e-3, 0.5 * (high - low).norm());
}

double SuggestPullStiffness(const Simulation& simulation) {
  double mass = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) mass += m.mechanism().total_mass();
  for (const FreeBody& b : simulation.world().free_bodies()) mass += b.inertia().mass;
  const double wanted = 2 * std::max(mass, 1e-3) * 9.81 / (0.2 * SceneRadius(simulation));
  // Two figures: it is shown on a slider.
  const double step = std::pow(10, std::floor(std::log10(wanted)) - 1);
  return std::round(wanted / step) * step;
}

}  // namespace fork1s
