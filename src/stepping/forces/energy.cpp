// Energy.
#include <cmath>

#include "base/dot_by_fours.hpp"
#include "forces.hpp"
#include "linalg/cholesky.hpp"

namespace fork1s {

double KineticEnergy(const ConstStepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  double energy = 0;
  // By columns, so that no product has to be kept; parts share no inertia.
  for (const VelocityRange& part : model.parts)
    for (int i = part.begin; i < part.begin + part.size; ++i)
      energy += 0.5 * ws.x[i] * DotByFours(&ws.mass.M(part.begin, i), ws.x.data() + part.begin, part.size);
  if (model.mechanism().base() == BaseKind::kDriven)
    energy += state.reduced.V_R.dot(ws.mass.M_0z * ws.x) +
              0.5 * state.reduced.V_R.dot(ws.mass.M_00 * state.reduced.V_R);
  return energy;
}

double PotentialEnergy(const ConstStepContext& ctx, const Vector3& gravity_W) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  const Configuration& c = ConfigurationOf(ctx);
  Vector3 moment = Vector3::Zero();  // Σ mass × centre in R [kg·m]
  for (int b = 0; b < m.num_bodies(); ++b) {
    const Mechanism::Body& body = m.bodies()[static_cast<std::size_t>(b)];
    if (body.weighed_mass > 0)
      moment += body.weighed_mass * (c.kinematics.X_RB[std::size_t(b)] * body.inertia_B.center);
  }
  const RigidTransform& X_WR = state.reduced.X_WR;
  double energy = SpringEnergy(m, c.kinematics, c.q) - EnergyBeyondBounds(ctx, c) -
                  gravity_W.dot(m.weighed_mass() * X_WR.translation() + X_WR.rotation() * moment);
  for (std::size_t i = 0; i < m.controls().size(); ++i) {
    const auto& control = m.controls()[i];
    if (!m.HasPotential(control.length)) continue;
    const double u = ActivationOf(state, static_cast<Eigen::Index>(i));
    energy += m.definition().controls[i].SetPointEnergy(u) -
              control.gain * u * LengthOf(m, control.length, c.kinematics, c.q);
  }
  return energy;
}

}  // namespace fork1s
