#include "closures.hpp"
#include "linalg/rank.hpp"
#include "linalg/solve.hpp"
#include "mechanism/coordinate_scaling.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <limits>

namespace fork1s {
namespace internal {

Vector6 ClosureError(const ClosureDef& closure, const Kinematics& kinematics, RigidTransform* X_aJ_out,
                     RigidTransform* E_out) {
  const RigidTransform X_aJ = kinematics.X_RB[closure.body_a.u()] * closure.X_AJ;
  const RigidTransform X_bJ = kinematics.X_RB[closure.body_b.u()] * closure.X_BJ;
  const RigidTransform E = X_aJ.inverse() * X_bJ;
  Vector6 c;
  c << LogRotation(E.rotation()), E.translation();
  if (X_aJ_out) *X_aJ_out = X_aJ;
  if (E_out) *E_out = E;
  return c;
}

}  // namespace internal

void ClosureResidual(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, VectorX& c) {
  c.resize(mechanism.num_constraints());
  int row = 0;
  for (const ClosureDef& closure : mechanism.closures()) {
    const Vector6 e = internal::RigidError(closure, kinematics);
    for (int i = 0; i < 6; ++i)
      if (closure.rigid(i)) c(row++) = e(i);
  }
  for (const Mechanism::Coupling& k : mechanism.couplings()) c(row++) = k.Residual(q);
}

void ClosureJacobian(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, MatrixX& A) {
  A.setZero(mechanism.num_constraints(), mechanism.num_coordinates());
  int row = 0;
  for (const ClosureDef& closure : mechanism.closures()) {
    if (!closure.rigid.any()) continue;
    internal::ForEachClosureColumn(mechanism, closure, kinematics, [&](int i, const Vector6& column) {
      int r = row;
      for (int k = 0; k < 6; ++k)
        if (closure.rigid(k)) A(r++, i) += column(k);
    });
    row += static_cast<int>(closure.rigid.count());
  }
  for (const Mechanism::Coupling& k : mechanism.couplings()) {
    k.ForEachSlope(q, [&](int i, double slope) { A(row, i) = slope; });
    ++row;
  }
}

std::vector<int> ClosureCoordinates(const Mechanism& mechanism, const ClosureDef& closure) {
  std::vector<int> coordinates;
  internal::ForEachJointBetween(mechanism, closure, [&](const Mechanism::Joint& joint, double) {
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) coordinates.push_back(i);
  });
  return coordinates;
}

// With the frames J of a and b, R_Ja the axes of the first and p the origin of the second, both seen from R, a relative
// twist [w; v] of the bodies changes the errors by
//     d log R_E = dexp⁻¹(log R_E) R_Ja w,   d p_E = R_Ja (v + w x p)
// as matrix times twist, rows picked once for all coordinates.
void ClosureRows(const Mechanism& mechanism, const ClosureDef& closure, const Kinematics& kinematics,
                 const int* components, int rows, int stride, double* values) {
  Matrix3 R_aJ, turn = Matrix3::Zero();
  Vector3 p;
  internal::PointError(closure, kinematics, &R_aJ, &p);
  if (!internal::HoldsOnlyPoint(closure))
    turn = DexpInverseRotation(internal::ClosureError(closure, kinematics).head<3>()) * R_aJ.transpose();
  Eigen::Matrix<double, 8, 6> map = Eigen::Matrix<double, 8, 6>::Zero();
  for (int r = 0; r < rows; ++r) {
    if (const int i = components[r]; i < 3) {
      map.row(r).head<3>() = turn.row(i);
    } else {
      const Vector3 axis = R_aJ.col(i - 3);
      map.row(r) << p.cross(axis).transpose(), axis.transpose();
    }
  }
  internal::ForEachJointBetween(mechanism, closure, [&](const Mechanism::Joint& joint, double sign) {
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const double* s = kinematics.S.data() + 6 * i;
      for (int four = 0; four < stride; four += 4, values += 4) {
        const double* m = map.data() + four;
        QuadAt(values) = sign * ((s[0] * QuadAt(m) + s[1] * QuadAt(m + 8) + s[2] * QuadAt(m + 16)) +
                                 (s[3] * QuadAt(m + 24) + s[4] * QuadAt(m + 32) + s[5] * QuadAt(m + 40)));
      }
    }
  });
}

double ClosureGap(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  double gap = 0;
  const double L = mechanism.length_scale();
  for (const ClosureDef& closure : mechanism.closures()) {
    const Vector6 e = internal::RigidError(closure, kinematics);
    Vector3 turn = Vector3::Zero(), shift = Vector3::Zero();
    for (int i = 0; i < 3; ++i) {
      if (closure.rigid(i)) turn(i) = e(i);
      if (closure.rigid(i + 3)) shift(i) = e(i + 3);
    }
    gap = std::max({gap, L * turn.norm(), shift.norm()});
  }
  for (const Mechanism::Coupling& k : mechanism.couplings()) {
    const double off = std::abs(k.Residual(q));
    // A slide's mismatch is a length already.
    const bool turns = mechanism.Turns(k.a);
    gap = std::max(gap, turns ? L * off : off);
  }
  return gap;
}

double CloseLoops(const Mechanism& mechanism, VectorX& q, int max_iterations) {
  if (mechanism.num_constraints() == 0) return 0;
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const CoordinateScaling unit = ComputeCoordinateScaling(mechanism, kinematics);
  // Of joints in one unit, softest 1: H^-½ of docs/method.md, section 2.
  const VectorX k = mechanism.stiffness().cwiseProduct(unit.coordinate.cwiseAbs2());
  const double least = 1e-3 * std::max(k.maxCoeff(), std::numeric_limits<double>::min());
  const VectorX yielding = (k.cwiseMax(least) / least).cwiseSqrt().cwiseInverse();
  VectorX c, row;
  double gap = 0;
  for (int i = 0; i <= max_iterations; ++i) {
    ComputeKinematics(mechanism, q, kinematics);
    gap = ClosureGap(mechanism, kinematics, q);
    if (i == max_iterations || gap < 1e-13 * mechanism.length_scale() || !std::isfinite(gap)) break;
    ClosureResidual(mechanism, kinematics, q, c);
    // The smallest step in a metric in which stiff joints give way last.
    const MatrixX A_x = ScaledClosureRows(mechanism, kinematics, q, unit, &row);
    const VectorX step_x = yielding.cwiseProduct(
        VectorX(LeastNormSolve(A_x * yielding.asDiagonal(), row.cwiseProduct(c), kRankThreshold)));
    VectorX step = unit.coordinate.cwiseProduct(step_x);
    // Far from closed, half a radian a joint keeps the linearization meaningful.
    const double largest = step.cwiseAbs().maxCoeff();
    if (largest > 0.5) step *= 0.5 / largest;
    if (largest < 1e-15) break;
    q -= step;
  }
  return gap;
}

}  // namespace fork1s
