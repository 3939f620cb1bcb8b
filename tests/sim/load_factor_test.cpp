// The load factor of a grasp is the same whether its contacts are simulated or frozen.
#include <cmath>
#include <fork1s/sim/load_factor.hpp>

#include "sim/gripper.hpp"

namespace fork1s {
namespace {

using testing::Apart;
using testing::Gripper;
using testing::Steps;

const Fidelity kFrozenGrasp{DetailLevel::kObject, -1, Recovery::kExact};
const Fidelity kRollingGrasp{DetailLevel::kInterface, -1, Recovery::kExact};

Simulation PressedBy(Scene scene, double by, const Matrix3& R) {
  scene.gravity.setZero();
  for (MechanismDef& m : scene.mechanisms) m.X_WR = RigidTransform(R, Vector3::Zero()) * m.X_WR;
  for (FreeBodyDef& b : scene.free_bodies) b.X_WB = RigidTransform(R, Vector3::Zero()) * b.X_WB;
  SimulationOptions options;
  options.dt = 1e-3;
  auto simulation = Simulation::Create(std::move(scene), options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  for (const char* control : {"left", "right"}) simulation->SetControl(control, by);
  Steps(*simulation, 400);
  return std::move(*simulation);
}

double NormalForceOfOneTip(const Simulation& simulation) {
  double sum = 0;
  if (simulation.frozen_grasps().empty())
    for (const ContactRecord& c : simulation.world().contacts()) sum += c.impulse(0) / simulation.dt();
  for (const FrozenContactForce& f : simulation.FrozenContactForces()) sum += f.force_W.dot(f.normal_W);
  return sum / 2;
}

// A ball between tips that do not turn: ejected at k_t (R + r), tests/stepping/load_factor_test.cpp.
TEST(FrozenLoadFactor, IsThatOfTheClosedForm) {
  struct Case {
    double ball, tip, k_side, share;
  };
  const Matrix3 turned = ExpRotation(Vector3(0.3, -0.7, 0.4));
  for (const Case& c :
       {Case{0.045, 0.01, 200, 0.3}, {0.045, 0.01, 800, 0.6}, {0.02, 0.02, 500, 0.5}, {0.03, 0.05, 300, 0.9}})
    for (const bool two_arms : {false, true}) {
      SCOPED_TRACE(::testing::Message()
                   << c.ball << ' ' << c.tip << (two_arms ? ", two arms" : ", one gripper"));
      Gripper gripper;
      gripper.ball_radius = c.ball;
      gripper.tip = c.tip;
      gripper.k = 2000;
      gripper.k_side = c.k_side;
      gripper.friction = 2;
      const double critical = c.k_side * (c.ball + c.tip);
      Simulation simulation =
          PressedBy(two_arms ? Apart(gripper) : gripper.Make(), c.share * critical / gripper.k, turned);
      const LoadFactor rolling = ComputeLoadFactor(simulation);
      ASSERT_EQ(rolling.contacts, 2);
      EXPECT_NEAR(rolling.factor * NormalForceOfOneTip(simulation) / critical, 1, 0.01);
      ASSERT_TRUE(simulation.SetFidelity(kFrozenGrasp));
      Steps(simulation, 10);
      const LoadFactor frozen = ComputeLoadFactor(simulation);
      EXPECT_EQ(frozen.contacts, 2);
      EXPECT_EQ(frozen.body, "ball");
      EXPECT_NEAR(frozen.factor / rolling.factor, 1, 0.01);
      // Of the present force, not of that at which contacts were frozen.
      simulation.SetControl("left", 1.1 * c.share * critical / gripper.k);
      simulation.SetControl("right", 1.1 * c.share * critical / gripper.k);
      Steps(simulation, 300);
      EXPECT_NEAR(ComputeLoadFactor(simulation).factor * NormalForceOfOneTip(simulation) / critical, 1, 0.01);
      EXPECT_NEAR(ComputeLoadFactor(simulation).factor / rolling.factor, 1 / 1.1, 0.01);
      ASSERT_TRUE(simulation.SetFidelity(kRollingGrasp));
      Steps(simulation, 10);
      EXPECT_NEAR(ComputeLoadFactor(simulation).factor / rolling.factor, 1 / 1.1, 0.01);
    }
}

// Two arms that hold a box together, and a contact that is not frozen: a peg under the box, once it is
// pressed down.
TEST(FrozenLoadFactor, OfABoxOfTwoArmsOnAPeg) {
  Gripper gripper;
  gripper.tip = 0.01;
  gripper.friction = 1;
  Scene scene = Apart(gripper);
  scene.free_bodies[0].geometries[0].shape = Box{Vector3::Constant(gripper.ball_radius)};
  GeometryDef peg;
  peg.name = "peg";
  peg.shape = Sphere{0.01};
  peg.X_BG = RigidTransform(Vector3(0, 0, -gripper.ball_radius - 0.01));
  scene.world.push_back(peg);
  Simulation simulation = PressedBy(scene, 0.01, Matrix3::Identity());
  const int box = simulation.FindBody("ball");
  for (const double newtons : {0, 2}) {
    SCOPED_TRACE(newtons);
    const auto press = [&](int steps) {
      for (int i = 0; i < steps; ++i) {
        simulation.ApplyWrench(box, Vector3(0, 0, -newtons), Vector3::Zero(),
                               simulation.Pose(box).translation());
        Steps(simulation, 1);
      }
    };
    press(400);
    const LoadFactor rolling = ComputeLoadFactor(simulation);
    EXPECT_EQ(rolling.contacts, newtons > 0 ? 3 : 2);
    ASSERT_TRUE(simulation.SetFidelity(kFrozenGrasp));
    press(100);
    const LoadFactor frozen = ComputeLoadFactor(simulation);
    EXPECT_EQ(frozen.contacts, rolling.contacts);
    EXPECT_NEAR(frozen.factor / rolling.factor, 1, 0.01);
    ASSERT_TRUE(simulation.SetFidelity(kRollingGrasp));
  }
}

}  // namespace
}  // namespace fork1s
