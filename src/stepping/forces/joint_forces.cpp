// Springs, controls, gravity, wrenches and velocity forces of the present pose, in reduced coordinates.
#include "forces.hpp"

namespace fork1s {

void ComputeSpringsAtReference(MechanismModel& model) {
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
}

void LoadForces(const MechanismStep& here, const Vector3& gravity_R) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  ws.forces.F.setZero();
  if (!gravity_R.isZero(0)) AddGravityWrenches(m, ws.configuration.kinematics, gravity_R, ws.forces.F);
  AddLoadWrenches(here, ws.forces.F);
  ws.forces.tau.setZero();
  if (model.base_moves()) ws.forces.base = ws.forces.F.rowwise().sum();
  AccumulateGeneralizedForce(m, ws.configuration.kinematics.S, ws.forces.F, ws.forces.tau);
  if (state.controls.size() > 0)
    AddControlForce(m, ws.configuration.kinematics, state.controls, ws.forces.tau);
  SpringForce(m, ws.configuration.kinematics, ws.configuration.q, ws.forces.g);
  ws.forces.g += ws.forces.tau;
}

}  // namespace fork1s
