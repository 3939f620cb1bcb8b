// Any mechanism: joints of several freedoms, in any direction, loops, couplings.
#include <gpu/support.hpp>
#include <random_mechanism.hpp>

namespace fork1s::test {
namespace {

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
    for (const Recovery recovery : {Recovery::kTwist, Recovery::kExact, Recovery::kCurved}) {
      SimulationOptions run;
      run.recovery = recovery;
      auto simulation = Simulation::Create(scene, run);
      if (!simulation) continue;  // held by too little, for instance
      const RecoveryBuffers buffers(*simulation);
      const RecoveryBuffers::Trial trial = buffers.MakeTrial(*simulation);
      shaders.SetModel(buffers.tables(), buffers.numbers());
      shaders.SetFrame(trial.frame);
      if (recovery == Recovery::kTwist)
        shaders.RunTwist();
      else
        shaders.RunExact(static_cast<int>(seed % 4));
      const Off off = Difference(shaders.Read(), PosesOf(trial.poses));
      EXPECT_LT(off.position, 2e-6) << seed << " " << Name(recovery);
      EXPECT_LT(off.turn, 2e-6) << seed << " " << Name(recovery);
      worst = {std::max(worst.position, off.position), std::max(worst.turn, off.turn)};
      ++tried;
      with_loops += simulation->world().mechanisms()[0].model().loop_rank() > 0 ? 1 : 0;
    }
  }
  std::printf("%d tried, %d with loops: off by at most %.2e of size, %.2e rad\n", tried, with_loops,
              worst.position, worst.turn);
  EXPECT_GT(tried, 50);
  EXPECT_GT(with_loops, 25);
}

}  // namespace
}  // namespace fork1s::test
