// Levels of detail, and changing them while the simulation runs.
#include <cmath>
#include <fork1s/constraints/material.hpp>

#include "sim/gripper.hpp"

namespace fork1s {
namespace {

using testing::Gripper;
using testing::Squeeze;
using testing::Steps;

constexpr double kSqueeze = 0.01;  // m: 5 N
const Fidelity kObject{DetailLevel::kObject, -1, Recovery::kExact};
const Fidelity kInterface{DetailLevel::kInterface, -1, Recovery::kExact};

Simulation Holding(const Gripper& gripper, Integrator integrator = Integrator::kTwoStage) {
  SimulationOptions options;
  options.step.integrator = integrator;
  Simulation simulation = gripper.Start(options);
  Squeeze(simulation, kSqueeze);
  Steps(simulation, 240);
  return simulation;
}

double Difference(const Simulation& a, const Simulation& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.bodies().size(); ++i) {
    const RigidTransform X = a.Pose(static_cast<int>(i)), Y = b.Pose(static_cast<int>(i));
    largest = std::max(largest, (X.translation() - Y.translation()).norm());
  }
  return largest;
}

TEST(Fidelity, FrozenContactsBearWhatContactsBore) {
  const Gripper gripper;
  Simulation simulation = Holding(gripper);
  auto set = simulation.SetFidelity(kObject);
  ASSERT_TRUE(set) << set.error().Text();
  ASSERT_EQ(simulation.frozen_grasps().size(), 1u);
  EXPECT_TRUE(simulation.world().free_bodies().empty());
  Steps(simulation, 60);
  // Fingers stand where they stood, so each presses with k times its set-point and carries half the weight.
  const double normal = gripper.k * kSqueeze, weight = gripper.ball_mass * 9.81;
  const std::vector<FrozenContactForce> forces = simulation.FrozenContactForces();
  ASSERT_EQ(forces.size(), 2u);
  Vector3 sum = Vector3::Zero();
  for (const FrozenContactForce& f : forces) {
    EXPECT_EQ(simulation.bodies()[static_cast<std::size_t>(f.held)].name, "ball");
    // Contact gives 10 µm, a thousandth of the spring's length.
    EXPECT_NEAR(f.force_W.dot(f.normal_W), normal, 0.002 * normal);
    EXPECT_NEAR(f.force_W.z(), weight / 2, 0.001 * weight);
    EXPECT_NEAR(f.use, weight / 2 / (gripper.friction * f.force_W.dot(f.normal_W)), 1e-3);
    sum += f.force_W;
  }
  EXPECT_NEAR((sum - Vector3(0, 0, weight)).norm(), 0, 1e-6 * weight);  // at rest to rounding of the springs
}

// Contacts that repeat each other are no news; two that are a hair apart decide whether the ball can turn.
TEST(Fidelity, FrozenContactsThatHoldByAHairAreTold) {
  const Gripper gripper;
  Simulation held = Holding(gripper);
  ASSERT_TRUE(held.SetFidelity(kObject));
  EXPECT_TRUE(held.warnings().empty()) << held.warnings().front();
  for (const auto& [apart, told] : {std::pair<double, bool>{0, false}, {1e-2, false}, {3e-7, true}}) {
    std::vector<FrozenGrasp> holds = held.frozen_grasps();
    FrozenGrasp::Contact again = holds[0].contacts[0];
    again.X_BC = again.X_BC * RigidTransform(Vector3(0, apart, 0));
    holds[0].contacts.push_back(again);
    Simulation fresh = gripper.Start();
    const auto set = fresh.SetFidelity(kObject, holds);
    ASSERT_TRUE(set) << set.error().Text();
    EXPECT_EQ(fresh.warnings().size(), told ? 1u : 0u) << apart;
    if (told && !fresh.warnings().empty()) {
      EXPECT_NE(fresh.warnings()[0].find("with frozen contacts"), std::string::npos) << fresh.warnings()[0];
    }
    ASSERT_TRUE(fresh.SetFidelity(kInterface));
    EXPECT_TRUE(fresh.warnings().empty()) << apart;
  }
}

TEST(Fidelity, WhatIsHeldFeelsBothFingersAsOneSpring) {
  const Gripper gripper;
  Simulation simulation = Holding(gripper);
  ASSERT_TRUE(simulation.SetFidelity(kObject));
  const int ball = simulation.FindBody("ball");
  EXPECT_TRUE(simulation.bodies()[static_cast<std::size_t>(ball)].is_interface);
  EXPECT_FALSE(simulation.bodies()[static_cast<std::size_t>(simulation.FindBody("left"))].is_interface);
  Steps(simulation, 120);
  const Vector3 rest = simulation.Pose(ball).translation();
  const Vector3 push(0.2, 0.1, -0.15);  // N
  for (int i = 0; i < 600; ++i) {
    simulation.ApplyWrench(ball, push, Vector3::Zero(), simulation.Pose(ball).translation());
    Steps(simulation, 1);
  }
  const Vector3 moved = simulation.Pose(ball).translation() - rest;
  // Linear up to the square of displacement over size: (0.4 mm / 20 mm)².
  const Vector3 linear(push.x() / (2 * gripper.k), push.y() / (2 * gripper.k_side),
                       push.z() / (2 * gripper.k_side));
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(moved(k), linear(k), 4e-4 * std::abs(linear(k))) << k;
}

TEST(Fidelity, NothingJumpsAtRest) {
  const double give = Gripper().ball_mass * 9.81 / ContactMaterial().stiffness;
  for (const Fidelity& to : {kObject, Fidelity{DetailLevel::kAll, 0, Recovery::kExact},
                             Fidelity{DetailLevel::kInterface, 2, Recovery::kExact}}) {
    Simulation simulation = Holding({}), stays = Holding({});
    ASSERT_EQ(simulation.HashState(), stays.HashState());
    ASSERT_TRUE(simulation.SetFidelity(to)) << Name(to.level);
    EXPECT_LT(Difference(simulation, stays), 1e-12) << Name(to.level);
    for (int i = 0; i < 60; ++i) {
      Steps(simulation, 1);
      Steps(stays, 1);
      // Contacts that are found again start without what their tangents bore, the weight, which gives way by
      // as much as the material's stiffness asks.
      ASSERT_LT(Difference(simulation, stays), give) << Name(to.level) << ' ' << i;
    }
    ASSERT_TRUE(simulation.SetFidelity(kInterface));
    EXPECT_TRUE(simulation.frozen_grasps().empty());
    for (int i = 0; i < 60; ++i) {
      Steps(simulation, 1);
      Steps(stays, 1);
      ASSERT_LT(Difference(simulation, stays), 2 * give) << Name(to.level) << " and back " << i;
    }
  }
}

// Carried about by a driven frame, frozen and let go in full motion.
// By backward Euler contacts that are carried round creep, and frozen ones do not.
TEST(Fidelity, NothingJumpsInMotion) {
  Gripper gripper;
  gripper.base = BaseKind::kDriven;
  Simulation simulation = Holding(gripper, Integrator::kTwoStage),
             stays = Holding(gripper, Integrator::kTwoStage);
  // Contacts give when forces change, by 10 um and more while they come on; frozen ones do not. By two stages
  // contacts carry the ball by rates estimated from the last poses of the base, frozen ones by the poses: 50
  // um to either side at this step, 3 um at a fourth of it.
  const double give = 1.5e-4;
  const double start = simulation.time();
  double speed = 0;
  for (int i = 0; i < 180; ++i) {
    for (Simulation* s : {&simulation, &stays}) {
      const double t = s->time() + s->dt() - start;
      s->SetControl("frame.z", 0.05 * (1 - std::cos(4 * t)));
      s->SetControl("frame.y", 0.02 * (1 - std::cos(6 * t)));
      s->SetControl("frame.rz", 0.3 * (1 - std::cos(3 * t)));
    }
    if (i == 25 || i == 90) {
      ASSERT_TRUE(simulation.SetFidelity(kObject));
    }
    if (i == 55 || i == 140) {
      ASSERT_TRUE(simulation.SetFidelity(kInterface));
    }
    Steps(simulation, 1);
    Steps(stays, 1);
    speed = std::max(speed, simulation.Velocity(simulation.FindBody("ball")).tail<3>().norm());
    ASSERT_LT(Difference(simulation, stays), give) << i;
  }
  EXPECT_GT(speed, 0.15);
}

TEST(Fidelity, RefusesToFreezeWhatNobodyHolds) {
  Simulation simulation = Gripper{}.Start();
  auto set = simulation.SetFidelity(kObject);
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().code, ErrorCode::kModel);
  EXPECT_NE(set.error().Text().find("holds nothing"), std::string::npos) << set.error().Text();
  EXPECT_EQ(simulation.fidelity(), kInterface);
  SimulationOptions options;
  options.detail = DetailLevel::kObject;
  EXPECT_FALSE(Simulation::Create(Gripper{}.Make(), options));
}

