// Springs, controls, gravity, wrenches and velocity forces of the present pose, in reduced coordinates.
#include "forces.hpp"

namespace fork1s {

void ComputeSpringsAtReference(MechanismModel& model) {
  const Mechanism& m = model.mechanism();
  Kinematics kinematics(m);
  ComputeKinematics(m, model.reduced->q_ref, kinematics);
  model.at_reference.paths = kinematics.paths;
  model.at_reference.spring_stiffness.clear();
  model.at_reference.has_bent_springs = false;
  for (const Mechanism::Spring& s : m.springs()) {
    model.at_reference.spring_stiffness.push_back(
        s.StiffnessAt(LengthOf(m, s.length, kinematics, model.reduced->q_ref)));
    model.at_reference.has_bent_springs =
        model.at_reference.has_bent_springs || s.length.path >= 0 || !s.is_linear();
  }
}

void ComputeJointForces(const StepContext& ctx, const Vector3& gravity_R) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  ws.forces.F.setZero();
  if (!gravity_R.isZero(0)) AddGravityWrenches(m, ws.configuration.kinematics, gravity_R, ws.forces.F);
  AddLoadWrenches(ctx, ws.forces.F);
  ws.forces.tau.setZero();
  if (model.base_moves()) ws.forces.base = ws.forces.F.rowwise().sum();
  AccumulateGeneralizedForce(m, ws.configuration.kinematics.S, ws.forces.F, ws.forces.tau);
  if (state.controls.size() > 0)
    AddControlForce(m, ws.configuration.kinematics, UpdateActivations(ctx), ws.forces.tau);
  SpringForce(m, ws.configuration.kinematics, ws.configuration.q, ws.forces.g);
  ws.forces.g += ws.forces.tau;
}

}  // namespace fork1s
