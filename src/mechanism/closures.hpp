// Errors of one closure and their derivatives, shared by the rigid rows and the springy ones.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s::internal {

/// c = [log R_E; p_E] with E = X_aJ⁻¹ X_bJ.
Vector6 ClosureError(const ClosureDef& closure, const Kinematics& kinematics, RigidTransform* X_aJ = nullptr,
                     RigidTransform* E = nullptr);

/// Calls sink(i, ∂c/∂q_i) for every coordinate i on the path of either body, once per path: the columns of
/// body b as they are, those of body a negated. Returns c. Does not allocate.
template <class Sink>
Vector6 ForEachClosureColumn(const Mechanism& mechanism, const ClosureDef& closure,
                             const Kinematics& kinematics, Sink sink) {
  RigidTransform X_aJ, E;
  const Vector6 c = ClosureError(closure, kinematics, &X_aJ, &E);
  // Ė E⁻¹ = Ad(X_aJ⁻¹)(V_b - V_a) = [ω; v];  d log R_E = dexp⁻¹ ω,  d p_E = v + ω x p_E
  const RigidTransform X_Ja = X_aJ.inverse();
  const Matrix3 D = DexpInverseRotation(c.head<3>());
  auto walk = [&](BodyIndex body, double sign) {
    for (int j = mechanism.body(body).last_joint; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
      const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
      for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
        const Vector6 V = AdjointApply(X_Ja, kinematics.S.col(i));
        const Vector3 w = V.head<3>();
        Vector6 column;
        column << sign * (D * w), sign * (V.tail<3>() + w.cross(E.translation()));
        sink(i, column);
      }
    }
  };
  walk(closure.body_b, 1);
  walk(closure.body_a, -1);
  return c;
}

}  // namespace fork1s::internal
