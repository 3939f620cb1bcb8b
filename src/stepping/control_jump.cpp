// Controls that jump between steps and are held within them.
//
// What a mode does by a jump within a two-stage step is known before: with b = γ h, A = M + b D + b² K and δ
// the answer of A to the force of the control, ρ = b² δᵀK δ / δᵀA δ is the share of its static answer that
// the first stage goes and μ = δᵀM δ / δᵀA δ. Where a control stands at its old value and c of the jump in
// the first stage, and at the new value in the second, the step ends at
//     ρ (1 + s c (1 + μ - ρ)),   s = (1 - γ)/γ
// of the static answer. By c = 1 a stiff mode (ρ > 0.41 where damping rules) goes beyond it, by 38 % of the
// jump at a damping ratio of 0.4: R(z) of the scheme is negative there. The c that ends the step at the
// static answer leaves a damped mode within 3 % of the jump of its true motion's largest
// (tests/stepping/control_jump_test.cpp); where it is 1 or more, the step follows the jump and nothing is
// changed. An activation that goes most of its way within the first stage is such a jump. It goes γ there at
// least: that is the share of one that moves evenly, which the scheme follows in second order.
#include <algorithm>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// c of a control whose force is along ws.scratch.jump.force [r].
double ShareInFirstStage(const StepContext& ctx, double b, double onward) {
  const auto& [model, state, ws] = ctx;
  const int r = model.size();
  ws.scratch.rhs.setZero(model.num_velocities());
  ws.scratch.rhs.tail(r) = ws.scratch.jump.force;
  ws.matrix.factor.SolveInPlace(ws.scratch.rhs);
  const double whole = ws.scratch.jump.force.dot(ws.scratch.rhs.tail(r));
  ws.scratch.solved.noalias() = ws.mass.M * ws.scratch.rhs;
  const double mass = ws.scratch.rhs.dot(ws.scratch.solved) / whole;
  ws.scratch.jump.damper_force.noalias() = model.reduced->D * ws.scratch.rhs.tail(r);
  const double damping = b * ws.scratch.rhs.tail(r).dot(ws.scratch.jump.damper_force) / whole,
               stiffness = 1 - mass - damping;
  const double followed = onward * stiffness * (1 + mass - stiffness);
  // Not so for a control that moves nothing, whose ratios are no numbers.
  return followed > 1 - stiffness ? (1 - stiffness) / followed : 1;
}

}  // namespace

void ReduceControlJumps(const StepContext& ctx, const MechanismState& start, double b, double onward) {
  const auto& [model, state, ws] = ctx;
  if (start.controls_move || model.size() == 0) return;
  if (start.controls == start.controls_from && start.activation.size() == 0) return;
  ws.stage.v_k = ws.x;
  StartStageMatrix(ctx, b);
  if (!ws.matrix.is_definite) return;
  ws.scratch.jump.control.setZero(start.controls.size());
  for (Eigen::Index i = 0; i < start.controls.size(); ++i) {
    const bool moves = HasDynamics(start, i);
    const double jump =
        moves ? ActivationAfter(start, i, (1 + onward) * b, (1 + onward) * b) - start.activation(i)
              : start.controls(i) - start.controls_from(i);
    if (jump == 0) continue;
    ws.scratch.jump.control(i) = jump;
    ws.scratch.jump.tau.setZero();
    AddControlForce(model.mechanism(), ws.configuration.kinematics, ws.scratch.jump.control,
                    ws.scratch.jump.tau);
    ws.scratch.jump.control(i) = 0;
    ws.scratch.jump.force.noalias() = ws.Q_now().transpose() * ws.scratch.jump.tau;
    const double share = ShareInFirstStage(ctx, b, onward);
    if (!moves)
      state.controls(i) -= (1 - share) * jump;
    else if (const double most = std::max(share, 1 / (1 + onward));
             (state.activation(i) - start.activation(i)) / jump > most)
      state.activation(i) = start.activation(i) + most * jump;
  }
}

}  // namespace fork1s
