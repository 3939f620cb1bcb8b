#include "error_companion.hpp"
#include "linalg/cholesky.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "mechanism/one_unit.hpp"

#include <algorithm>
#include <cmath>

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
  basis_.tree = mechanism.num_constraints() == 0;
  for (int i = 0; i < 3; ++i) {
    q_[i] = m.configuration().q;
    X_[i] = m.state().X_WR;
    v_[i] = m.model().size() > 0 ? VectorX(m.configuration().Q_now * m.state().w) : VectorX(VectorX::Zero(n));
    V_[i] = m.state().V_R;
    stop_forces_[i] = VectorX::Zero(n);
  }
  earlier_.v = earlier_.v_before = v_[0];
  scratch_.F.resize(6, mechanism.num_bodies());
  scratch_.body_V = scratch_.body_A = scratch_.F;
  for (Loads* l : {&loads_[0], &loads_[1], &mean_}) {
    l->F_W = Matrix6X::Zero(6, mechanism.num_bodies());
    l->controls = m.controls();
    for (Eigen::Index k = 0; k < m.activation().size(); ++k) l->controls(k) = m.ActivationOf(k);
    l->controls_from = l->controls;
    l->stops = VectorX::Zero(n);
  }
  scratch_.tau.resize(n);
  scratch_.spring.resize(n);
  scratch_.full.resize(base_ + n);
  for (Motion* motion : {&motion_.centred, &motion_.euler}) motion->q_dot = motion->q_ddot = VectorX::Zero(n);
  basis_.B = MatrixX::Identity(n, n);
}

void ErrorCompanion::Begin(const MechanismDynamics& m) {
  loads_[0] = loads_[1];
  applied_.before = applied_.now;
  m.ComputeLoadWrenches_W(applied_.now);
}

void ErrorCompanion::End(const MechanismDynamics& m, const Matrix6X& contacts_before_W,
                         const Matrix6X& contacts_W, const Matrix6X& contacts_curved_W, const VectorX& stops,
                         const StepOptions& options, bool smooth) {
  const double h = h_ = options.h;
  by_euler_ = options.integrator == Integrator::kEuler;
  if (m.point_spring().IsActive()) {
    const BodyIndex body = m.point_spring_body();
    applied_.now.col(body.value()) += m.point_spring().Wrench(m.BodyPose(body), m.BodyVelocity(body));
  }
  if (steps_ == 0) applied_.before = applied_.now;
  loads_[0].F_W = applied_.before + contacts_before_W;
  loads_[1].F_W = applied_.now + contacts_W;
  loads_[1].stops = stops;
  loads_[1].controls = m.controls();
  loads_[1].controls_from = options.controls_move ? loads_[0].controls : loads_[1].controls;
  // An activation moves on from where it was.
  for (Eigen::Index k = 0; k < m.activation().size(); ++k) {
    if (!m.HasDynamics(k)) continue;
    loads_[1].controls(k) = m.activation()(k);
    loads_[1].controls_from(k) = loads_[0].controls(k);
  }
  if (steps_ == 0) loads_[0].stops = loads_[1].stops;
  earlier_.v_before = earlier_.v;
  earlier_.V_before = earlier_.V;
  earlier_.v = v_[0];
  earlier_.V = V_[0];
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
  contacts_curved_ = contacts_curved_W;
  stop_forces_[0] = stop_forces_[1];
  stop_forces_[1] = stop_forces_[2];
  stop_forces_[2] = stops;
  nodes_without_kink_ = ControlsKink() ? 0 : nodes_without_kink_ + 1;
  // Differences are of the present node and the three before it; the first step begins at once.
  smooth_ = smooth && !by_euler_ && steps_ > 5 && nodes_without_kink_ > 3;
}

