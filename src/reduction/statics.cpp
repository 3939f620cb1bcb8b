#include <algorithm>
#include <cmath>
#include <fork1s/linalg/null_space.hpp>
#include <fork1s/linalg/products.hpp>
#include <fork1s/linalg/solve.hpp>
#include <fork1s/reduction/statics.hpp>
#include <fork1s/reduction/tangent_stiffness.hpp>

#include <fmt/format.h>

#include "elastic_basis.hpp"
#include "loaded_mechanism.hpp"
#include "locked_basis.hpp"

namespace fork1s {
namespace {

using internal::LoadedMechanism;

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
    const TangentStiffness tangent = ComputeTangentStiffness(mechanism, state.q, loads, options);
    result.stable = tangent.IsStable();
    result.lowest_stiffness = tangent.lowest();
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
