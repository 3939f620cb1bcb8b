// Fixed-interface modes that the time step of a simulation chooses.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

namespace fork1s {
namespace {

// A plate of 2 kg on a spring of 800 N/m and `count` masses on it, of `lowest_hz` to `highest_hz`; the plate
// moves at 1 m/s.
Scene PlateWithMasses(int count, double lowest_hz, double highest_hz, int modes = -1) {
  MechanismBuilder builder("plate_with_masses");
  const auto add = [&](const std::string& name, BodyIndex parent, double mass, double stiffness,
                       double damping) {
    BodyDef body;
    body.name = name;
    body.parent = parent;
    body.inertia.mass = mass;
    body.inertia.rotational = Vector3::Constant(1e-3 * mass).asDiagonal();
    const BodyIndex b = builder.AddBody(body);
    builder.AddJoint(JointDef::Slide(name + "_x", b, Vector3::UnitX()).WithSpring(stiffness, damping));
    return b;
  };
  const BodyIndex plate = add("plate", builder.base(), 2, 800, 1);
  for (int i = 0; i < count; ++i) {
    const double mass = 0.3,
                 omega = 2 * M_PI * lowest_hz * std::pow(highest_hz / lowest_hz, i / (count - 1.0));
    add("m" + std::to_string(i), plate, mass, mass * omega * omega, 0.01 * mass * omega);
  }
  builder.SetInterfaces({"plate"});
  if (modes >= 0) builder.SetModes(modes);
  Scene scene;
  scene.gravity.setZero();
  scene.mechanisms.push_back(builder.definition());
  KeyframeDef::MechanismState state;
  state.q = state.q_dot = VectorX::Zero(1 + count);
  state.q_dot(0) = 1;
  scene.keyframes.emplace_back();
  scene.keyframes[0].mechanisms.push_back(state);
  return scene;
}

Simulation Start(const Scene& scene, double dt = 1.0 / 60, Integrator integrator = Integrator::kTwoStage) {
  SimulationOptions options;
  options.dt = dt;
  options.initial_keyframe = 0;
  options.step.integrator = integrator;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

const ReducedModel& ModelOf(const Simulation& simulation) {
  return simulation.world().mechanisms()[0].model();
}

int NumModes(const Scene& scene, double dt = 1.0 / 60, Integrator integrator = Integrator::kTwoStage) {
  const Simulation simulation = Start(scene, dt, integrator);
  return ModelOf(simulation).num_modes;
}

// Four modes leave the interface off by more than it moves.
TEST(ModeSelection, MotionBelowASixthOfTheStepRateIsThatOfAllModes) {
  Simulation chosen = Start(PlateWithMasses(8, 0.8, 5)), all = Start(PlateWithMasses(8, 0.8, 5, 8)),
             four = Start(PlateWithMasses(8, 0.8, 5, 4));
  double off = 0, off_four = 0, size = 0;
  for (int i = 0; i < 300; ++i) {
    for (Simulation* s : {&chosen, &all, &four}) s->Step();
    const auto x = [](const Simulation& s) { return s.Pose(1).translation().x(); };
    off = std::max(off, std::abs(x(chosen) - x(all)));
    off_four = std::max(off_four, std::abs(x(four) - x(all)));
    size = std::max(size, std::abs(x(all)));
  }
  EXPECT_LT(off, 1e-6 * size);
  EXPECT_GT(off_four, 0.1 * size);
}

TEST(ModeSelection, KeepsAllThatTheStepResolvesAndNoFewerThanFour) {
  EXPECT_EQ(NumModes(PlateWithMasses(8, 3, 9.9)), 8);
  EXPECT_EQ(NumModes(PlateWithMasses(8, 3, 20)), 5);  // 3 (20/3)^(i/7): the sixth has 11.6 Hz
  EXPECT_EQ(NumModes(PlateWithMasses(8, 30, 90)), 4);
  EXPECT_EQ(NumModes(PlateWithMasses(8, 30, 90), 1.0 / 600), 8);
}

TEST(ModeSelection, NamedNumbersStayAsTheyAre) {
  EXPECT_EQ(NumModes(PlateWithMasses(8, 1, 5, 2)), 2);
  EXPECT_EQ(NumModes(PlateWithMasses(8, 1, 5), 1.0 / 60, Integrator::kEuler), 8);
}

TEST(ModeSelection, ManyModesAreBoundedAndChosenByContribution) {
  const Simulation simulation = Start(PlateWithMasses(40, 1, 5));
  const ReducedModel& model = ModelOf(simulation);
  EXPECT_EQ(model.num_free + model.num_elastic + model.num_modes, kMostCoordinatesByStep);
  EXPECT_EQ(model.mode_selection.choice, ModeChoice::kContribution);
}

}  // namespace
}  // namespace fork1s