// Whether the slope of controls changes at the node, or they jump there.
bool ErrorCompanion::ControlsKink() const {
  if (loads_[1].controls.size() == 0) return false;
  constexpr double kRounding = 1e-9;  // of controls that move evenly, of their size
  const VectorX before = loads_[0].controls - loads_[0].controls_from,
                now = loads_[1].controls - loads_[1].controls_from,
                jump = loads_[1].controls_from - loads_[0].controls;
  const double most = kRounding * std::max(loads_[1].controls.cwiseAbs().maxCoeff(),
                                           loads_[0].controls.cwiseAbs().maxCoeff());
  return (now - before).cwiseAbs().maxCoeff() > most || jump.cwiseAbs().maxCoeff() > most;
}

void ErrorCompanion::Missing(const MechanismDynamics& m, const Vector3& gravity_W, const VectorX& q,
                             const RigidTransform& X_WR, const Motion& motion, const Loads& loads,
                             VectorX& out) {
  const Mechanism& mechanism = m.mechanism();
  const Kinematics& kinematics = scratch_.kinematics;
  scratch_.F.setZero();
  AddGravityWrenches(mechanism, kinematics, X_WR.rotation().transpose() * gravity_W, scratch_.F);
  for (int b = 0; b < mechanism.num_bodies(); ++b)
    if (!loads.F_W.col(b).isZero(0)) scratch_.F.col(b) += AdjointTransposeApply(X_WR, loads.F_W.col(b));
  SubtractVelocityWrenches(mechanism, kinematics, q, motion.V, motion.q_dot, motion.q_ddot, scratch_.body_V,
                           scratch_.body_A, scratch_.F);
  if (mechanism.base() != BaseKind::kFixed)
    SubtractRigidMotionWrenches(mechanism, kinematics, Vector6::Zero(), motion.A, scratch_.F);
  scratch_.tau = loads.stops;
  SubtractArmatureForces(mechanism, kinematics, q, motion.q_dot, motion.q_ddot, scratch_.tau);
  AccumulateGeneralizedForce(mechanism, kinematics.S, scratch_.F, scratch_.tau);
  if (loads.controls.size() > 0) {
    AddControlForce(mechanism, kinematics, loads.controls, scratch_.tau);
    AddMuscleRateForce(mechanism, kinematics, loads.controls, motion.q_dot, scratch_.tau);
  }
  SpringForce(mechanism, kinematics, q, scratch_.spring);
  scratch_.tau += scratch_.spring;
  scratch_.tau.noalias() -= tangent_.damping * motion.q_dot;
  if (base_ > 0) out.head<6>() = scratch_.F.col(0);
  out.tail(scratch_.tau.size()) = scratch_.tau;
}

void ErrorCompanion::ToBasis(const VectorX& full, Eigen::Ref<VectorX> y) const {
  const int n = static_cast<int>(basis_.B.rows());
  if (base_ > 0) y.head<6>() = full.head<6>();
  if (basis_.tree)
    y.tail(n) = full.tail(n);
  else
    y.tail(basis_.B.cols()).noalias() = basis_.B.transpose() * full.tail(n);
}

// Motion and loads at the node. A floating base is seen by one who moves as its origin does at the node, for
// whom the forces are the same: at 5 m/s of free fall tangents would be of little else.
void ErrorCompanion::Centre() {
  motion_.centred.q_dot = 0.5 * (v_[1] + v_[2]);
  motion_.centred.q_ddot = (v_[2] - v_[1]) / h_;
  motion_.centred.V = 0.5 * (V_[1] + V_[2]);
  motion_.centred.A = (V_[2] - V_[1]) / h_;
  if (base_ > 0) {
    motion_.centred.A.tail<3>() += motion_.centred.V.head<3>().cross(Vector3(motion_.centred.V.tail<3>()));
    motion_.centred.V.tail<3>().setZero();
  }
  // What a step applies is what acts at its end, where it changes gently. A blow falls at some time within
  // it.
  for (Eigen::Index b = 0; b < mean_.F_W.cols(); ++b)
    mean_.F_W.col(b) = LoadAtNode(loads_[0].F_W.col(b), loads_[1].F_W.col(b), by_euler_);
  mean_.controls = loads_[0].controls;  // inputs are those of the end of a step
  mean_.stops = 0.5 * (loads_[0].stops + loads_[1].stops);
  if (smooth_) CorrectCentred();
}

