#include "closure_curvature.hpp"

#include <array>

namespace fork1s::internal {
namespace {

// Of the last two indices: half of it and half of its transpose.
MatrixX SymmetricPart(MatrixX stack) {
  const auto r = stack.cols();
  const auto at = [&](Eigen::Index k, Eigen::Index i) { return Eigen::Map<Vector6>(&stack(6 * k, i)); };
  for (Eigen::Index i = 0; i < r; ++i)
    for (Eigen::Index k = 0; k < i; ++k) {
      at(k, i) = 0.5 * (at(k, i) + at(i, k));
      at(i, k) = at(k, i);
    }
  return stack;
}

// ∂D/∂φ_c at φ, D = DexpInverseRotation: by central differences.
std::array<Matrix3, 3> SlopesOfInverse(const Vector3& phi) {
  constexpr double kStep = 1e-5;
  std::array<Matrix3, 3> out;
  for (int c = 0; c < 3; ++c) {
    const Vector3 step = kStep * Vector3::Unit(c);
    out[static_cast<std::size_t>(c)] =
        (DexpInverseRotation(phi + step) - DexpInverseRotation(phi - step)) / (2 * kStep);
  }
  return out;
}

// Coordinates that move a body, the last joint first.
std::vector<int> CoordinatesBefore(const Mechanism& m, BodyIndex body) {
  std::vector<int> out;
  for (int j = m.body(body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) {
    const Mechanism::Joint& joint = m.joint(JointIndex(j));
    for (int l = joint.offset + joint.size; l-- > joint.offset;) out.push_back(l);
  }
  return out;
}

// A_b - A_a, or A_b alone; 6r x r. What stands before both is in neither.
MatrixX CurvatureBetween(const Mechanism& m, const Expansion& expansion, BodyIndex b, BodyIndex a) {
  const auto r = expansion.z.size();
  std::vector<int> of_b = CoordinatesBefore(m, b), of_a;
  if (a.valid()) of_a = CoordinatesBefore(m, a);
  while (!of_b.empty() && !of_a.empty() && of_b.back() == of_a.back()) {
    of_b.pop_back();
    of_a.pop_back();
  }
  const auto count = static_cast<Eigen::Index>(of_b.size() + of_a.size());
  MatrixX C(6 * r, count), Q(count, r);
  Eigen::Index at = 0;
  for (const std::vector<int>* path : {&of_b, &of_a})
    for (const int l : *path) {
      C.col(at) = Eigen::Map<const VectorX>(&expansion.C(0, l * r), 6 * r);
      Q.row(at++) = (path == &of_b ? 1 : -1) * expansion.Q.row(l);
    }
  return SymmetricPart(C * Q);
}

// With X_a and X_b the poses of the two bodies the errors are those of E = X_aJ⁻¹ X_bJ = Exp(ζ) E*, and by
// the series of Baker, Campbell and Hausdorff, in the axes of frame J of a,
//     ζ = (T_b - T_a) δ + ½ (A_b - A_a)[δ, δ] - ½ [T_a δ, T_b δ] = α δ + ½ β[δ, δ]
// Of the rotation φ = log R_E the second derivative is D β + ∂D[D α] α, D = dexp⁻¹(φ), of the position p
//     β_v + β_ω x p + α_ω x (α_v + α_ω x p), each symmetric. For one coordinate i all of it is linear in the twists of
// the others.
MatrixX ErrorCurvature(const ClosureDef& closure, const ReducedModel& model, const Kinematics& kinematics,
                       const Expansion& expansion) {
  const Mechanism& m = *model.mechanism;
  const int r = model.size();
  const RigidTransform X_aJ = kinematics.X_RB[closure.body_a.u()] * closure.X_AJ, X_Ja = X_aJ.inverse();
  const RigidTransform X_E = X_Ja * kinematics.X_RB[closure.body_b.u()] * closure.X_BJ;
  const Matrix6 to_a = Adjoint(X_Ja);
  const Vector3 phi = LogRotation(X_E.rotation()), p = X_E.translation();
  const Matrix3 D = DexpInverseRotation(phi);
  const std::array<Matrix3, 3> slopes = SlopesOfInverse(phi);
  Matrix6 to_error = Matrix6::Zero();  // of twists in the axes of a, without what bends
  to_error.topLeftCorner<3, 3>() = D;
  to_error.bottomLeftCorner<3, 3>() = -Skew(p);
  to_error.bottomRightCorner<3, 3>().setIdentity();
  Matrix6X twists(6, 2 * r);  // of a, then of b
  twists << to_a * TwistsBehind(m, expansion, m.body(closure.body_a).last_joint),
      to_a * TwistsBehind(m, expansion, m.body(closure.body_b).last_joint);
  MatrixX out(6 * r, r);
  Eigen::Map<Matrix6X> by_pair(out.data(), 6, r * r);
  by_pair = (to_error * to_a) *
            Eigen::Map<const Matrix6X>(CurvatureBetween(m, expansion, closure.body_b, closure.body_a).data(),
                                       6, r * r);
  Eigen::Matrix<double, 6, 12> map;  // of `twists` of another coordinate
  for (int i = 0; i < r; ++i) {
    const Vector6 a = twists.col(i), b = twists.col(r + i), alpha = b - a;
    const Vector3 w = alpha.head<3>(), turn = D * w, velocity = alpha.tail<3>() + w.cross(p);
    Matrix3 bend = Matrix3::Zero();  // ∂D[D w] + ∂D[D ·] w
    for (int c = 0; c < 3; ++c) {
      const Matrix3& slope = slopes[static_cast<std::size_t>(c)];
      bend += turn(c) * slope + (slope * w) * D.row(c);
    }
    Matrix6 quadratic = Matrix6::Zero();
    quadratic.topLeftCorner<3, 3>() = 0.5 * bend;
    quadratic.bottomLeftCorner<3, 3>() = -0.5 * (Skew(velocity) + Skew(w) * Skew(p));
    quadratic.bottomRightCorner<3, 3>() = 0.5 * Skew(w);
    map.leftCols<6>() = 0.5 * to_error * SmallAdjoint(b) - quadratic;
    map.rightCols<6>() = -0.5 * to_error * SmallAdjoint(a) + quadratic;
    by_pair.middleCols(i * r, r).noalias() += map.leftCols<6>() * twists.leftCols(r);
    by_pair.middleCols(i * r, r).noalias() += map.rightCols<6>() * twists.rightCols(r);
  }
  return out;
}

}  // namespace

MatrixX OpenCurvature(const ReducedModel& model, const Expansion& expansion, BodyIndex body) {
  return CurvatureBetween(*model.mechanism, expansion, body, BodyIndex());
}

MatrixX ClosureCurvature(const ReducedModel& model, const Kinematics& kinematics, const VectorX& q,
                         const Expansion& expansion) {
  const Mechanism& m = *model.mechanism;
  const int r = model.size();
  MatrixX out(m.num_constraints(), r * r);
  int row = 0;
  for (const ClosureDef& closure : m.closures()) {
    if (!closure.rigid.any()) continue;
    const MatrixX curvature = ErrorCurvature(closure, model, kinematics, expansion);
    const Eigen::Map<const MatrixX> by_error(curvature.data(), 6, r * r);
    for (int i = 0; i < 6; ++i)
      if (closure.rigid(i)) out.row(row++) = by_error.row(i);
  }
  for (const Mechanism::Coupling& k : m.couplings()) {
    out.row(row).setZero();
    if (k.b >= 0) {
      const MatrixX square = k.SecondDerivative(q) * expansion.Q.row(k.b).transpose() * expansion.Q.row(k.b);
      out.row(row) = Eigen::Map<const VectorX>(square.data(), r * r).transpose();
    }
    ++row;
  }
  return out;
}

MatrixX SpringyClosureSlope(const ReducedModel& model, const Kinematics& kinematics,
                            const Expansion& expansion) {
  const int r = model.size();
  MatrixX out = MatrixX::Zero(r, r);
  for (const ClosureDef& closure : model.mechanism->closures()) {
    const Vector6 k = closure.rigid.select(Vector6::Zero(), closure.stiffness);
    if (k.isZero(0)) continue;
    const RigidTransform X_E = (kinematics.X_RB[closure.body_a.u()] * closure.X_AJ).inverse() *
                               kinematics.X_RB[closure.body_b.u()] * closure.X_BJ;
    Vector6 force;
    force << LogRotation(X_E.rotation()), X_E.translation();
    force = -k.cwiseProduct(force);
    const MatrixX curvature = ErrorCurvature(closure, model, kinematics, expansion);
    const VectorX slope = Eigen::Map<const MatrixX>(curvature.data(), 6, r * r).transpose() * force;
    out += Eigen::Map<const MatrixX>(slope.data(), r, r);
  }
  return out;
}

}  // namespace fork1s::internal
