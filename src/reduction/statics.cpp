#include <algorithm>
#include <cmath>
#include <fork1s/linalg/null_space.hpp>
#include <fork1s/linalg/products.hpp>
#include <fork1s/linalg/solve.hpp>
#include <fork1s/linalg/spectrum.hpp>
#include <fork1s/reduction/statics.hpp>
#include <limits>

#include <fmt/format.h>

#include "elastic_basis.hpp"
#include "locked_basis.hpp"

namespace fork1s {
namespace {

// Everything that acts on joint coordinates at one pose: springs, controls, and a share s of the dead loads.
class LoadedMechanism {
 public:
  LoadedMechanism(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                  const StaticsOptions& options)
      : mechanism_(mechanism),
        loads_(loads),
        options_(options),
        kinematics_(mechanism),
        F_(6, mechanism.num_bodies()) {
    Pose(q0);
    unit_ = ComputeOneUnit(mechanism, kinematics_);
    const SpringRows springs = SpringRowsInOneUnit(mechanism, kinematics_, q0, unit_);
    double far = 0;
    for (const RigidTransform& X : kinematics_.X_RB) far = std::max(far, X.translation().norm());
    const double stiffest = springs.weight.size() > 0 ? springs.weight.cwiseAbs2().maxCoeff() : 0;
    rounding_ = 8 * std::numeric_limits<double>::epsilon() * (1 + far / mechanism.length_scale()) * stiffest;
  }

  void Pose(const VectorX& q) { ComputeKinematics(mechanism_, q, kinematics_); }
  const Kinematics& kinematics() const { return kinematics_; }

  // Loads alone, at the present pose.
  VectorX LoadForce(double share) {
    F_.setZero();
    AddGravityWrenches(mechanism_, kinematics_, share * options_.gravity_R, F_);
    for (const DeadLoad& load : loads_) {
      const Vector3 f = share * load.force_R;
      F_.col(load.body.value()).head<3>() +=
          share * load.moment_R + kinematics_.X_RB[load.body.u()].translation().cross(f);
      F_.col(load.body.value()).tail<3>() += f;
    }
    VectorX tau = VectorX::Zero(mechanism_.num_coordinates());
    AccumulateGeneralizedForce(mechanism_, kinematics_.S, F_, tau);
    return tau;
  }

  // Poses the mechanism at q; returns the unbalanced force with loop reactions λ.
  VectorX Residual(const VectorX& q, const VectorX& lambda, double share) {
    Pose(q);
    VectorX g;
    SpringForce(mechanism_, kinematics_, q, g);
    if (options_.controls.size() > 0) AddControlForce(mechanism_, kinematics_, options_.controls, g);
    g += LoadForce(share);
    if (lambda.size() > 0) {
      ClosureJacobian(mechanism_, kinematics_, q, A_);
      g += TransposedTimes(A_, lambda);
    }
    for (const int i : options_.locked) g(i) = 0;  // balanced by the lock
    return g;
  }

  // Size of the forces that have to balance, in one unit.
  double Scale(const VectorX& q, double share) {
    Pose(q);
    VectorX g;
    SpringForce(mechanism_, kinematics_, q, g);
    const VectorX& x = unit_.coordinate;
    return std::max(
        {x.cwiseProduct(g).cwiseAbs().maxCoeff(), x.cwiseProduct(LoadForce(share)).cwiseAbs().maxCoeff(), 1e-300});
  }
  double Size(const VectorX& g) const { return unit_.coordinate.cwiseProduct(g).cwiseAbs().maxCoeff(); }
  // What the stiffest spring makes of the rounding of positions, in one unit: forces no smaller than this can
  // balance.
  double rounding() const { return rounding_; }

  // ∂g/∂q by central differences: covers loads that turn their lever arms, loop reactions and ball joints
  // alike.
  MatrixX Tangent(const VectorX& q, const VectorX& lambda, double share) {
    const auto n = q.size();
    MatrixX K(n, n);
    VectorX x = q;
    constexpr double kStep = 1e-5;
    for (Eigen::Index i = 0; i < n; ++i) {
      x(i) = q(i) + kStep;
      const VectorX above = Residual(x, lambda, share);
      x(i) = q(i) - kStep;
      K.col(i) = (above - Residual(x, lambda, share)) / (2 * kStep);
      x(i) = q(i);
    }
    for (const int i : options_.locked) {
      K.row(i).setZero();
      K.col(i).setZero();
      K(i, i) = -1;  // beside a residual of 0: it does not move
    }
    return K;
  }