TEST(Fidelity, ABallThatLiesOnOneFingerIsNotHeld) {
  Gripper gripper;
  gripper.k = 50;
  Scene scene = gripper.Make();
  scene.gravity = Vector3(-9.81, 0, 0);  // onto the left finger
  auto simulation = Simulation::Create(scene);
  ASSERT_TRUE(simulation);
  simulation->SetControl("right", -0.02);
  Steps(*simulation, 240);
  ASSERT_GT(simulation->world().contacts().size(), 0u);
  EXPECT_FALSE(simulation->SetFidelity(kObject));
}

TEST(FidelityTrack, ReadsLevelsTimesAndModes) {
  auto track = FidelityTrack::Parse("interface+modes=2,1.5:object+twist,3:all+exact");
  ASSERT_TRUE(track) << track.error().Text();
  ASSERT_EQ(track->entries.size(), 3u);
  EXPECT_EQ(track->entries[0].fidelity, (Fidelity{DetailLevel::kInterface, 2, Recovery::kExact}));
  EXPECT_EQ(track->entries[1].time, 1.5);
  EXPECT_EQ(track->entries[1].fidelity, (Fidelity{DetailLevel::kObject, 2, Recovery::kTwist}));
  EXPECT_EQ(track->entries[2].fidelity, (Fidelity{DetailLevel::kAll, 2, Recovery::kExact}));
}

