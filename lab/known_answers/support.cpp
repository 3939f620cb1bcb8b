#include "support.hpp"

#include <fmt/format.h>
#include <cmath>

namespace fork1s {

bool KnownAnswer::Holds() const { return std::abs(measured - expected) <= tolerance; }

}  // namespace fork1s

namespace fork1s::internal {

void Rows::Add(const Known& known, std::optional<double> reduced, std::optional<double> full) {
  auto add = [&](const char* method, double measured) {
    rows_.push_back({case_name_, known.quantity, known.unit, method, known.expected, measured,
                     known.tolerance, known.why_tolerance, known.source});
  };
  if (reduced) add("reduced", *reduced);
  if (full) add("full", *full);
}

Scene SceneOf(MechanismDef definition, const Vector3& gravity) {
  Scene scene;
  scene.name = definition.name;
  scene.gravity = gravity;
  scene.mechanisms.push_back(std::move(definition));
  return scene;
}

void StartAt(Scene& scene, const VectorX& q, const VectorX& q_dot) {
  KeyframeDef key;
  key.mechanisms.emplace_back();
  key.mechanisms[0].q = q;
  key.mechanisms[0].q_dot = q_dot;
  key.mechanisms[0].X_WR = scene.mechanisms[0].X_WR;
  scene.keyframes = {key};
}

Scene OnPlane(const Shape& shape, const SpatialInertia& inertia, double height, double slope,
              double friction) {
  auto geometry = [&](const char* name, const Shape& s) {
    GeometryDef g;
    g.name = name;
    g.shape = s;
    g.friction = friction;
    return g;
  };
  Scene scene;
  scene.gravity = 9.81 * Vector3(std::sin(slope), 0, -std::cos(slope));
  scene.world.push_back(geometry("plane", Plane{}));
  FreeBodyDef body;
  body.name = "body";
  body.inertia = inertia;
  body.X_WB.translation() = Vector3(0, 0, height);
  body.geometries.push_back(geometry("skin", shape));
  scene.free_bodies.push_back(body);
  return scene;
}

Simulation StartReduced(Scene scene, double h, double refresh_angle, Integrator integrator) {
  SimulationOptions options;
  options.refresh_angle = refresh_angle;
  options.dt = h;
  options.step.integrator = integrator;
  options.initial_keyframe = scene.keyframes.empty() ? -1 : 0;
  return OrFail(Simulation::Create(std::move(scene), options));
}

FullSimulation StartFull(Scene scene, double h) {
  FullSimulationOptions options;
  options.dt = h;
  options.initial_keyframe = scene.keyframes.empty() ? -1 : 0;
  return OrFail(FullSimulation::Create(std::move(scene), options));
}

void StepOnce(Simulation& simulation) {
  if (!simulation.Step().finite)
    throw CaseFailure(fmt::format("reduced: numbers that are not finite at {:.4g} s", simulation.time()));
}

void StepOnce(FullSimulation& simulation) {
  const FullStepReport report = simulation.Step();
  if (!report.finite || !report.converged)
    throw CaseFailure(fmt::format("full: no convergence at {:.4g} s, last change {:.2g} m", simulation.time(),
                                  report.residual));
}

VectorX ExtrapolateToZero(std::vector<VectorX> values) {
  double power = 1;
  for (std::size_t left = values.size(); left > 1; --left) {
    power *= 2;
    for (std::size_t i = 0; i + 1 < left; ++i) values[i] = (power * values[i + 1] - values[i]) / (power - 1);
  }
  return values.front();
}

}  // namespace fork1s::internal
