#include "error_companion.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/linalg/null_space.hpp>
#include <fork1s/linalg/products.hpp>
#include <fork1s/mechanism/one_unit.hpp>

namespace fork1s {

Vector6 LoadAtNode(const Vector6& before, const Vector6& after, bool by_euler) {
  constexpr double kGently = 0.5;
  const double change = (after - before).tail<3>().norm();
  const double size = std::max(after.tail<3>().norm(), before.tail<3>().norm());
  return by_euler && change < kGently * size ? before : Vector6(0.5 * (before + after));
}

ErrorCompanion::ErrorCompanion(const MechanismDynamics& m)
    : kinematics_(m.mechanism()), scratch_(m.mechanism()) {
  const Mechanism& mechanism = m.mechanism();
  const int n = mechanism.num_coordinates();
  base_ = mechanism.base() == BaseKind::kFloating ? 6 : 0;
  tree_ = mechanism.num_constraints() == 0;
  for (int i = 0; i < 3; ++i) {
    q_[i] = m.configuration().q;
    X_[i] = m.state().X_WR;
    v_[i] = m.model().size() > 0 ? VectorX(m.configuration().Q_now * m.state().w) : VectorX(VectorX::Zero(n));
    V_[i] = m.state().V_R;
  }
  F_.resize(6, mechanism.num_bodies());
  body_V_ = body_A_ = F_;
  for (Loads* l : {&loads_[0], &loads_[1], &mean_}) {
    l->F_W = Matrix6X::Zero(6, mechanism.num_bodies());
    l->controls = l->controls_from = m.controls();
    l->stops = VectorX::Zero(n);
  }
  tau_.resize(n);
  spring_.resize(n);
  full_.resize(base_ + n);
  for (Motion* motion : {&centred_, &euler_}) motion->q_dot = motion->q_ddot = VectorX::Zero(n);
  B_ = MatrixX::Identity(n, n);
}

void ErrorCompanion::Begin(const MechanismDynamics& m) {
  loads_[0] = loads_[1];
  applied_before_ = applied_;
  m.ComputeLoadWrenches_W(applied_);
}

void ErrorCompanion::End(const MechanismDynamics& m, const Matrix6X& contacts_before_W,
                         const Matrix6X& contacts_W, const VectorX& stops, const StepOptions& options) {
  const double h = h_ = options.h;
  by_euler_ = options.integrator == Integrator::kEuler;
  if (m.point_spring().IsActive()) {
    const BodyIndex body = m.point_spring_body();
    applied_.col(body.value()) += m.point_spring().Wrench(m.BodyPose(body), m.BodyVelocity(body));
  }
  if (steps_ == 0) applied_before_ = applied_;
  loads_[0].F_W = applied_before_ + contacts_before_W;
  loads_[1].F_W = applied_ + contacts_W;
  loads_[1].stops = stops;
  loads_[1].controls = m.controls();
  loads_[1].controls_from = options.controls_move ? loads_[0].controls : loads_[1].controls;
  if (steps_ == 0) loads_[0].stops = loads_[1].stops;
  for (int i = 0; i < 2; ++i) {
    q_[i] = q_[i + 1];
    X_[i] = X_[i + 1];
    v_[i] = v_[i + 1];
    V_[i] = V_[i + 1];
  }
  q_[2] = m.configuration().q;
  X_[2] = m.state().X_WR;
  v_[2] = (q_[2] - q_[1]) / h;
  V_[2] = Log(X_[1].inverse() * X_[2]) / h;
  ++steps_;
  ComputeKinematics(m.mechanism(), q_[1], kinematics_);
}

void ErrorCompanion::Missing(const MechanismDynamics& m, const Vector3& gravity_W, const VectorX& q,
                             const RigidTransform& X_WR, const Motion& motion, const Loads& loads,
                             VectorX& out) {
  const Mechanism& mechanism = m.mechanism();
  const Kinematics& kinematics = scratch_;
  F_.setZero();
  AddGravityWrenches(mechanism, kinematics, X_WR.rotation().transpose() * gravity_W, F_);
  for (int b = 0; b < mechanism.num_bodies(); ++b)
    if (!loads.F_W.col(b).isZero(0)) F_.col(b) += AdjointTransposeApply(X_WR, loads.F_W.col(b));
  SubtractVelocityWrenches(mechanism, kinematics, q, motion.V, motion.q_dot, motion.q_ddot, body_V_, body_A_,
                           F_);
  if (mechanism.base() != BaseKind::kFixed)
    SubtractRigidMotionWrenches(mechanism, kinematics, Vector6::Zero(), motion.A, F_);
  tau_ = loads.stops;
  SubtractArmatureForces(mechanism, kinematics, q, motion.q_dot, motion.q_ddot, tau_);
  AccumulateGeneralizedForce(mechanism, kinematics.S, F_, tau_);
  if (loads.controls.size() > 0) AddControlForce(mechanism, kinematics, loads.controls, tau_);
  SpringForce(mechanism, kinematics, q, spring_);
  tau_ += spring_;
  tau_.noalias() -= damping_ * motion.q_dot;
  if (base_ > 0) out.head<6>() = F_.col(0);
  out.tail(tau_.size()) = tau_;
}

void ErrorCompanion::ToBasis(const VectorX& full, Eigen::Ref<VectorX> y) const {
  const int n = static_cast<int>(B_.rows());
  if (base_ > 0) y.head<6>() = full.head<6>();
  if (tree_)
    y.tail(n) = full.tail(n);
  else
    y.tail(B_.cols()).noalias() = B_.transpose() * full.tail(n);
}

// Motion and loads at the node. A floating base is seen by one who moves as its origin does at the node, for
// whom the forces are the same: at 5 m/s of free fall tangents would be of little else.
void ErrorCompanion::Centre() {
  centred_.q_dot = 0.5 * (v_[1] + v_[2]);
  centred_.q_ddot = (v_[2] - v_[1]) / h_;
  centred_.V = 0.5 * (V_[1] + V_[2]);
  centred_.A = (V_[2] - V_[1]) / h_;
  if (base_ > 0) {
    centred_.A.tail<3>() += centred_.V.head<3>().cross(Vector3(centred_.V.tail<3>()));
    centred_.V.tail<3>().setZero();
  }
  // What a step applies is what acts at its end, where it changes gently. A blow falls at some time within
  // it.
  for (Eigen::Index b = 0; b < mean_.F_W.cols(); ++b)
    mean_.F_W.col(b) = LoadAtNode(loads_[0].F_W.col(b), loads_[1].F_W.col(b), by_euler_);
  mean_.controls = loads_[0].controls;  // inputs are those of the end of a step
  mean_.stops = 0.5 * (loads_[0].stops + loads_[1].stops);
}

void ErrorCompanion::Residuals(const MechanismDynamics& m, const Vector3& gravity_W,
                               Eigen::Ref<VectorX> centred, Eigen::Ref<VectorX> euler,
                               Eigen::Ref<VectorX> straight) {
  Centre();
  std::swap(scratch_, kinematics_);
  Missing(m, gravity_W, q_[1], X_[1], centred_, mean_, full_);
  ToBasis(full_, centred);
  euler_ = centred_;
  euler_.q_ddot.setZero();
  euler_.A -= (V_[2] - V_[1]) / h_;
  Missing(m, gravity_W, q_[1], X_[1], euler_, mean_, full_);
  ToBasis(full_, straight);
  if (steps_ > 1) {
    euler_.q_dot = v_[1];
    euler_.q_ddot = (v_[1] - v_[0]) / h_;
    euler_.V = V_[1];
    euler_.A = (V_[1] - V_[0]) / h_;
    Missing(m, gravity_W, q_[1], X_[1], euler_, loads_[0], full_);
    ToBasis(full_, euler);
  } else {
    euler.setZero();
  }
  std::swap(scratch_, kinematics_);
}

void ErrorCompanion::ControlKink(const MechanismDynamics& m, Eigen::Ref<VectorX> kink) {
  full_.setZero();
  tau_.setZero();
  if (steps_ > 2 && mean_.controls.size() > 0) {
    const VectorX change =
        loads_[1].controls - loads_[1].controls_from - (loads_[0].controls - loads_[0].controls_from);
    AddControlForce(m.mechanism(), kinematics_, change / 6, tau_);
  }
  full_.tail(tau_.size()) = tau_;
  ToBasis(full_, kink);
}

VectorX ErrorCompanion::Turn() const {
  VectorX full(full_size()), turn(size());
  if (base_ > 0) full.head<6>() = V_[2] - V_[1];
  full.tail(v_[2].size()) = v_[2] - v_[1];
  if (tree_) return full;
  if (base_ > 0) turn.head<6>() = full.head<6>();
  turn.tail(B_.cols()) = to_basis_ * full.tail(v_[2].size());
  return turn;
}

void ErrorCompanion::SplitOff(const MechanismDynamics& m, const Eigen::Ref<const VectorX>& residual,
                              Eigen::Ref<VectorX> seen) {
  if (!m.model().has_complement)
    seen = residual;
  else
    seen.noalias() = seen_ * residual;
}

// Tangents hold what forces at the node do when it is moved, so they go stale with pose, rates and
// accelerations; a change of rate counts by what it moves in the time that the tangents are old.
double ErrorCompanion::Moved(const MechanismDynamics& m, double age) {
  Centre();
  double moved = 0;
  for (int i = 0; i < q_linear_.size(); ++i) {
    const bool turns = m.mechanism().Turns(i);
    const double by =
        std::max({std::abs(q_[1](i) - q_linear_(i)), age * std::abs(centred_.q_dot(i) - linear_.q_dot(i)),
                  age * age * std::abs(centred_.q_ddot(i) - linear_.q_ddot(i))});
    moved = std::max(moved, turns ? by : by / m.mechanism().length_scale());
  }
  if (base_ > 0) {
    moved = std::max({moved, LogRotation(X_linear_.rotation().transpose() * X_[1].rotation()).norm(),
                      age * (centred_.V - linear_.V).head<3>().norm(),
                      age * age * (centred_.A - linear_.A).head<3>().norm(),
                      age * age * (centred_.A - linear_.A).tail<3>().norm() / m.mechanism().length_scale()});
  }
  return moved;
}

void ErrorCompanion::Linearise(const MechanismDynamics& m, const Vector3& gravity_W, MatrixX& from) {
  const Mechanism& mechanism = m.mechanism();
  const int n = mechanism.num_coordinates();
  const Kinematics& kinematics = kinematics_;
  damping_ = DampingMatrix(mechanism, kinematics, q_[1]);
  q_linear_ = q_[1];
  X_linear_ = X_[1];
  MatrixX A;
  if (!tree_) {
    ClosureJacobian(mechanism, kinematics, q_[1], A);
    const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
    const MatrixX N = ComputeNullSpace(ClosureRowsInOneUnit(mechanism, kinematics, q_[1], unit)).unseen;
    to_basis_ = ScaledColumns(N.transpose(), unit.coordinate.cwiseInverse());
    if (from.cols() > 0) {
      MatrixX now(base_ + N.cols(), from.cols());
      now.topRows(base_) = from.topRows(base_);
      now.bottomRows(N.cols()) = Times(to_basis_, Times(B_, from.bottomRows(from.rows() - base_)));
      from = now;
    }
    B_ = ScaledRows(unit.coordinate, N);
  }
  const int k = size();
  MatrixX Mq;
  MassMatrix(mechanism, kinematics, Mq);
  MatrixX M_full(base_ + n, base_ + n);
  M_full.bottomRightCorner(n, n) = Mq;
  if (base_ > 0) {
    Matrix6 M_00;
    Matrix6X M_0q;
    BaseInertia(mechanism, kinematics, M_00, M_0q);
    M_full.topLeftCorner<6, 6>() = M_00;
    M_full.topRightCorner(6, n) = M_0q;
    M_full.bottomLeftCorner(n, 6) = M_0q.transpose();
  }
  MatrixX basis = MatrixX::Zero(base_ + n, k);
  basis.topLeftCorner(base_, base_).setIdentity();
  basis.bottomRightCorner(n, k - base_) = B_;
  M_y_ = Congruence(M_full, basis);

  // Tangents by differences of all that is missing, loop reactions included.
  Centre();
  linear_ = centred_;
  VectorX lambda;
  if (!tree_) {
    scratch_ = kinematics_;
    Missing(m, gravity_W, q_[1], X_[1], centred_, mean_, full_);
    lambda = -LeastNormSolve(A.transpose(), full_.tail(n), 1e-9);
  }
  K_y_.resize(k, k);
  D_y_.resize(k, k);
  constexpr double kStep = 1e-6;  // of a smooth function: half the digits to truncation, half to rounding
  VectorX here(base_ + n), moved(base_ + n), q = q_[1];
  MatrixX A_moved;
  Motion motion = centred_;
  std::swap(scratch_, kinematics_);
  Missing(m, gravity_W, q_[1], X_[1], centred_, mean_, here);
  if (!tree_) here.tail(n) += A.transpose() * lambda;
  auto set_column = [&](MatrixX& tangent, int i) {
    full_ = (here - moved) / kStep;
    ToBasis(full_, tangent.col(i));
  };
  for (int i = 0; i < base_; ++i) {
    const Vector6 e = kStep * Vector6::Unit(i);
    motion.V = centred_.V + Bracket(centred_.V, e);
    motion.A = centred_.A + Bracket(centred_.A, e);
    Missing(m, gravity_W, q_[1], X_[1] * Exp(e), motion, mean_, moved);
    if (!tree_) moved.tail(n) += A.transpose() * lambda;
    set_column(K_y_, i);
    motion.V = centred_.V + e;
    motion.A = centred_.A + Bracket(centred_.V, e);
    Missing(m, gravity_W, q_[1], X_[1], motion, mean_, moved);
    if (!tree_) moved.tail(n) += A.transpose() * lambda;
    set_column(D_y_, i);
  }
  motion = centred_;
  for (int i = base_; i < k; ++i) {
    motion.q_dot = centred_.q_dot + kStep * B_.col(i - base_);
    Missing(m, gravity_W, q_[1], X_[1], motion, mean_, moved);
    if (!tree_) moved.tail(n) += A.transpose() * lambda;
    set_column(D_y_, i);
  }
  std::swap(scratch_, kinematics_);
  for (int i = base_; i < k; ++i) {
    q = q_[1] + kStep * B_.col(i - base_);
    ComputeKinematics(mechanism, q, scratch_);
    Missing(m, gravity_W, q, X_[1], centred_, mean_, moved);
    if (!tree_) {
      ClosureJacobian(mechanism, scratch_, q, A_moved);
      moved.tail(n) += A_moved.transpose() * lambda;
    }
    set_column(K_y_, i);
  }

  if (m.model().has_complement) {
    const int r = m.model().size();
    const RowMatrixX& Q = m.recovery() != Recovery::kTwist ? m.configuration().Q_now : m.model().Q_rows;
    MatrixX Q_y = MatrixX::Zero(k, base_ + r);
    Q_y.topLeftCorner(base_, base_).setIdentity();
    if (tree_)
      Q_y.bottomRightCorner(n, r) = Q;
    else
      Q_y.bottomRightCorner(k - base_, r) = to_basis_ * Q;
    const MatrixX MQ = M_y_ * Q_y;
    seen_ = Times(MQ, SolveSymmetric(TransposedTimes(Q_y, MQ), Q_y.transpose()));
  }
}

VectorX ErrorCompanion::WrenchRow(const MechanismDynamics& m, int last_joint, const Vector6& F_W) const {
  const Mechanism& mechanism = m.mechanism();
  const Vector6 F = AdjointTransposeApply(X_[1], F_W);
  VectorX row = VectorX::Zero(full_size());
  for (int j = last_joint; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
    const auto& joint = mechanism.joint(JointIndex(j));
    for (int i = joint.offset; i < joint.offset + joint.size; ++i)
      row(base_ + i) = kinematics_.S.col(i).dot(F);
  }
  if (base_ > 0) row.head<6>() = F;
  return row;
}

double ErrorCompanion::SpeedAlong(const MechanismDynamics& m, int last_joint, const Vector6& F_W) const {
  const VectorX row = WrenchRow(m, last_joint, F_W);
  double speed = row.tail(v_[2].size()).dot(v_[2]);
  if (m.mechanism().base() != BaseKind::kFixed) speed += AdjointTransposeApply(X_[1], F_W).dot(V_[2]);
  return speed;
}

Vector3 ErrorCompanion::Displacement(const MechanismDynamics& m, BodyIndex b,
                                     const Eigen::Ref<const VectorX>& y) const {
  const Mechanism& mechanism = m.mechanism();
  const VectorX e = B_ * y.tail(B_.cols());
  Vector6 twist = base_ > 0 ? Vector6(y.head<6>()) : Vector6(Vector6::Zero());
  for (int j = mechanism.body(b).last_joint; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
    const auto& joint = mechanism.joint(JointIndex(j));
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) twist += e(i) * kinematics_.S.col(i);
  }
  const Vector3 p_R = kinematics_.X_RB[b.u()].translation();
  return X_[1].rotation() * (twist.tail<3>() + twist.head<3>().cross(p_R));
}

}  // namespace fork1s