// Centred differences err by h^2, as a step of two stages does: most of what they find might be their own
// error. The derivatives of past steps take that out, to h^3 (v = dq/dt):
//     v = (q_{n+1} - q_{n-1})/2h - h^2/6 d2v/dt2,   dv/dt = (q_{n+1} - 2 q_n + q_{n-1})/h^2 - h^2/12 d3v/dt3
// The mean of contact forces of two steps is that of their node and h^2/6 of their second derivative. The mean
// twist of a base over a step is the logarithm of its motion over h, less h^2/12 [V, dV/dt] (Magnus).
void ErrorCompanion::CorrectCentred() {
  const double h2 = h_ * h_;
  const RateDerivatives<VectorX> q(earlier_.v_before, earlier_.v, v_[0], v_[1], v_[2], h_);
  motion_.centred.q_dot -= h2 / 6 * q.second;
  motion_.centred.q_ddot -= h2 / 12 * q.third;
  const RateDerivatives<Vector6> V(earlier_.V_before, earlier_.V, V_[0], V_[1], V_[2], h_);
  const Vector6 twist = 0.5 * (V_[1] + V_[2]), change = (V_[2] - V_[1]) / h_;
  const Vector6 dV = -h2 / 6 * V.second - h2 / 12 * Bracket(twist, change);
  motion_.centred.A += -h2 / 12 * V.third - h2 / 12 * Bracket(twist, V.second);
  motion_.centred.V.head<3>() += dV.head<3>();
  if (base_ > 0)  // seen by one who moves as the origin does
    motion_.centred.A.tail<3>() +=
        twist.head<3>().cross(Vector3(dV.tail<3>())) + dV.head<3>().cross(Vector3(twist.tail<3>()));
  else
    motion_.centred.V.tail<3>() += dV.tail<3>();
  mean_.F_W -= contacts_curved_ / 6;
  mean_.stops -= (stop_forces_[2] - 2 * stop_forces_[1] + stop_forces_[0]) / 6;
}

void ErrorCompanion::Residuals(const MechanismDynamics& m, const Vector3& gravity_W,
                               Eigen::Ref<VectorX> centred, Eigen::Ref<VectorX> euler,
                               Eigen::Ref<VectorX> straight) {
  Centre();
  std::swap(scratch_.kinematics, kinematics_);
  Missing(m, gravity_W, q_[1], X_[1], motion_.centred, mean_, scratch_.full);
  ToBasis(scratch_.full, centred);
  motion_.euler = motion_.centred;
  motion_.euler.q_ddot.setZero();
  motion_.euler.A -= (V_[2] - V_[1]) / h_;
  Missing(m, gravity_W, q_[1], X_[1], motion_.euler, mean_, scratch_.full);
  ToBasis(scratch_.full, straight);
  if (steps_ > 1) {
    motion_.euler.q_dot = v_[1];
    motion_.euler.q_ddot = (v_[1] - v_[0]) / h_;
    motion_.euler.V = V_[1];
    motion_.euler.A = (V_[1] - V_[0]) / h_;
    Missing(m, gravity_W, q_[1], X_[1], motion_.euler, loads_[0], scratch_.full);
    ToBasis(scratch_.full, euler);
  } else {
    euler.setZero();
  }
  std::swap(scratch_.kinematics, kinematics_);
}

void ErrorCompanion::ControlKink(const MechanismDynamics& m, Eigen::Ref<VectorX> kink) {
  scratch_.full.setZero();
  scratch_.tau.setZero();
  if (steps_ > 2 && mean_.controls.size() > 0) {
    const VectorX change =
        loads_[1].controls - loads_[1].controls_from - (loads_[0].controls - loads_[0].controls_from);
    AddControlForce(m.mechanism(), kinematics_, change / 6, scratch_.tau);
  }
  scratch_.full.tail(scratch_.tau.size()) = scratch_.tau;
  ToBasis(scratch_.full, kink);
}

