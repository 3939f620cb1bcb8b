// Trial frames, which move every coordinate: of scenes, and of any mechanism.
#include <gpu/support.hpp>
#include <random_mechanism.hpp>

namespace fork1s::test {
namespace {

constexpr Recovery kAll[] = {Recovery::kTwist, Recovery::kExact, Recovery::kCurved};

Off TryOut(const Simulation& simulation, int scans, PoseShaders& shaders) {
  const RecoveryBuffers buffers(simulation);
  const RecoveryBuffers::Trial trial = buffers.MakeTrial(simulation);
  shaders.SetModel(buffers.tables(), buffers.numbers());
  shaders.SetFrame(trial.frame);
  if (buffers.recovery() == Recovery::kTwist)
    shaders.RunTwist();
  else
    shaders.RunExact(scans);
  const std::vector<RigidTransform> truth = PosesOf(trial.poses);
  // A trial that moves nothing would try nothing.
  double moved = 0;
  for (std::size_t b = 0; b < truth.size(); ++b) {
    const RigidTransform X = simulation.Pose(static_cast<int>(b));
    moved = std::max(moved, (X.translation() - truth[b].translation()).norm() +
                                LogRotation(X.rotation().transpose() * truth[b].rotation()).norm());
  }
  EXPECT_GT(moved, 0.01);
  return Difference(shaders.Read(), truth);
}

TEST_F(GpuPoses, OfTrialsOfScenes) {
  PoseShaders shaders(kShaders);
  for (const char* scene : {"hand", "firemen", "vehicle"})
    for (const Recovery recovery : kAll) {
      std::printf("trial of %s, %s: ", scene, Name(recovery));
      ExpectClose(TryOut(SimulationOf(scene, recovery), 2, shaders), 1e-6, 2e-6);
    }
}

// Joints of several freedoms, in any direction, loops, couplings.
TEST_F(GpuPoses, OfRandomMechanisms) {
  int tried = 0, with_loops = 0;
  Off worst;
  PoseShaders shaders(kShaders);
  for (unsigned seed = 0; seed < 24; ++seed) {
    testing::RandomMechanismOptions options;
    options.bodies = 8 + static_cast<int>(seed % 5);
    options.rigid_closures = static_cast<int>(seed % 3);
    options.couplings = static_cast<int>(seed % 2);
    Scene scene;
    scene.mechanisms.push_back(testing::RandomMechanismDef(seed, options));
    for (const Recovery recovery : kAll) {
      SimulationOptions run;
      run.recovery = recovery;
      auto simulation = Simulation::Create(scene, run);
      if (!simulation) continue;  // held by too little, for instance
      SCOPED_TRACE(std::to_string(seed) + ", " + Name(recovery));
      const Off off = TryOut(*simulation, static_cast<int>(seed % 4), shaders);
      worst = {std::max(worst.position, off.position), std::max(worst.turn, off.turn)};
      ++tried;
      with_loops += simulation->world().mechanisms()[0].model().loop_rank() > 0 ? 1 : 0;
    }
  }
  std::printf("%d random mechanisms, %d with loops: ", tried, with_loops);
  ExpectClose(worst, 1e-6, 2e-6);
  EXPECT_GT(tried, 50);
  EXPECT_GT(with_loops, 25);
}

}  // namespace
}  // namespace fork1s::test
