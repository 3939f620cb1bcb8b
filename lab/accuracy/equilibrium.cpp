// Equations of a reduced model at rest under the dead force F at p, by mode:
//     twist         f_ref − K z + T_Bᵀ [p × F; F] = 0             poses and loads of the reference's screws
//     second order  f_ref − K z + (∂p/∂z)ᵀ F = 0                  energy of the recovered poses
//     open, exact   Q(q)ᵀ (g(q) + τ(q)) = 0,  q = q_ref + Q z (+ loop correction)
//     curved        the same, with the correction and Q(q) of the loops' curvature
// g(q) are the springs' forces, τ(q) those of the load in joint coordinates, both of the present pose. Q has
// load columns for F at the reference, as a simulation has under a force that is applied.
#include "equilibrium.hpp"
#include "linalg/solve.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/recovery/second_order.hpp>
#include <fork1s/reduction/statics.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <numbers>
#include <utility>

namespace fork1s::internal {
namespace {

// Differences of 1e-5 rad: truncation and rounding both near 1e-10 of a derivative.
constexpr double kDifferenceStep = 1e-5;
constexpr double kRefreshAngle = 15 * std::numbers::pi / 180;  // the simulation's default

}  // namespace

ReducedEquilibrium::ReducedEquilibrium(const StaticCase& c, StaticMode mode, ReducedModel model)
    : case_(&c),
      mode_(mode),
      model_(std::make_shared<ReducedModel>(std::move(model))),
      configuration_(std::make_shared<Configuration>(*model_)) {
  Kinematics kinematics(*model_->mechanism);
  ComputeKinematics(*model_->mechanism, model_->q_ref, kinematics);
  SpringForce(*model_->mechanism, kinematics, model_->q_ref, g_ref_);
  x_ = VectorX::Zero(model_->size());
}

// In R about its origin, where the joints are displaced by q.
Matrix6X ReducedEquilibrium::Wrenches(const StaticCase& c, const Kinematics& kinematics, double force_N) {
  const Vector3 F = force_N * c.direction_R;
  Matrix6X wrenches = Matrix6X::Zero(6, c.mechanism->num_bodies());
  wrenches.col(c.body.value()) << kinematics.X_RB[c.body.u()].translation().cross(F), F;
  return wrenches;
}

Expected<ReducedModel> ReducedEquilibrium::ReduceAt(const StaticCase& c, StaticMode mode, const VectorX& q,
                                                    double force_N) {
  Kinematics kinematics(*c.mechanism);
  ComputeKinematics(*c.mechanism, q, kinematics);
  ReductionLoads loads;
  loads.wrenches_R = Wrenches(c, kinematics, force_N);
  auto model = Reduce(c.mechanism, q, {}, &loads);
  if (model && mode == StaticMode::kCurved) model->curvature = LoopCurvature(*model);
  return model;
}

Expected<ReducedEquilibrium> ReducedEquilibrium::Create(const StaticCase& c, StaticMode mode) {
  auto model = ReduceAt(c, mode, c.q0, 1);
  if (!model) return tl::unexpected(model.error());
  return ReducedEquilibrium(c, mode, std::move(*model));
}

void ReducedEquilibrium::SetState(const VectorX& x) {
  state_.z = x;
  if (mode_ == StaticMode::kTwist || mode_ == StaticMode::kSecondOrder) return;
  if (mode_ == StaticMode::kOpen)
    Configure(*model_, state_, *configuration_, 0);
  else
    Configure(*model_, state_, *configuration_);
}

Vector3 ReducedEquilibrium::PositionAt(const VectorX& x) {
  SetState(x);
  if (mode_ != StaticMode::kTwist && mode_ != StaticMode::kSecondOrder)
    return configuration_->kinematics.X_RB[case_->body.u()].translation();
  std::vector<RigidTransform> X_RB;
  if (mode_ == StaticMode::kTwist)
    RecoverPosesTwist(*model_, state_, X_RB);
  else
    RecoverPosesTwistSecondOrder(*model_, state_, X_RB);
  return X_RB[case_->body.u()].translation();
}

VectorX ReducedEquilibrium::ExactResidual(const VectorX& x, double force_N) {
  const Mechanism& m = *model_->mechanism;
  SetState(x);
  const Kinematics& kinematics = configuration_->kinematics;
  VectorX tau = VectorX::Zero(m.num_coordinates()), g;
  Matrix6X wrenches = Wrenches(*case_, kinematics, force_N);
  AccumulateGeneralizedForce(m, kinematics.S, wrenches, tau);
  SpringForce(m, kinematics, configuration_->q, g);
  // Loops that are left open have no present direction of their own: that of the reference stays.
  const RowMatrixX& Q = mode_ == StaticMode::kOpen ? model_->Q_rows : configuration_->Q_now;
  return Q.transpose() * (g + tau);
}

VectorX ReducedEquilibrium::Residual(const VectorX& x, double force_N) {
  if (mode_ != StaticMode::kTwist && mode_ != StaticMode::kSecondOrder) return ExactResidual(x, force_N);
  const Vector3 F = force_N * case_->direction_R;
  VectorX f = model_->Q.transpose() * g_ref_ - model_->K_r.cwiseProduct(x);
  if (mode_ == StaticMode::kTwist) {
    Vector6 wrench;
    wrench << PositionAt(x).cross(F), F;
    return f + model_->T_of(case_->body).transpose() * wrench;
  }
  // Two sums of recovery/second_order.hpp along the path of the loaded body, and their derivatives by z.
  const Mechanism& m = *model_->mechanism;
  std::vector<int> path;
  for (int j = m.body(case_->body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) path.push_back(j);
  Vector6 first = Vector6::Zero(), second = Vector6::Zero();
  Matrix6X first_z = Matrix6X::Zero(6, x.size()), second_z = first_z;
  for (auto j = path.rbegin(); j != path.rend(); ++j) {
    const Mechanism::Joint& joint = m.joint(JointIndex(*j));
    const Matrix6X x_z =
        model_->S_ref.middleCols(joint.offset, joint.size) * model_->Q.middleRows(joint.offset, joint.size);
    const Vector6 x_j = x_z * x;
    second += 0.5 * Bracket(first, x_j);
    second_z += 0.5 * (SmallAdjoint(first) * x_z - SmallAdjoint(x_j) * first_z);
    first += x_j;
    first_z += x_z;
  }
  Vector6 wrench;
  wrench << PositionAt(x).cross(F), F;
  f += (Dexp(first + second) * (first_z + second_z)).transpose() * wrench;
  return f;
}

bool ReducedEquilibrium::Newton(VectorX& x, double force_N) {
  // Joint displacements are about 1: steps below this are rounding of the differences above.
  constexpr double kConverged = 1e-10;
  const auto n = x.size();
  for (int iteration = 0; iteration < 40; ++iteration) {
    const VectorX r = Residual(x, force_N);
    if (!r.allFinite()) return false;
    MatrixX J(n, n);
    VectorX y = x;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double unit = model_->Q.col(i).cwiseAbs().maxCoeff();
      const double step = kDifferenceStep / std::max(1e-12, unit);  // a column of Q may be long
      y(i) = x(i) + step;
      const VectorX above = Residual(y, force_N);
      y(i) = x(i) - step;
      J.col(i) = (above - Residual(y, force_N)) / (2 * step);
      y(i) = x(i);
    }
    VectorX step = -SolveSquare(J, r);
    if (!step.allFinite()) return false;
    const double largest = (model_->Q * step).cwiseAbs().maxCoeff();
    x += std::min(1.0, 0.4 / largest) * step;
    if (largest < kConverged) return true;
  }
  return false;
}

bool ReducedEquilibrium::RefreshWhereDue(double force_N) {
  SetState(x_);
  if (MaxJointRotation(*model_->mechanism, model_->q_ref, configuration_->q) < kRefreshAngle) return true;
  auto model = ReduceAt(*case_, mode_, configuration_->q, force_N);
  if (!model) return false;
  *this = ReducedEquilibrium(*case_, mode_, std::move(*model));
  return true;
}

bool ReducedEquilibrium::Raise(double force_N) {
  if (lost_) return false;
  double increment = (force_N - force_N_) / 8;
  const double smallest = increment / 1024;
  while (force_N_ < force_N) {
    const double next = std::min(force_N, force_N_ + increment);
    VectorX x = x_;
    if (Newton(x, next)) {
      x_ = x;
      force_N_ = next;
      if (mode_ == StaticMode::kRefreshed) {
        if (!RefreshWhereDue(next)) return !(lost_ = true);
        // At the new reference the same force has its own equilibrium.
        if (x_.isZero(0) && !Newton(x_, next)) return !(lost_ = true);
        force_N_ = next;
      }
    } else {
      increment /= 2;
      if (increment < smallest) return !(lost_ = true);
    }
  }
  return true;
}

Vector3 ReducedEquilibrium::Position() { return PositionAt(x_); }

double ReducedEquilibrium::LoopGap() {
  const Mechanism& m = *model_->mechanism;
  SetState(x_);
  std::vector<RigidTransform> X_RB;
  if (mode_ == StaticMode::kTwist)
    RecoverPosesTwist(*model_, state_, X_RB);
  else if (mode_ == StaticMode::kSecondOrder)
    RecoverPosesTwistSecondOrder(*model_, state_, X_RB);
  else
    X_RB = configuration_->kinematics.X_RB;
  double gap = 0;
  for (const ClosureDef& c : m.closures()) {
    const RigidTransform E = (X_RB[c.body_a.u()] * c.X_AJ).inverse() * (X_RB[c.body_b.u()] * c.X_BJ);
    Vector3 d = E.translation();
    for (int i = 0; i < 3; ++i)
      if (!c.rigid(3 + i)) d(i) = 0;
    gap = std::max(gap, d.norm());
  }
  return gap;
}

}  // namespace fork1s::internal