VectorX ErrorCompanion::Turn() const {
  VectorX full(full_size()), turn(size());
  if (base_ > 0) full.head<6>() = V_[2] - V_[1];
  full.tail(v_[2].size()) = v_[2] - v_[1];
  if (basis_.tree) return full;
  if (base_ > 0) turn.head<6>() = full.head<6>();
  turn.tail(basis_.B.cols()) = basis_.to_basis * full.tail(v_[2].size());
  return turn;
}

void ErrorCompanion::SplitOff(const MechanismDynamics& m, const Eigen::Ref<const VectorX>& residual,
                              Eigen::Ref<VectorX> seen) {
  if (!m.model().has_complement)
    seen = residual;
  else
    seen.noalias() = tangent_.seen * residual;
}

// Tangents hold what forces at the node do when it is moved, so they go stale with pose, rates and
// accelerations; a change of rate counts by what it moves in the time that the tangents are old.
double ErrorCompanion::Moved(const MechanismDynamics& m, double age) {
  Centre();
  double moved = 0;
  for (int i = 0; i < linearised_.q.size(); ++i) {
    const bool turns = m.mechanism().Turns(i);
    const double by =
        std::max({std::abs(q_[1](i) - linearised_.q(i)),
                  age * std::abs(motion_.centred.q_dot(i) - linearised_.motion.q_dot(i)),
                  age * age * std::abs(motion_.centred.q_ddot(i) - linearised_.motion.q_ddot(i))});
    moved = std::max(moved, turns ? by : by / m.mechanism().length_scale());
  }
  if (base_ > 0) {
    moved = std::max({moved, LogRotation(linearised_.X.rotation().transpose() * X_[1].rotation()).norm(),
                      age * (motion_.centred.V - linearised_.motion.V).head<3>().norm(),
                      age * age * (motion_.centred.A - linearised_.motion.A).head<3>().norm(),
                      age * age * (motion_.centred.A - linearised_.motion.A).tail<3>().norm() /
                          m.mechanism().length_scale()});
  }
  return moved;
}