 private:
  const Mechanism& mechanism_;
  const std::vector<DeadLoad>& loads_;
  const StaticsOptions& options_;
  Kinematics kinematics_;
  OneUnit unit_;
  double rounding_ = 0;
  Matrix6X F_;
  MatrixX A_;
};

struct NewtonState {
  VectorX q, lambda;
};

// A step of Newton's method [dq; dλ] that closes the loops, A dq = -c, and balances g + K dq + Aᵀdλ = 0. Loops
// first, by their rank in one unit; then the motions that they leave, and the reactions of least norm: loops
// closed more often than needed share them.
VectorX ClosedStep(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                   const MatrixX& K, const VectorX& g, const VectorX& c, const std::vector<int>& locked) {
  const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
  VectorX row;
  MatrixX A = ClosureRowsInOneUnit(mechanism, kinematics, q, unit, &row);
  for (const int i : locked) A.col(i).setZero();
  const MatrixX K_x = ScaledColumns(ScaledRows(unit.coordinate, K), unit.coordinate);
  const VectorX g_x = unit.coordinate.cwiseProduct(g), c_x = row.cwiseProduct(c);
  const NullSpace closed = ComputeNullSpace(A);
  const MatrixX& unseen = closed.unseen;
  const MatrixX A_seen = Times(A, closed.seen);
  VectorX x = -Times(closed.seen, LeastNormSolve(A_seen, c_x, kRankThreshold));
  const MatrixX K_z = Congruence(K_x, unseen);
  // What neither springs nor loads hold stays where it is: differences give its stiffness as rounding.
  constexpr double kHeld = 1e-12;
  x -= Times(unseen, LeastNormSolve(K_z, TransposedTimes(unseen, g_x + Times(K_x, x)), kHeld));
  const VectorX lambda =
      -LeastNormSolve(A_seen.transpose(), TransposedTimes(closed.seen, g_x + Times(K_x, x)), kRankThreshold);
  VectorX step(x.size() + lambda.size());
  step << unit.coordinate.cwiseProduct(x), row.cwiseProduct(lambda);
  return step;
}

// Newton at one load; false leaves the state where it was.
bool Equilibrate(const Mechanism& mechanism, LoadedMechanism& loaded, const StaticsOptions& options,
                 double share, NewtonState& state, StaticsResult& result) {
  const Eigen::Index n = state.q.size(), m = mechanism.num_constraints();
  NewtonState now = state;
  VectorX c = VectorX::Zero(m);
  for (int i = 0; i < options.max_iterations; ++i) {
    ++result.iterations;
    VectorX rhs(n + m);
    rhs.head(n) = loaded.Residual(now.q, now.lambda, share);
    if (m > 0) ClosureResidual(mechanism, loaded.kinematics(), now.q, c);
    rhs.tail(m) = -c;
    const double scale = loaded.Scale(now.q, share);
    const double error = n > 0 ? loaded.Size(rhs.head(n)) / scale : 0;
    if (!std::isfinite(error)) return false;
    result.residual = error;
    if ((error < options.tolerance || error * scale < loaded.rounding()) && (m == 0 || c.cwiseAbs().maxCoeff() < 1e-12)) {
      state = now;
      return true;
    }
    const MatrixX K = loaded.Tangent(now.q, now.lambda, share);
    loaded.Pose(now.q);  // differences left it beside
    const VectorX step =
        m == 0 ? VectorX(SolveSquare(-K, rhs))
               : ClosedStep(mechanism, loaded.kinematics(), now.q, K, rhs.head(n), c, options.locked);
    if (!step.allFinite()) return false;
    const double largest = step.head(n).cwiseAbs().maxCoeff();
    const double damping = largest > 0.4 ? 0.4 / largest : 1.0;
    now.q += damping * step.head(n);
    now.lambda += damping * step.tail(m);
    // The residual is as small as the differences of the tangent resolve.
    if (largest < 1e-13) {
      result.residual = error;
      if (error < 1e-8) {
        state = now;
        return true;
      }
    }
  }
  return false;
}

}  // namespace

StaticsResult SolveStatics(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                           const StaticsOptions& options) {
  LoadedMechanism loaded(mechanism, q0, loads, options);
  StaticsResult result;
  NewtonState state{q0, VectorX::Zero(mechanism.num_constraints())};
  double share = 0, increment = 1.0 / options.load_steps;
  bool ok = Equilibrate(mechanism, loaded, options, 0, state, result);
  while (ok && share < 1) {
    const double next = std::min(1.0, share + increment);
    if (Equilibrate(mechanism, loaded, options, next, state, result)) {
      share = next;
    } else {
      increment *= 0.5;
      if (increment < 1e-4) ok = false;
    }
  }
  result.q = state.q;
  result.converged = ok;
  if (ok) {
    // Stable if the tangent is positive on motions that keep the loops closed.
    const MatrixX K = -loaded.Tangent(state.q, state.lambda, 1);
    MatrixX Z = MatrixX::Identity(state.q.size(), state.q.size());
    if (mechanism.num_constraints() > 0) {
      loaded.Residual(state.q, state.lambda, 1);
      Z = internal::WithLocked(internal::ClosedMotions(mechanism, loaded.kinematics(), state.q),
                               VectorX::Ones(state.q.size()), options.locked);
    }
    const MatrixX K_z = Congruence(K, Z);
    const VectorX eigenvalues = EigenvaluesOf(0.5 * (K_z + K_z.transpose()));
    result.stable = eigenvalues.size() == 0 || eigenvalues(0) > -1e-9 * eigenvalues.cwiseAbs().maxCoeff();
  }
  return result;
}

Expected<VectorX> LinearDeflection(const Mechanism& mechanism, const VectorX& q0,
                                   const std::vector<DeadLoad>& loads, const StaticsOptions& options) {
  LoadedMechanism loaded(mechanism, q0, loads, options);
  loaded.Pose(q0);
  const auto basis = internal::ComputeElasticBasis(mechanism, loaded.kinematics(), q0);
  const VectorX g = loaded.Residual(q0, VectorX(), 1);
  const int n = mechanism.num_coordinates();
  const internal::LockedBasis motions = internal::LockCoordinates(basis, n, options.locked);
  const MatrixX& N = motions.free;
  if (N.cols() > 0) {
    const VectorX taken = TransposedTimes(N, g);
    if (taken.cwiseAbs().maxCoeff() > 1e-9 * std::max(1e-300, g.cwiseAbs().maxCoeff())) {
      Eigen::Index direction, coordinate;
      taken.cwiseAbs().maxCoeff(&direction);
      N.col(direction).cwiseAbs().maxCoeff(&coordinate);
      return Fail(
          ErrorCode::kUnderdetermined,
          fmt::format("joint '{}'",
                      mechanism.joint(mechanism.CoordinateJoint(static_cast<int>(coordinate))).name),
          "has no spring and gives way to the load, so that no deflection balances it; give the joint a "
          "stiffness, hold it by PD control, or lock it (--lock-free)");
    }
  }
  if (options.locked.empty()) return VectorX(q0 + basis.ApplyV(basis.ApplyVTransposed(g), n));
  return VectorX(q0 + Times(motions.elastic, TransposedTimes(motions.elastic, g)));
}

double MaxJointRotation(const Mechanism& mechanism, const VectorX& q0, const VectorX& q) {
  double largest = 0;
  for (const Mechanism::Joint& j : mechanism.joints()) {
    if (j.kind == JointKind::kHinge) largest = std::max(largest, std::abs(q(j.offset) - q0(j.offset)));
    if (j.kind == JointKind::kBall) {
      const Matrix3 before = ExpRotation(q0.segment<3>(j.offset)),
                    after = ExpRotation(q.segment<3>(j.offset));
      largest = std::max(largest, LogRotation(before.transpose() * after).norm());
    }
  }
  return largest;
}

}  // namespace fork1s
