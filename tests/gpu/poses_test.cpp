// The shaders of shaders/, run, against poses in double precision.
#include <continuum_arm.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/sim/continue.hpp>
#include <gpu/support.hpp>

namespace fork1s::test {
namespace {

// A hand that closes, two firemen and their trampoline: free bodies, fixed and floating bases, loops.
TEST_F(GpuPoses, AreThoseOfTheSimulation) {
  for (const char* scene : {"hand", "firemen", "hexapod_terrain"})
    for (const Recovery recovery : {Recovery::kTwist, Recovery::kExact, Recovery::kCurved}) {
      SCOPED_TRACE(std::string(scene) + ", " + Name(recovery));
      Simulation simulation = SimulationOf(scene, recovery);
      for (int k = 0; k < simulation.controls().size(); ++k)
        simulation.SetControl(k, simulation.controls()(k) + 0.1);
      for (int i = 0; i < 30; ++i) simulation.Step();
      std::printf("%s, %s: ", scene, Name(recovery));
      ExpectClose(Difference(Recovered(simulation), Truth(simulation)), 1e-6, 2e-6);
    }
}

// The longest way of 1001 links, by doubling and by walking, where the rounding of a thousand products adds
// up.
TEST_F(GpuPoses, OfAChainOfAThousandJoints) {
  examples::ContinuumArm arm;
  arm.joints = 1000;
  Simulation simulation = SimulationOf(examples::ContinuumArmScene(arm));
  simulation.SetControl("curl", 1.0);
  for (int i = 0; i < 30; ++i) simulation.Step();
  const RecoveryBuffers buffers(simulation);
  ASSERT_EQ(buffers.scan_passes(), 10);
  const std::vector<RigidTransform> truth = Truth(simulation);
  EXPECT_GT(LogRotation(truth[1000].rotation()).norm(), 0.3);
  for (const int scans : {0, 3, 10}) {
    std::printf("%d scans: ", scans);
    // Rounding of floats, 6e-8, of some tens of products one after the other; without scans of a thousand.
    ExpectClose(Difference(Recovered(simulation, scans), truth), scans == 0 ? 4e-6 : 2e-6, 2e-6);
  }
}

// What is simulated exactly and drawn by twists: off by the square of the deflection, as twists are, and no
// more.
TEST_F(GpuPoses, ByTwistsOfAnExactSimulation) {
  Simulation simulation = SimulationOf("hand", Recovery::kExact);
  for (int k = 0; k < simulation.controls().size(); ++k) simulation.SetControl(k, 0.1);
  for (int i = 0; i < 30; ++i) simulation.Step();
  const RecoveryBuffers buffers(simulation);
  std::vector<float> frame;
  buffers.WriteFrame(simulation, frame);
  PoseShaders shaders(kShaders);
  shaders.SetModel(buffers.tables(), buffers.numbers());
  shaders.SetFrame(frame);
  shaders.RunTwist();
  const MechanismDynamics& hand = simulation.world().mechanisms()[0];
  std::vector<RigidTransform> truth;
  RecoverPosesTwist(hand.model(), hand.state(), truth);
  for (RigidTransform& X : truth) X = hand.state().X_WR * X;
  truth.push_back(simulation.world().free_bodies()[0].pose());
  ExpectClose(Difference(shaders.Read(), truth), 1e-6, 2e-6);
  EXPECT_GT(Difference(shaders.Read(), Truth(simulation)).turn, 1e-5);
}

// A model that has bent far has another reference, and buffers of before are refused.
TEST_F(GpuPoses, FollowTheReference) {
  Simulation simulation = SimulationOf("hand", Recovery::kTwist);
  RecoveryBuffers buffers(simulation);
  PoseShaders shaders(kShaders);
  std::vector<float> frame;
  int changes = 0;
  for (int i = 0; i < 90; ++i) {
    for (int k = 0; k < simulation.controls().size(); ++k) simulation.SetControl(k, 0.01 * i);
    const StepReport report = simulation.Step();
    EXPECT_EQ(report.refreshes > 0, !buffers.IsOf(simulation)) << i;
    if (buffers.IsOf(simulation)) continue;
    EXPECT_THROW(buffers.WriteFrame(simulation, frame), std::invalid_argument);
    buffers = RecoveryBuffers(simulation);
    ++changes;
  }
  EXPECT_GT(changes, 0);
  buffers.WriteFrame(simulation, frame);
  shaders.SetModel(buffers.tables(), buffers.numbers());
  shaders.SetFrame(frame);
  shaders.RunTwist();
  ExpectClose(Difference(shaders.Read(), Truth(simulation)), 1e-6, 2e-6);
}

// Stiffer joints, and a cube whose contacts are frozen: other models of the same bodies, in the same order.
TEST_F(GpuPoses, OfOtherModelsOfTheSameBodies) {
  Simulation simulation = SimulationOf("fourbar_gripper", Recovery::kExact);
  for (const char* grip : {"left_grip", "right_grip"}) simulation.SetControl(grip, 0.4);
  for (int i = 0; i < 60; ++i) simulation.Step();
  const RecoveryBuffers free(simulation);

  auto scene = WithStiffness(simulation.scene(), simulation.CoordinateNames()[0], 0.07);
  ASSERT_TRUE(scene) << scene.error().Text();
  auto stiffer = Continue(simulation, std::move(*scene));
  ASSERT_TRUE(stiffer) << stiffer.error().Text();
  EXPECT_FALSE(free.IsOf(*stiffer));

  Fidelity fidelity = simulation.fidelity();
  fidelity.level = DetailLevel::kObject;
  const auto held = simulation.SetFidelity(fidelity);
  ASSERT_TRUE(held) << held.error().Text();
  ASSERT_FALSE(simulation.frozen_grasps().empty());
  EXPECT_FALSE(free.IsOf(simulation));
  for (int i = 0; i < 10; ++i) simulation.Step();
  ExpectClose(Difference(Recovered(simulation), Truth(simulation)), 1e-6, 2e-6);
}

}  // namespace
}  // namespace fork1s::test
