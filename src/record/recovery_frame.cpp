// Numbers of one state: what is uploaded in every frame, and a frame to try shaders with.
#include <algorithm>
#include <fork1s/record/recovery_buffers.hpp>
#include <fork1s/recovery/recover.hpp>
#include <stdexcept>

#include "recovery_parts.hpp"

namespace fork1s {
namespace {

using internal::IsCorrected;

// Of a pose as the shaders have it.
float* PutMotion(const RigidTransform& X, float last, float* out) {
  const Quaternion q = X.quaternion();
  for (double c : {q.x(), q.y(), q.z(), q.w()}) *out++ = static_cast<float>(c);
  for (int i = 0; i < 3; ++i) *out++ = static_cast<float>(X.translation()(i));
  *out++ = last;
  return out;
}

// q - q_ref - Q z.
template <class Displacements>
float* PutCorrection(const ReducedModel& model, const ReducedState& state, const Displacements& q,
                     float* out) {
  const auto n = model.num_coordinates();
  for (int i = 0; i < n; ++i)
    *out++ = static_cast<float>(q(i) - model.q_ref(i) - model.Q_rows.row(i).dot(state.z));
  return out;
}

float* PutBases(const World& world, float* out) {
  for (const MechanismDynamics& m : world.mechanisms()) out = PutMotion(m.state().X_WR, 0, out);
  for (const FreeBody& b : world.free_bodies()) out = PutMotion(b.pose(), 0, out);
  return out;
}

float* PutReduced(const VectorX& z, float* out) {
  for (Eigen::Index k = 0; k < z.size(); ++k) *out++ = static_cast<float>(z(k));
  return out;
}

}  // namespace

void RecoveryBuffers::WriteFrame(const Simulation& simulation, std::vector<float>& frame) const {
  if (!IsOf(simulation))
    throw std::invalid_argument(
        "RecoveryBuffers::WriteFrame: the reference has moved since these buffers were made; make them again");
  frame.resize(frame_size());
  const auto& mechanisms = simulation.world().mechanisms();
  float* out = PutBases(simulation.world(), frame.data());
  for (const MechanismDynamics& m : mechanisms) out = PutReduced(m.state().z, out);
  for (const MechanismDynamics& m : mechanisms)
    if (IsCorrected(m)) out = PutCorrection(m.model(), m.state(), m.configuration().q, out);
}

RecoveryBuffers::Trial RecoveryBuffers::MakeTrial(const Simulation& simulation) const {
  const World& world = simulation.world();
  Trial trial;
  trial.frame.resize(frame_size());
  float* out = PutBases(world, trial.frame.data());
  std::vector<float> corrections;
  std::vector<std::vector<RigidTransform>> poses;  // of the bodies of every mechanism, in the world
  for (const MechanismDynamics& m : world.mechanisms()) {
    const ReducedModel& model = m.model();
    const VectorX inverse_units = model.h_inverse.cwiseSqrt().cwiseInverse();  // 1, or one over a length
    ReducedState state = m.state();
    // Every coordinate moves what it moves most about as far, and they do not all go the same way.
    const auto farthest = [&](const VectorX& q) {
      return q.size() > 0 ? q.cwiseProduct(inverse_units).cwiseAbs().maxCoeff() : 0.0;
    };
    VectorX way(model.size());
    for (Eigen::Index k = 0; k < way.size(); ++k) {
      const double alone = farthest(model.Q.col(k));
      way(k) = alone > 0 ? (1 - 0.4 * static_cast<double>(k % 5)) / alone : 0;
    }
    VectorX all = VectorX::Zero(model.num_coordinates());
    AddMotion(model, model.Q_rows, way, all);
    const double most = farthest(all);
    std::vector<RigidTransform> X_RB;
    Configuration configuration(model);
    const VectorX start = state.z;
    // Where so large a step would tear loops, a smaller one tries the shaders as well.
    for (double share = most > 0 ? 0.1 / most : 0;; share *= 0.5) {
      state.z = start + share * way;
      if (recovery_ == Recovery::kTwist) {
        RecoverPosesTwist(model, state, X_RB);
        break;
      }
      RecoverPosesExact(model, state, configuration, X_RB);
      if (model.loop_rank() == 0 || model.curvature.exists() || configuration.loop_residual < 1e-8 ||
          share * most < 1e-6)
        break;
    }
    out = PutReduced(state.z, out);
    if (IsCorrected(m)) {
      std::vector<float> own(static_cast<std::size_t>(model.num_coordinates()));
      PutCorrection(model, state, configuration.q, own.data());
      corrections.insert(corrections.end(), own.begin(), own.end());
    }
    for (RigidTransform& X : X_RB) X = state.X_WR * X;
    poses.push_back(std::move(X_RB));
  }
  std::copy(corrections.begin(), corrections.end(), out);
  trial.poses.resize(8 * static_cast<std::size_t>(bodies()));
  float* pose = trial.poses.data();
  for (const SceneBody& b : simulation.bodies()) {
    const auto index = static_cast<std::size_t>(b.index);
    pose = PutMotion(b.mechanism < 0 ? world.free_bodies()[index].pose()
                                     : poses[static_cast<std::size_t>(b.mechanism)][index],
                     1, pose);
  }
  return trial;
}

}  // namespace fork1s
