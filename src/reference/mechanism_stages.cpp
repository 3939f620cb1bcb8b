// A stage in full coordinates: a step of implicit Euler that may start where nothing has been.
//
// What a stage changes is kept in flat spaces, so that going on evenly past its end is a sum: momenta about
// points that do not move with the body, joint displacements and rates, the base's centre. With n the state
// before and 1 the end of the first stage, the second one starts from n + s (1 - n), s = `onward`.
//
// Those points drift with what the whole had as its velocity at the start, and momenta are counted from that
// of the drift: as in any frame that moves evenly the equations are the same. About points that stand, the
// weight of what flies at v turned it by what m g x v makes of a step.
#include "full_mechanism.hpp"

namespace fork1s::internal {
namespace {

RigidTransform Shifted(RigidTransform X, const Vector3& by_W) {
  X.translation() += by_W;
  return X;
}

}  // namespace

// Of a body that moves with the drift alone, in its axes.
Vector6 FullMechanism::DriftMomentum(int body, const RigidTransform& X) const {
  Vector6 V;
  V << Vector3::Zero(), X.rotation().transpose() * drift_W_;
  return inertia_[static_cast<std::size_t>(body)] * V;
}

// The momentum of the stage's start seen from X, where the body is when it ends.
Vector6 FullMechanism::CarriedMomentum(int body, const RigidTransform& X) const {
  return AdjointTransposeApply(X_[static_cast<std::size_t>(body)].inverse() * Shifted(X, -h_ * drift_W_),
                               momentum_.col(body)) +
         DriftMomentum(body, X);
}

// The base turns by the twist after, and its centre of mass moves straight on in the world, so that a drift
// of the whole changes nothing else.
RigidTransform FullMechanism::BaseMoved(const Vector6& V, const Matrix3& R_end, double h) const {
  const Vector3& center = mechanism_->bodies()[0].inertia_B.center;
  const Vector3 velocity_W = R_end * (V.tail<3>() + V.head<3>().cross(center));
  RigidTransform X(Matrix3(X_[0].rotation() * ExpRotation(h * V.head<3>())), Vector3::Zero());
  X.Orthonormalize();
  X.translation() = X_[0] * center + h * velocity_W - X.rotation() * center;
  return X;
}

Vector6 FullMechanism::LoadsAt(int body, const RigidTransform& X) const {
  Vector6 wrench_B = Vector6::Zero();
  for (const Load& load : loads_) {
    if (load.body != body) continue;
    const Vector3 force_B = X.rotation().transpose() * load.force_W;
    wrench_B.head<3>() += X.rotation().transpose() * load.moment_W + load.point_B.cross(force_B);
    wrench_B.tail<3>() += force_B;
  }
  return wrench_B;
}

void FullMechanism::GoOn(double onward) {
  const double h = onward * h_;
  // Poses that close every joint there, for contacts to be looked for; q itself goes straight on.
  std::vector<RigidTransform> X(X_.size());
  X[0] = mechanism_->base() == BaseKind::kFixed    ? X_[0]
         : mechanism_->base() == BaseKind::kDriven ? X_[0] * Exp(h * V_next_.col(0))
                                                   : BaseMoved(V_next_.col(0), X_next_[0].rotation(), h);
  for (std::size_t b = 1; b < X.size(); ++b)
    X[b] = X_next_[b] * Exp((h - h_) * V_next_.col(static_cast<Eigen::Index>(b)));
  const VectorX q = q_ + h * q_dot_next_;
  VectorX closed = q;
  Project(X, closed);

  for (std::size_t b = 0; b < X.size(); ++b) {
    const auto i = static_cast<Eigen::Index>(b);
    const Vector6 end =
        AdjointTransposeApply(Shifted(X_next_[b], -h_ * drift_W_).inverse() * X_[b],
                              inertia_[b] * V_next_.col(i) - DriftMomentum(static_cast<int>(b), X_next_[b]));
    X[b].Orthonormalize();
    momentum_.col(i) = AdjointTransposeApply(X_[b].inverse() * Shifted(X[b], -h * drift_W_),
                                             momentum_.col(i) + onward * (end - momentum_.col(i)));
  }
  rates_start_ += onward * (JointVelocities(q_next_, q_dot_next_) - rates_start_);
  reactions_ += onward * nu_next_;
  reaction_time_ += h;
  X_ = std::move(X);
  q_ = q;
  V_ = V_next_;
  q_dot_ = q_dot_next_;
  nu_ = nu_next_;
  h_last_ = h_;
}

bool FullMechanism::BeginStage(double h, const Vector3& gravity_W, bool second) {
  h_ = h;
  gravity_W_ = gravity_W;
  stage_ = true;
  if (!second) {
    drift_W_.setZero();
    if (mechanism_->base() == BaseKind::kFloating) drift_W_ = Drift(X_, V_);
    if (mechanism_->base() == BaseKind::kDriven) drift_W_ = X_[0].rotation() * V_.col(0).tail<3>();
    StartMomenta();
    for (std::size_t b = 0; b < X_.size(); ++b)
      momentum_.col(static_cast<Eigen::Index>(b)) -= DriftMomentum(static_cast<int>(b), X_[b]);
  }
  V_next_ = V_;
  q_dot_next_ = q_dot_;
  nu_next_ = h_last_ > 0 ? VectorX(nu_ * (h / h_last_)) : nu_;
  X_next_ = X_;
  q_next_ = q_;
  if (mechanism_->base() == BaseKind::kDriven) V_next_.col(0) = driven_twist;
  AdvancePoses();
  return NextIsFinite();
}

void FullMechanism::Restore(const State& state) {
  X_ = state.X;
  V_ = state.V;
  q_ = state.q;
  q_dot_ = state.q_dot;
  nu_ = state.nu;
  reactions_ = state.reactions;
  h_last_ = state.h_last;
  reaction_time_ = state.reaction_time;
}

void FullMechanism::StartReactions() {
  reactions_.setZero();
  reaction_time_ = 0;
}

}  // namespace fork1s::internal
