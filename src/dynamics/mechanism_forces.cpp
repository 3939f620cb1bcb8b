// Springs, controls, gravity, wrenches and velocity forces of the present pose, in reduced coordinates.
#include "mechanism_detail.hpp"

namespace fork1s {

void TakeReferenceForces(MechanismModel& model) {
  const Mechanism& m = model.mechanism();
  Kinematics kinematics(m);
  ComputeKinematics(m, model.reduced->q_ref, kinematics);
  model.paths_ref = kinematics.paths;
  model.spring_stiffness_ref.clear();
  model.has_bent_springs = false;
  for (const Mechanism::Spring& s : m.springs()) {
    model.spring_stiffness_ref.push_back(
        s.StiffnessAt(LengthOf(m, s.length, kinematics, model.reduced->q_ref)));
    model.has_bent_springs = model.has_bent_springs || s.length.path >= 0 || !s.is_linear();
  }
  FindFollowers(model);
  model.stiffness_ref.resize(0, 0);
  if (model.reduced->has_complement && !m.has_diagonal_stiffness())
    model.stiffness_ref = StiffnessMatrix(m, kinematics, model.reduced->q_ref);
  if (!model.by_twists()) return;
  VectorX g_ref(model.reduced->num_coordinates());  // spring forces at the reference
  SpringForce(m, kinematics, model.reduced->q_ref, g_ref);
  model.springs_ref = SpringEnergy(m, kinematics, model.reduced->q_ref);
  const int r = model.size();
  Matrix6X F(6, m.num_bodies());
  VectorX tau(model.reduced->num_coordinates());
  model.f_ref = model.reduced->Q.transpose() * g_ref;
  model.gravity_map.resize(r, 3);
  model.base_gravity_map.resize(6, 3);
  for (int axis = 0; axis < 3; ++axis) {
    F.setZero();
    tau.setZero();
    AddGravityWrenches(m, kinematics, Vector3::Unit(axis), F);
    AccumulateGeneralizedForce(m, kinematics.S, F, tau);
    model.gravity_map.col(axis) = model.reduced->Q.transpose() * tau;
    model.base_gravity_map.col(axis) = F.col(0);
  }
  const auto controls = m.controls().size();
  if (model.base_moves()) {
    // ξ x* (I ξ) is quadratic in ξ: its symmetric coefficients by polarisation.
    auto force = [&](const Vector6& V) {
      F.setZero();
      tau.setZero();
      SubtractRigidMotionWrenches(m, kinematics, V, Vector6::Zero(), F);
      AccumulateGeneralizedForce(m, kinematics.S, F, tau);
      return VectorX(model.reduced->Q.transpose() * tau);
    };
    model.rigid_motion_map.resize(r, 36);
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        model.rigid_motion_map.col(6 * i + j) = 0.5 * (force(Vector6::Unit(i) + Vector6::Unit(j)) -
                                                       force(Vector6::Unit(i)) - force(Vector6::Unit(j)));
  }
  model.control_map.resize(r, static_cast<Eigen::Index>(controls));
  for (std::size_t i = 0; i < controls; ++i) {
    tau.setZero();
    AddControlForce(m, kinematics,
                    VectorX::Unit(static_cast<Eigen::Index>(controls), static_cast<Eigen::Index>(i)), tau);
    model.control_map.col(static_cast<Eigen::Index>(i)) = model.reduced->Q.transpose() * tau;
  }
}

// The same by twists, all of the reference.
void LoadForcesTwist(const MechanismStep& here, const Vector3& gravity_R, const Vector6& A_R) {
  const auto& [model, state, ws] = here;
  ws.f_z = model.f_ref;
  ws.f_z -= model.reduced->K_r.cwiseProduct(state.reduced.z);
  ws.f_z.noalias() += model.gravity_map * gravity_R;
  if (state.controls.size() > 0) ws.f_z.noalias() += model.control_map * state.controls;
  ws.base_force.noalias() = model.base_gravity_map * gravity_R;
  if (model.base_moves()) {
    ws.f_z.noalias() -= model.reduced->M_0z.transpose() * A_R;
    const Matrix6 VV = state.reduced.V_R * state.reduced.V_R.transpose();
    ws.f_z.noalias() += model.rigid_motion_map * Eigen::Map<const Eigen::Matrix<double, 36, 1>>(VV.data());
  }
  if (!state.has_loads) return;
  ws.F.setZero();
  AddLoadWrenches(here, ws.F);
  for (int b = 0; b < model.mechanism().num_bodies(); ++b) {
    ws.f_z.noalias() += model.reduced->T_of(BodyIndex(b)).transpose() * ws.F.col(b);
    ws.base_force += ws.F.col(b);
  }
}

// g, all joint forces of the present pose, and base_force. Velocity forces are none of them: they come of the
// momentum that is carried along.
void LoadForces(const MechanismStep& here, const Vector3& gravity_R) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  ws.F.setZero();
  if (!gravity_R.isZero(0)) AddGravityWrenches(m, ws.configuration.kinematics, gravity_R, ws.F);
  AddLoadWrenches(here, ws.F);
  ws.tau.setZero();
  if (model.base_moves()) ws.base_force = ws.F.rowwise().sum();
  AccumulateGeneralizedForce(m, ws.configuration.kinematics.S, ws.F, ws.tau);
  if (state.controls.size() > 0) AddControlForce(m, ws.configuration.kinematics, state.controls, ws.tau);
  SpringForce(m, ws.configuration.kinematics, ws.configuration.q, ws.g);
  ws.g += ws.tau;
}

}  // namespace fork1s