void ErrorCompanion::Linearise(const MechanismDynamics& m, const Vector3& gravity_W, MatrixX& from) {
  const Mechanism& mechanism = m.mechanism();
  const int n = mechanism.num_coordinates();
  const Kinematics& kinematics = kinematics_;
  tangent_.damping = DampingMatrix(mechanism, kinematics, q_[1]);
  linearised_.q = q_[1];
  linearised_.X = X_[1];
  MatrixX A;
  if (!basis_.tree) {
    ClosureJacobian(mechanism, kinematics, q_[1], A);
    const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
    const MatrixX N = ComputeNullSpace(ClosureRowsInOneUnit(mechanism, kinematics, q_[1], unit)).unseen;
    basis_.to_basis = ScaledColumns(N.transpose(), unit.coordinate.cwiseInverse());
    if (from.cols() > 0) {
      MatrixX now(base_ + N.cols(), from.cols());
      now.topRows(base_) = from.topRows(base_);
      now.bottomRows(N.cols()) =
          Times(basis_.to_basis, Times(basis_.B, from.bottomRows(from.rows() - base_)));
      from = now;
    }
    basis_.B = ScaledRows(unit.coordinate, N);
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
  basis.bottomRightCorner(n, k - base_) = basis_.B;
  tangent_.M = Congruence(M_full, basis);

  // Tangents by differences of all that is missing, loop reactions included.
  Centre();
  linearised_.motion = motion_.centred;
  VectorX lambda;
  if (!basis_.tree) {
    scratch_.kinematics = kinematics_;
    Missing(m, gravity_W, q_[1], X_[1], motion_.centred, mean_, scratch_.full);
    lambda = -LeastNormSolve(A.transpose(), scratch_.full.tail(n), 1e-9);
  }
  tangent_.K.resize(k, k);
  tangent_.D.resize(k, k);
  constexpr double kStep = 1e-6;  // of a smooth function: half the digits to truncation, half to rounding
  VectorX here(base_ + n), moved(base_ + n), q = q_[1];
  MatrixX A_moved;
  Motion motion = motion_.centred;
  std::swap(scratch_.kinematics, kinematics_);
  Missing(m, gravity_W, q_[1], X_[1], motion_.centred, mean_, here);
  if (!basis_.tree) here.tail(n) += A.transpose() * lambda;
  auto set_column = [&](MatrixX& tangent, int i) {
    scratch_.full = (here - moved) / kStep;
    ToBasis(scratch_.full, tangent.col(i));
  };
  for (int i = 0; i < base_; ++i) {
    const Vector6 e = kStep * Vector6::Unit(i);
    motion.V = motion_.centred.V + Bracket(motion_.centred.V, e);
    motion.A = motion_.centred.A + Bracket(motion_.centred.A, e);
    Missing(m, gravity_W, q_[1], X_[1] * Exp(e), motion, mean_, moved);
    if (!basis_.tree) moved.tail(n) += A.transpose() * lambda;
    set_column(tangent_.K, i);
    motion.V = motion_.centred.V + e;
    motion.A = motion_.centred.A + Bracket(motion_.centred.V, e);
    Missing(m, gravity_W, q_[1], X_[1], motion, mean_, moved);
    if (!basis_.tree) moved.tail(n) += A.transpose() * lambda;
    set_column(tangent_.D, i);
  }
  motion = motion_.centred;
  for (int i = base_; i < k; ++i) {
    motion.q_dot = motion_.centred.q_dot + kStep * basis_.B.col(i - base_);
    Missing(m, gravity_W, q_[1], X_[1], motion, mean_, moved);
    if (!basis_.tree) moved.tail(n) += A.transpose() * lambda;
    set_column(tangent_.D, i);
  }
  std::swap(scratch_.kinematics, kinematics_);
  for (int i = base_; i < k; ++i) {
    q = q_[1] + kStep * basis_.B.col(i - base_);
    ComputeKinematics(mechanism, q, scratch_.kinematics);
    Missing(m, gravity_W, q, X_[1], motion_.centred, mean_, moved);
    if (!basis_.tree) {
      ClosureJacobian(mechanism, scratch_.kinematics, q, A_moved);
      moved.tail(n) += A_moved.transpose() * lambda;
    }
    set_column(tangent_.K, i);
  }

  if (m.model().has_complement) {
    const int r = m.model().size();
    const RowMatrixX& Q = m.recovery() != Recovery::kTwist ? m.configuration().Q_now : m.model().Q_rows;
    MatrixX Q_y = MatrixX::Zero(k, base_ + r);
    Q_y.topLeftCorner(base_, base_).setIdentity();
    if (basis_.tree)
      Q_y.bottomRightCorner(n, r) = Q;
    else
      Q_y.bottomRightCorner(k - base_, r) = basis_.to_basis * Q;
    const MatrixX MQ = tangent_.M * Q_y;
    tangent_.seen = Times(MQ, SolveSymmetric(TransposedTimes(Q_y, MQ), Q_y.transpose()));
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
  const VectorX e = basis_.B * y.tail(basis_.B.cols());
  Vector6 twist = base_ > 0 ? Vector6(y.head<6>()) : Vector6(Vector6::Zero());
  for (int j = mechanism.body(b).last_joint; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
    const auto& joint = mechanism.joint(JointIndex(j));
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) twist += e(i) * kinematics_.S.col(i);
  }
  const Vector3 p_R = kinematics_.X_RB[b.u()].translation();
  return X_[1].rotation() * (twist.tail<3>() + twist.head<3>().cross(p_R));
}

}  // namespace fork1s
