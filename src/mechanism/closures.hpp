// Errors of one closure and their derivatives, shared by the rigid rows and the springy ones.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s::internal {

/// c = [log R_E; p_E] with E = X_aJ⁻¹ X_bJ.
Vector6 ClosureError(const ClosureDef& closure, const Kinematics& kinematics, RigidTransform* X_aJ = nullptr,
                     RigidTransform* E = nullptr);

/// Calls visit(joint, sign) for every joint between the bodies of a closure: 1 on the way up from body b,
/// then -1 from body a. Joints that carry both move its two frames alike.
template <class Visit>
void ForEachJointBetween(const Mechanism& mechanism, const ClosureDef& closure, Visit visit) {
  const auto above = [&](int j) { return mechanism.joint(JointIndex(j)).previous; };
  const int last_a = mechanism.body(closure.body_a).last_joint,
            last_b = mechanism.body(closure.body_b).last_joint;
  int a = last_a, b = last_b;  // joints come after those that carry them
  while (a != b) (a > b ? a : b) = above(a > b ? a : b);
  const int common = a;
  for (int j = last_b; j != common; j = above(j)) visit(mechanism.joint(JointIndex(j)), 1.0);
  for (int j = last_a; j != common; j = above(j)) visit(mechanism.joint(JointIndex(j)), -1.0);
}

/// Calls sink(i, ∂c/∂q_i) for every coordinate i between the bodies of a closure, once each, in the order of
/// ClosureCoordinates. Returns c. Does not allocate.
template <class Sink>
Vector6 ForEachClosureColumn(const Mechanism& mechanism, const ClosureDef& closure,
                             const Kinematics& kinematics, Sink sink) {
  RigidTransform X_aJ, E;
  const Vector6 c = ClosureError(closure, kinematics, &X_aJ, &E);
  // Ė E⁻¹ = Ad(X_aJ⁻¹)(V_b - V_a) = [ω; v];  d log R_E = dexp⁻¹ ω,  d p_E = v + ω x p_E
  const RigidTransform X_Ja = X_aJ.inverse();
  const Matrix3 D = DexpInverseRotation(c.head<3>());
  ForEachJointBetween(mechanism, closure, [&](const Mechanism::Joint& joint, double sign) {
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const Vector6 V = AdjointApply(X_Ja, kinematics.S.col(i));
      const Vector3 w = V.head<3>();
      Vector6 column;
      column << sign * (D * w), sign * (V.tail<3>() + w.cross(E.translation()));
      sink(i, column);
    }
  });
  return c;
}

/// Whether a closure asks nothing of how its two frames are turned. Of its errors only p_E counts then, which
/// needs no logarithm.
inline bool HoldsOnlyPoint(const ClosureDef& closure) { return !closure.rigid.head<3>().any(); }

/// p_E = R_aJᵀ (p_bJ - p_aJ), the second half of ClosureError; p_bJ in R where asked for.
inline Vector3 PointError(const ClosureDef& closure, const Kinematics& kinematics,
                          Matrix3* R_aJ_out = nullptr, Vector3* p_b_out = nullptr) {
  const RigidTransform& X_a = kinematics.X_RB[closure.body_a.u()];
  const Matrix3 R_aJ = X_a.rotation() * closure.X_AJ.rotation();
  const Vector3 p_b = kinematics.X_RB[closure.body_b.u()] * closure.X_BJ.translation();
  if (R_aJ_out) *R_aJ_out = R_aJ;
  if (p_b_out) *p_b_out = p_b;
  return R_aJ.transpose() * (p_b - X_a * closure.X_AJ.translation());
}

/// ClosureError as far as rigid directions need it.
inline Vector6 RigidError(const ClosureDef& closure, const Kinematics& kinematics) {
  if (!HoldsOnlyPoint(closure)) return ClosureError(closure, kinematics);
  Vector6 c;
  c << Vector3::Zero(), PointError(closure, kinematics);
  return c;
}

}  // namespace fork1s::internal