TEST(FidelityTrack, RefusesWhatItCannotRead) {
  for (const char* text : {"", "fine", "modes=", "modes=-1", "modes=2x", "x:all", "-1:all",
                           "1:", "2:all,1:object", "nan:all", "all+", "all,", "1:all,1:all"}) {
    auto track = FidelityTrack::Parse(text);
    ASSERT_FALSE(track) << text;
    EXPECT_EQ(track.error().code, ErrorCode::kUsage) << text;
  }
}

// Twists draw; the step is that of exact recovery, bit for bit but for the moments of refreshes.
TEST(Fidelity, TwistsStepAsExactRecoveryDoes) {
  std::vector<Vector3> places;
  for (const Recovery recovery : {Recovery::kExact, Recovery::kTwist}) {
    SimulationOptions options;
    EXPECT_EQ(options.step.integrator, Integrator::kTwoStage);
    options.recovery = recovery;
    options.refresh_angle = 3;
    auto simulation = Simulation::Create(Gripper().Make(), options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    for (int i = 0; i < 30; ++i) EXPECT_TRUE(simulation->Step().finite);
    places.push_back(simulation->Pose(static_cast<int>(simulation->bodies().size()) - 1).translation());
  }
  EXPECT_EQ(places[0], places[1]);
}

}  // namespace
}  // namespace fork1s
