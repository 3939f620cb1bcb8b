// Mechanisms that hold a body together become one while they do.
#include <cmath>
#include <map>

#include "sim/gripper.hpp"

namespace fork1s {
namespace {

using testing::Apart;
using testing::Gripper;
using testing::Rename;
using testing::Squeeze;
using testing::Steps;

constexpr double kGrip = 0.01;  // m: 5 N
const Fidelity kHeld{DetailLevel::kObject, -1, Recovery::kExact};
const Fidelity kTouching{DetailLevel::kInterface, -1, Recovery::kExact};

SimulationOptions By(Integrator integrator) {
  SimulationOptions options;
  options.step.integrator = integrator;
  return options;
}

Simulation Begin(Scene scene, const SimulationOptions& options = {}) {
  auto simulation = Simulation::Create(std::move(scene), options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

double Between(const Simulation& a, const Simulation& b) {
  double largest = 0;
  for (const SceneBody& body : a.bodies())
    if (b.FindBody(body.name) >= 0)
      largest = std::max(largest, (a.Pose(body.name).translation() - b.Pose(body.name).translation()).norm());
  return largest;
}

class HoldTogetherBy : public ::testing::TestWithParam<Integrator> {};

TEST_P(HoldTogetherBy, TwoMechanismsHoldAsOneDoes) {
  const Gripper gripper;
  Simulation one = gripper.Start(By(GetParam())), two = Begin(Apart(gripper), By(GetParam()));
  for (Simulation* s : {&one, &two}) {
    Squeeze(*s, kGrip);
    Steps(*s, 120);
    ASSERT_TRUE(s->SetFidelity(kHeld));
  }
  ASSERT_EQ(two.frozen_grasps().size(), 1u);
  EXPECT_TRUE(two.world().free_bodies().empty());
  EXPECT_EQ(two.place(0).mechanism, 0);
  EXPECT_EQ(two.place(1).mechanism, 1);
  EXPECT_EQ(two.place(2).mechanism, 0);
  EXPECT_EQ(two.world().mechanisms().size(), 3u);
  for (int i = 0; i < 180; ++i) {
    for (Simulation* s : {&one, &two}) {
      const int ball = s->FindBody("ball");
      s->ApplyWrench(ball, Vector3(0.2, 0.1, 0.15 * std::sin(0.1 * i)), Vector3(0, 1e-3, 0),
                     s->Pose(ball).translation());
      s->SetControl("right", kGrip * (1 + 0.5 * std::sin(0.05 * i)));
    }
    two.SetControl("by-left", 0.01);
    two.SetControl("by-frame.x", 1e-3 * i);
    Steps(one, 1);
    Steps(two, 1);
    // Both solve the same equations in coordinates of another order, to 1e-10 m a stage; they part by
    // 8e-8 m while the first force comes on, 0.2 mm a step, and come together again.
    ASSERT_LT(Between(one, two), i < 20 ? 2e-7 : 5e-8) << i;
  }
  const auto by_body = [](const Simulation& s) {
    std::map<std::string, FrozenContactForce> out;
    for (const FrozenContactForce& f : s.FrozenContactForces())
      out.emplace(s.bodies()[static_cast<std::size_t>(f.body)].name, f);
    return out;
  };
  const auto of_one = by_body(one), of_two = by_body(two);
  ASSERT_EQ(of_one.size(), of_two.size());
  for (const auto& [name, force] : of_one) {
    SCOPED_TRACE(name);
    // They keep the share that they had when they were frozen, which contact tells to some 1e-6.
    EXPECT_LT((force.force_W - of_two.at(name).force_W).norm(), 2e-5 * force.force_W.norm());
    EXPECT_NEAR(force.use, of_two.at(name).use, 2e-5);
  }
  EXPECT_NEAR(two.Pose("by-frame").translation().x(), 0.179, 1e-12) << "driven on meanwhile";
  EXPECT_NEAR(two.JointCoordinates(2)(0), one.JointCoordinates(0)(3), 1e-9);
  // Let go of, each stands where it stood, and goes on.
  for (Simulation* s : {&one, &two}) ASSERT_TRUE(s->SetFidelity(kTouching));
  EXPECT_LT(Between(one, two), 3e-8);
  EXPECT_EQ(two.place(2).mechanism, 2);
  EXPECT_EQ(two.world().free_bodies().size(), 1u);
  Steps(one, 60);
  Steps(two, 60);
  EXPECT_LT(Between(one, two), 1e-6) << "contact is found again";
}

INSTANTIATE_TEST_SUITE_P(Integrators, HoldTogetherBy,
                         ::testing::Values(Integrator::kEuler, Integrator::kTwoStage));

// Which of them is the base of the others makes no difference, nor does their order.
TEST(HoldTogether, AFloatingGripperIsHeldByOneThatStandsOrIsDriven) {
  for (const BaseKind second : {BaseKind::kFixed, BaseKind::kDriven}) {
    SCOPED_TRACE(static_cast<int>(second));
    Gripper gripper;
    gripper.base = BaseKind::kFloating;
    Scene scene = gripper.Make();
    MechanismDef& floating = scene.mechanisms[0];
    floating.bodies[0].inertia.mass = 0.2;
    floating.bodies[0].inertia.rotational = Vector3::Constant(2e-3).asDiagonal();
    gripper.base = second;
    MechanismDef across = gripper.Make().mechanisms[0];
    Rename(across, "across-");
    across.X_WR = RigidTransform(ExpRotation(Vector3(0, 0, std::acos(0.0))), Vector3::Zero());
    scene.mechanisms.push_back(across);
    for (MechanismDef& def : scene.mechanisms)
      for (BodyDef& b : def.bodies)
        for (GeometryDef& g : b.geometries) g.shape = Box{Vector3(0.01, 0.01, 0.01)};  // clear of each other
    Simulation simulation = Begin(scene), stays = Begin(scene);
    for (Simulation* s : {&simulation, &stays}) {
      Squeeze(*s, kGrip);
      s->SetControl("across-left", kGrip);
      s->SetControl("across-right", kGrip);
      Steps(*s, 240);
    }
    const double start = simulation.time();
    double moved = 0;
    const Vector3 from = simulation.Pose("frame").translation();
    for (int i = 0; i < 120; ++i) {
      for (Simulation* s : {&simulation, &stays}) {
        const double t = s->time() + s->dt() - start;
        if (second == BaseKind::kDriven) {
          s->SetControl("across-frame.z", 0.02 * (1 - std::cos(4 * t)));
          s->SetControl("across-frame.rz", 0.1 * (1 - std::cos(3 * t)));
        }
        s->ApplyWrench(s->FindBody("frame"), Vector3(0.1 * std::sin(5 * t), 0, 0), Vector3::Zero(),
                       s->Pose("frame").translation());
      }
      if (i == 25) {
        auto set = simulation.SetFidelity(kHeld);
        ASSERT_TRUE(set) << set.error().Text();
        EXPECT_EQ(simulation.place(0).mechanism, 1);
        EXPECT_LT(Between(simulation, stays), 3e-5);
      }
      if (i == 90) {
        ASSERT_TRUE(simulation.SetFidelity(kTouching));
      }
      Steps(simulation, 1);
      Steps(stays, 1);
      moved = std::max(moved, (simulation.Pose("frame").translation() - from).norm());
      // Contacts give when forces change, by 10 µm and more while they come on; frozen ones do not. And a
      // base that floats keeps its momentum by the midpoint rule, a free joint by implicit Euler: 0.13 mm at
      // 1/60 s, 0.027 at 1/240.
      ASSERT_LT(Between(simulation, stays), 2e-4) << i;
    }
    EXPECT_GT(moved, second == BaseKind::kDriven ? 0.02 : 3e-4);
  }
}

TEST(HoldTogether, SavedAndRestoredTheBitsAreTheSame) {
  Simulation simulation = Begin(Apart(Gripper{}));
  Squeeze(simulation, kGrip);
  Steps(simulation, 120);
  const Simulation::Snapshot touching = simulation.Save();
  ASSERT_TRUE(simulation.SetFidelity(kHeld));
  Steps(simulation, 10);
  const Simulation::Snapshot held = simulation.Save();
  Steps(simulation, 20);
  const std::uint64_t hash = simulation.HashState();
  ASSERT_TRUE(simulation.Restore(touching));
  EXPECT_EQ(simulation.place(2).mechanism, 2);
  Steps(simulation, 3);
  ASSERT_TRUE(simulation.Restore(held));
  EXPECT_EQ(simulation.place(2).mechanism, 0);
  Steps(simulation, 20);
  EXPECT_EQ(simulation.HashState(), hash);
}

TEST(HoldTogether, SaysWhatCannotBecomeOne) {
  const auto refusal = [](Scene scene) {
    Simulation simulation = Begin(std::move(scene));
    for (const std::string& name : simulation.control_names())
      if (name.find('.') == std::string::npos) simulation.SetControl(name, kGrip);
    Steps(simulation, 120);
    const auto set = simulation.SetFidelity(kHeld);
    EXPECT_FALSE(set);
    EXPECT_EQ(simulation.fidelity(), kTouching);
    Steps(simulation, 1);
    return set ? std::string() : set.error().Text();
  };
  Scene driven = Apart(Gripper{});
  for (MechanismDef& def : driven.mechanisms) def.base = BaseKind::kDriven;
  EXPECT_NE(refusal(driven).find("'gripper' and 'other gripper': hold a body together and cannot become one "
                                 "mechanism: the base of 'gripper' is driven"),
            std::string::npos)
      << refusal(driven);
  Scene same = Apart(Gripper{});
  same.mechanisms[2].joints[0].name = same.mechanisms[0].joints[0].name;
  EXPECT_NE(refusal(same).find("two of them have a joint 'left_grip'"), std::string::npos) << refusal(same);
}

}  // namespace
}  // namespace fork1s
