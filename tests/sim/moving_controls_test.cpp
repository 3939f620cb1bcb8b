// Inputs that move within a step, and those that stand, by the step of second order: a mass on a spring whose
// set-point goes at constant speed, or jumps, in closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {
namespace {

constexpr double kRate = 20;    // rad/s
constexpr double kSpeed = 0.1;  // m/s
constexpr double kTime = 0.5;   // s

Simulation Slider(double h, bool controls_move) {
  MechanismBuilder builder("slider");
  BodyDef body;
  body.name = "mass";
  body.parent = builder.base();
  body.inertia.mass = 1;
  body.inertia.rotational = Vector3::Constant(1e-3).asDiagonal();
  const BodyIndex b = builder.AddBody(body);
  const JointIndex slide =
      builder.AddJoint(JointDef::Slide("slide", b, Vector3::UnitX()).WithSpring(kRate * kRate));
  ControlDef control;
  control.name = "set";
  control.terms.emplace_back(FreedomRef{slide, 0}, 1.0);
  control.gain = kRate * kRate;
  control.is_setpoint = true;
  builder.AddControl(control);
  builder.SetInterfaces({"mass"});
  Scene scene;
  scene.name = "slider";
  scene.mechanisms.push_back(builder.definition());
  SimulationOptions options;
  options.dt = h;
  options.step.integrator = Integrator::kTheta;
  options.step.controls_move = controls_move;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

template <class Input>
double PositionAtTheEnd(double h, bool controls_move, const Input& input) {
  Simulation simulation = Slider(h, controls_move);
  const int steps = static_cast<int>(std::lround(kTime / h));
  for (int i = 0; i < steps; ++i) {
    input(simulation);
    EXPECT_TRUE(simulation.Step().finite);
  }
  return simulation.JointCoordinates(0)(0);
}

TEST(MovingControls, ATableIsFollowedWithTheSquareOfTheStep) {
  const ControlTrack track{{"set"}, {0, 1}, {{0}, {kSpeed}}};
  const double exact = kSpeed * (kTime - std::sin(kRate * kTime) / kRate);
  double before = 0;
  for (const double h : {1.0 / 120, 1.0 / 240, 1.0 / 480}) {
    const double x = PositionAtTheEnd(h, true, [&](Simulation& s) { track.Apply(s.time() + s.dt(), s); });
    const double error = std::abs(x - exact);
    // Of the fourth power of h is the share of the end, which is added to the square.
    if (before > 0) {
      EXPECT_LT(error, before / 3.5) << h;
    }
    before = error;
  }
  // The trapezoid's period is too long by (ωh)²/12.
  EXPECT_LT(before, 1.5 * kSpeed * kTime * std::pow(kRate / 480, 2) / 12);
}

TEST(MovingControls, WhatStandsActsForTheWholeStep) {
  const double exact = 0.02 * (1 - std::cos(kRate * kTime));
  double before = 0;
  for (const double h : {1.0 / 120, 1.0 / 240, 1.0 / 480}) {
    const double x = PositionAtTheEnd(h, false, [](Simulation& s) { s.SetControl("set", 0.02); });
    const double error = std::abs(x - exact);
    if (before > 0) {
      EXPECT_LT(error, before / 3.5) << h;
    }
    before = error;
  }
  EXPECT_LT(before, 2e-3 * 0.02);
}

// A moment saved between setting and stepping knows where inputs come from.
TEST(MovingControls, AreSavedAndHashed) {
  Simulation one = Slider(1.0 / 60, true), other = Slider(1.0 / 60, true);
  for (Simulation* s : {&one, &other}) {
    s->SetControl("set", 0.01);
    ASSERT_TRUE(s->Step().finite);
  }
  EXPECT_EQ(one.HashState(), other.HashState());
  one.SetControl("set", 0.02);
  EXPECT_NE(one.HashState(), other.HashState());
  const Simulation::Snapshot then = one.Save();
  ASSERT_TRUE(one.Step().finite);
  const std::uint64_t hash = one.HashState();
  ASSERT_TRUE(one.Step().finite);
  ASSERT_TRUE(one.Restore(then));
  ASSERT_TRUE(one.Step().finite);
  EXPECT_EQ(one.HashState(), hash);
}

}  // namespace
}  // namespace fork1s
