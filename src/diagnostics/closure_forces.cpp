#include "closure_forces.hpp"

#include <algorithm>
#include <limits>

#include "linalg/products.hpp"
#include "linalg/solve.hpp"
#include "stepping/mechanism_detail.hpp"

namespace fork1s {

namespace {

// H⁻¹ = 1 / max(k, 1e-3 k_max), slides measured in lengths of the mechanism: how far each joint gives way.
VectorX Compliances(const Mechanism& m, const Kinematics& kinematics, const VectorX& q) {
  VectorX scale(m.num_coordinates());
  for (int i = 0; i < scale.size(); ++i) scale(i) = m.Turns(i) ? 1.0 : m.length_scale();
  const VectorX k =
      m.has_diagonal_stiffness() ? m.stiffness() : VectorX(StiffnessMatrix(m, kinematics, q).diagonal());
  const VectorX scaled = k.cwiseProduct(scale.cwiseAbs2());
  const double least = std::max(1e-3 * scaled.maxCoeff(), std::numeric_limits<double>::min());
  return scale.cwiseAbs2().cwiseQuotient(scaled.cwiseMax(least));
}

}  // namespace

// After a step, with all forces g of the present pose, M q̈ and velocity forces among them, g = Aᵀλ. Modes
// that were left out do not move, so that g is out of balance by their inertia; H spreads that as the
// interior's springs would. Closures that depend on each other, or nearly so, leave λ open: of all λ the one
// nearest to `near`,
//     λ = near + (H^-½ Aᵀ)⁺ H^-½ (g - Aᵀ near).
VectorX ClosureForces(const ConstStepContext& here, double h, const Matrix6X& contacts_R,
                      const VectorX& near) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  FORK1S_REQUIRE(near.size() == m.num_constraints(), near.size(), m.num_constraints());
  if (model.reduced->loop_rank() == 0) return VectorX::Zero(m.num_constraints());
  const Configuration& now = ConfigurationOf(here);
  const Kinematics& kinematics = now.kinematics;
  const int n = m.num_coordinates();

  const VectorX q_dot = now.Q_now * state.reduced.w;
  // q_dot is that of the start of the step until the next one begins.
  const VectorX q_ddot = (q_dot - ws.start.q_dot) / h;
  const Vector6 A_R =
      model.base_moves() ? Vector6((state.reduced.V_R - ws.start.V_R) / h) : Vector6(Vector6::Zero());

  Matrix6X F = contacts_R;
  AddGravityWrenches(m, kinematics, state.reduced.X_WR.rotation().transpose() * ws.forces.gravity_W, F);
  Matrix6X V(6, m.num_bodies()), A(6, m.num_bodies());
  SubtractVelocityWrenches(m, kinematics, now.q, state.reduced.V_R, q_dot, VectorX::Zero(n), V, A, F);
  SubtractRigidMotionWrenches(m, kinematics, Vector6::Zero(), A_R, F);
  VectorX g(n), loads = VectorX::Zero(n), inertial;
  AccumulateGeneralizedForce(m, kinematics.S, F, loads);
  if (state.controls.size() > 0) {
    const VectorX activations = ActivationsOf(state);
    AddControlForce(m, kinematics, activations, loads);
    AddMuscleRateForce(m, kinematics, activations, q_dot, loads);
  }
  SpringForce(m, kinematics, now.q, g);
  ApplyMass(m, kinematics, q_ddot, inertial);
  // Of the armature ApplyMass has all but what E changes by.
  SubtractArmatureForces(m, kinematics, now.q, q_dot, VectorX::Zero(n), loads);
  g += loads - inertial - DampingMatrix(m, kinematics, now.q) * q_dot;

  const VectorX root = Compliances(m, kinematics, now.q).cwiseSqrt();
  MatrixX rows;
  ClosureJacobian(m, kinematics, now.q, rows);
  const MatrixX A_T = rows.transpose();
  // Below a hundredth of the largest singular value the joints can hardly yield: a finger stretched against
  // another one bears 100 N for a thousandth of a millimetre, which contacts that are not frozen lose by
  // creep.
  constexpr double kYielding = 0.01;
  return near + LeastNormSolve(ScaledRows(root, A_T), root.cwiseProduct(g - A_T * near), kYielding);
}

}  // namespace fork1s
