#include "closure_curvature.hpp"

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

double SecondDerivativeOf(const Mechanism::Coupling& coupling, double x) {
  const double* p = coupling.polynomial;
  return 2 * p[2] + x * (6 * p[3] + x * 12 * p[4]);
}

// ∂D/∂φ at φ along v, D = DexpInverseRotation: by central differences.
Matrix3 TurnOfInverse(const Vector3& phi, const Vector3& v) {
  constexpr double kStep = 1e-5;
  return (DexpInverseRotation(phi + kStep * v) - DexpInverseRotation(phi - kStep * v)) / (2 * kStep);
}

// With X_a and X_b the poses of the two bodies the errors are those of E = X_aJ⁻¹ X_bJ = Exp(ζ) E*, and by
// the series of Baker, Campbell and Hausdorff, in the axes of frame J of a,
//     ζ = (T_b - T_a) δ + ½ (A_b - A_a)[δ, δ] - ½ [T_a δ, T_b δ] = α δ + ½ β[δ, δ]
// Of the rotation φ = log R_E the second derivative is D β + ∂D[D α] α, D = dexp⁻¹(φ), of the position p
//     β_v + β_ω x p + α_ω x (α_v + α_ω x p), each symmetric.
MatrixX ErrorCurvature(const ClosureDef& closure, const ReducedModel& model, const Kinematics& kinematics,
                       const Expansion& expansion) {
  const Mechanism& m = *model.mechanism;
  const int r = model.size();
  const RigidTransform X_aJ = kinematics.X_RB[closure.body_a.u()] * closure.X_AJ, X_Ja = X_aJ.inverse();
  const RigidTransform X_E = X_Ja * kinematics.X_RB[closure.body_b.u()] * closure.X_BJ;
  const Matrix6X T_a = TwistsBehind(m, expansion, m.body(closure.body_a).last_joint),
                 T_b = TwistsBehind(m, expansion, m.body(closure.body_b).last_joint);
  MatrixX beta =
      OpenCurvature(model, expansion, closure.body_b) - OpenCurvature(model, expansion, closure.body_a);
  const Matrix6 to_a = Adjoint(X_Ja);
  const Matrix6X alpha = to_a * (T_b - T_a);
  const Vector3 phi = LogRotation(X_E.rotation()), p = X_E.translation();
  const Matrix3 D = DexpInverseRotation(phi);
  const bool turns = closure.rigid.head<3>().any() || !closure.stiffness.head<3>().isZero(0);
  std::vector<Matrix3> D_turned(static_cast<std::size_t>(turns ? r : 0));
  for (int i = 0; i < static_cast<int>(D_turned.size()); ++i)
    D_turned[static_cast<std::size_t>(i)] = TurnOfInverse(phi, D * alpha.col(i).head<3>());
  MatrixX out(6 * r, r);
  for (int i = 0; i < r; ++i)
    for (int k = 0; k <= i; ++k) {
      const Vector6 bend = to_a * (beta.block<6, 1>(6 * k, i) -
                                   0.5 * (Bracket(T_a.col(i), T_b.col(k)) + Bracket(T_a.col(k), T_b.col(i))));
      const Vector3 w_i = alpha.col(i).head<3>(), w_k = alpha.col(k).head<3>(), turn = bend.head<3>();
      const Vector3 u_i = alpha.col(i).tail<3>() + w_i.cross(p), u_k = alpha.col(k).tail<3>() + w_k.cross(p);
      Vector6 both;
      both << D * turn, bend.tail<3>() + turn.cross(p) + 0.5 * (w_i.cross(u_k) + w_k.cross(u_i));
      if (turns)
        both.head<3>() +=
            0.5 * (D_turned[static_cast<std::size_t>(i)] * w_k + D_turned[static_cast<std::size_t>(k)] * w_i);
      out.block<6, 1>(6 * k, i) = out.block<6, 1>(6 * i, k) = both;
    }
  return out;
}

}  // namespace

MatrixX OpenCurvature(const ReducedModel& model, const Expansion& expansion, BodyIndex body) {
  const Mechanism& m = *model.mechanism;
  const int r = model.size();
  std::vector<int> path;
  for (int j = m.body(body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) {
    const Mechanism::Joint& joint = m.joint(JointIndex(j));
    for (int l = joint.offset; l < joint.offset + joint.size; ++l) path.push_back(l);
  }
  const auto count = static_cast<Eigen::Index>(path.size());
  MatrixX C(6 * r, count), Q(count, r);
  for (Eigen::Index at = 0; at < count; ++at) {
    const int l = path[static_cast<std::size_t>(at)];
    C.col(at) = Eigen::Map<const VectorX>(&expansion.C(0, l * r), 6 * r);
    Q.row(at) = expansion.Q.row(l);
  }
  return SymmetricPart(C * Q);
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
      const MatrixX square =
          -SecondDerivativeOf(k, q(k.b)) * expansion.Q.row(k.b).transpose() * expansion.Q.row(k.b);
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
