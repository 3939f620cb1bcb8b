// Simulations, their shaders, and what the two are apart.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/recovery_buffers.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <algorithm>
#include <continuum_arm.hpp>
#include <engine_poses/pose_shaders.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace fork1s::test {

using engine_poses::PoseShaders;

inline const std::string kShaders = FORK1S_SOURCE_DIR "/shaders";

// One context for all tests; without one they are skipped.
class GpuPoses : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    try {
      context_ = std::make_unique<engine_poses::Context>();
      std::printf("shaders run on %s\n", context_->Renderer().c_str());
    } catch (const engine_poses::GraphicsError& error) {
      why_ = error.what();
    }
  }
  static void TearDownTestSuite() { context_.reset(); }
  void SetUp() override {
    if (!context_) GTEST_SKIP() << "shaders are not run: " << why_;
  }

 private:
  inline static std::unique_ptr<engine_poses::Context> context_;
  inline static std::string why_;
};

inline Simulation SimulationOf(const Scene& scene, const SimulationOptions& options = {}) {
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

inline Simulation SimulationOf(const std::string& name, Recovery recovery) {
  auto model = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/" + name + ".xml");
  if (!model) throw std::runtime_error(model.error().Text());
  SimulationOptions options;
  options.recovery = recovery;
  options.initial_keyframe = model->initial_keyframe;
  return SimulationOf(model->scene, options);
}

inline std::vector<RigidTransform> PosesOf(const std::vector<float>& numbers) {
  std::vector<RigidTransform> poses;
  for (const float* n = numbers.data(); n < numbers.data() + numbers.size(); n += 8) {
    const auto at = [&](int i) { return static_cast<double>(n[i]); };
    const Quaternion q(at(3), at(0), at(1), at(2));
    EXPECT_NEAR(q.norm(), 1, 1e-6);
    poses.emplace_back(q.normalized(), Vector3(at(4), at(5), at(6)));
  }
  return poses;
}

struct Off {
  double position = 0;  // as a share of how far the bodies lie apart
  double turn = 0;      // rad
};

inline Off Difference(const std::vector<float>& numbers, const std::vector<RigidTransform>& truth) {
  const std::vector<RigidTransform> poses = PosesOf(numbers);
  EXPECT_EQ(poses.size(), truth.size());
  Off off;
  double size = 0;
  for (std::size_t b = 0; b < std::min(poses.size(), truth.size()); ++b) {
    size = std::max(size, (truth[b].translation() - truth[0].translation()).norm());
    off.position = std::max(off.position, (poses[b].translation() - truth[b].translation()).norm());
    off.turn = std::max(off.turn, LogRotation(poses[b].rotation().transpose() * truth[b].rotation()).norm());
  }
  off.position /= size;
  return off;
}

inline std::vector<float> Recovered(const Simulation& simulation, int scans = 0) {
  const RecoveryBuffers buffers(simulation);
  PoseShaders shaders(kShaders);
  shaders.SetModel(buffers.tables(), buffers.numbers());
  std::vector<float> frame;
  buffers.WriteFrame(simulation, frame);
  shaders.SetFrame(frame);
  if (buffers.recovery() == Recovery::kTwist)
    shaders.RunTwist();
  else
    shaders.RunExact(scans);
  return shaders.Read();
}

inline std::vector<RigidTransform> Truth(const Simulation& simulation) {
  std::vector<RigidTransform> X_WB;
  simulation.Poses(X_WB);
  if (simulation.fidelity().recovery == Recovery::kTwist)
    for (std::size_t b = 0; b < X_WB.size(); ++b) {
      const SceneBody& body = simulation.bodies()[b];
      if (body.mechanism < 0) continue;
      const MechanismDynamics& m = simulation.world().mechanisms()[static_cast<std::size_t>(body.mechanism)];
      X_WB[b] = m.state().X_WR * RecoverPoseTwist(m.model(), m.state(), BodyIndex(body.index));
    }
  return X_WB;
}

inline void ExpectClose(const Off& off, double position, double turn) {
  std::printf("off by %.2e of size, %.2e rad\n", off.position, off.turn);
  EXPECT_LT(off.position, position);
  EXPECT_LT(off.turn, turn);
}

}  // namespace fork1s::test
