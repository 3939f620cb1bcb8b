// Scenes of one mechanism or one free body, and runs that must stay converged.
#pragma once

#include <gtest/gtest.h>

#include <fork1s/reference/full_simulation.hpp>
#include <mechanisms.hpp>
#include <stdexcept>
#include <utility>

namespace fork1s::reference_test {

inline constexpr double kGravity = 9.81;  // m/s²

inline Scene Of(MechanismDef definition, const Vector3& gravity = Vector3::Zero()) {
  Scene scene;
  scene.name = definition.name;
  scene.gravity = gravity;
  scene.mechanisms.push_back(std::move(definition));
  return scene;
}

/// A keyframe that starts the scene's first mechanism at q, q_dot.
inline void StartAt(Scene& scene, const VectorX& q, const VectorX& q_dot,
                    const Vector6& V_R = Vector6::Zero()) {
  KeyframeDef key;
  key.mechanisms.emplace_back();
  key.mechanisms[0].q = q;
  key.mechanisms[0].q_dot = q_dot;
  key.mechanisms[0].X_WR = scene.mechanisms[0].X_WR;
  key.mechanisms[0].V_R = V_R;
  scene.keyframes = {key};
}

inline FullSimulation Start(Scene scene, double h, FullIntegrator integrator = FullIntegrator::kEuler,
                            bool controls_move = false) {
  FullSimulationOptions options;
  options.dt = h;
  options.integrator = integrator;
  options.controls_move = controls_move;
  options.initial_keyframe = scene.keyframes.empty() ? -1 : 0;
  auto simulation = FullSimulation::Create(std::move(scene), options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

inline void Advance(FullSimulation& simulation, double seconds) {
  const auto steps = static_cast<int>(seconds / simulation.dt() + 0.5);
  for (int i = 0; i < steps; ++i) {
    const FullStepReport report = simulation.Step();
    ASSERT_TRUE(report.converged) << "step " << i << " residual " << report.residual << " m";
  }
}

inline GeometryDef Touching(Shape shape, double friction = 1) {
  GeometryDef g;
  g.shape = std::move(shape);
  g.friction = friction;
  return g;
}

/// Fourth-order Runge-Kutta for x' = f(x).
template <class F>
VectorX Integrate(F f, VectorX x, double seconds, int steps) {
  const double h = seconds / steps;
  for (int i = 0; i < steps; ++i) {
    const VectorX a = f(x), b = f(VectorX(x + 0.5 * h * a)), c = f(VectorX(x + 0.5 * h * b)),
                  d = f(VectorX(x + h * c));
    x += h / 6 * (a + 2 * b + 2 * c + d);
  }
  return x;
}

}  // namespace fork1s::reference_test
