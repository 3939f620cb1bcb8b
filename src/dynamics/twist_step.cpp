// The implicit step by twists: everything is that of the reference, and z moves as a linear system does.
//
//     A x⁺ = M x + h f + Jᵀλ,   A = M + h D + h² K,   z⁺ = z + h w⁺
// A floating base carries its momentum along by the midpoint rule, and a driven one pushes by its inertia.
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// Base momentum p [6] in R is carried along by the midpoint rule, Ad(Exp(h (V + V⁺)/2))ᵀ p. V⁺ = solve(that)
// enters it and is found by a short iteration from V.
template <typename Solve>
void TransportMomentum(double h, const Vector6& p, const Vector6& V, const Solve& solve) {
  Vector6 V_next = V;
  // Every round gains about h |V|: two or three digits at walking speed, less in a fast spin.
  constexpr int kRounds = 24;
  for (int i = 0; i < kRounds; ++i) {
    const Vector6 next = solve(AdjointTransposeApply(Exp(0.5 * h * (V + V_next)), p));
    const double change = (next - V_next).cwiseAbs().maxCoeff();
    V_next = next;
    if (change < 1e-12 * (1 + V_next.cwiseAbs().maxCoeff())) break;
  }
}

}  // namespace

// A of the reference, once for all steps of a length between refreshes, but for servos at their bounds.
void Factor(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  ws.factored_h = h;
  if (model.num_velocities() == 0)
    return;  // a driven body without joints: Eigen's products may not be asked for nothing
  ws.A = ws.M_full;
  ws.A.bottomRightCorner(model.size(), model.size()) += h * model.reduced->D;
  ws.A.diagonal().tail(model.size()) += h * h * model.reduced->K_r;
  SubtractSaturatedStiffness(here, h);
  ws.factor.Compute(ws.A);
}

void PredictTwist(const MechanismStep& here, double h, const Vector3& gravity_W) {
  const auto& [model, state, ws] = here;
  ws.V_R_before = state.reduced.V_R;
  ws.gravity_W = gravity_W;
  Vector6 A_R = Vector6::Zero();
  ws.V_free = state.reduced.V_R;
  if (model.mechanism().base() == BaseKind::kDriven) {
    // Twist that takes the base to its next pose; its change pushes the interior by inertia.
    ws.V_free = DrivenTwist(state, h);
    A_R = (ws.V_free - state.reduced.V_R) / h;
  }
  if (model.base_size > 0) {
    // The step is taken in a frame that keeps up with the centre of mass. Left in, its velocity v enters as
    // forces m ω × v on bodies and base that cancel only at the end of an implicit step, and feed rotation
    // once h v nears the size of the mechanism.
    ws.momentum.noalias() = ws.M_full * ws.x;
    ws.drift_R = ws.momentum.segment<3>(3) / ws.M_00(5, 5);
    state.reduced.V_R.tail<3>() -= ws.drift_R;
    ws.V_free = state.reduced.V_R;
  }
  LoadForcesTwist(here, state.reduced.X_WR.rotation().transpose() * gravity_W, A_R);
  if (model.base_size > 0) ws.momentum.noalias() -= ws.M_full.middleCols<3>(3) * ws.drift_R;
  if (HasSwitches(here)) OpenSwitches(here);
  SolveFree(here, h);
  ForgetInputs(here);
}

void SolveFreeTwist(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  ws.impulse.setZero(model.num_velocities());
  if (h != ws.factored_h) Factor(here, h);
  if (HasSwitches(here)) AddSwitchedForces(here);
  const int r = model.size();
  if (model.base_size == 0) {
    state.reduced.V_R = ws.V_free;
    if (r > 0) {  // Eigen's products may not be asked for nothing
      ws.x.noalias() = ws.M_full * state.reduced.w;
      ws.x += h * ws.f_z;
      ws.factor.SolveInPlace(ws.x);
    }
    return;
  }
  TransportMomentum(h, ws.momentum.head<6>(), ws.V_free, [&](const Vector6& moved) {
    ws.x.head<6>() = moved + h * ws.base_force;
    ws.x.tail(r) = ws.momentum.tail(r) + h * ws.f_z;
    ws.factor.SolveInPlace(ws.x);
    return Vector6(ws.x.head<6>());
  });
  ws.x.segment<3>(3) += ws.drift_R;
  state.reduced.V_R = ws.V_R_before;
}

void IntegrateTwist(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  state.past.h = 0;
  state.reduced.w = ws.x.tail(model.size());
  state.reduced.z += h * state.reduced.w;
  if (model.mechanism().base() == BaseKind::kDriven) state.reduced.X_WR = state.driven_next;
  if (model.base_size == 0) {
    UpdateConfiguration(here);
    return;
  }
  // As in Predict, beside the drift of the centre of mass, which only moves the base along. Contact asks that
  // gaps stay closed at the end velocity, so what was pushed turns and drifts by that one; the mean would let
  // a foot that lands sink by half of what it fell in the step.
  Vector6 V_start = ws.V_R_before;
  V_start.tail<3>() -= ws.drift_R;
  Vector3 drift_R = ws.drift_R;
  if (ws.pushed) {
    ws.momentum.noalias() = ws.M_full * ws.x;
    drift_R = ws.momentum.segment<3>(3) / ws.M_00(5, 5);
  }
  ws.x.segment<3>(3) -= drift_R;
  const Vector3 drift_W = state.reduced.X_WR.rotation() * drift_R;
  const Vector6 mean = ws.pushed ? Vector6(ws.x.head<6>()) : Vector6(0.5 * (V_start + ws.x.head<6>()));
  state.reduced.X_WR = state.reduced.X_WR * Exp(h * mean);
  state.reduced.X_WR.translation() += h * drift_W;
  state.reduced.X_WR.Orthonormalize();
  UpdateConfiguration(here);
  ws.x.segment<3>(3).noalias() += state.reduced.X_WR.rotation().transpose() * drift_W;
  state.reduced.V_R = ws.x.head<6>();
}

}  // namespace fork1s
