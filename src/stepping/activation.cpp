// Activations of controls within a step: their input is held, or moves linearly over the step.
#include "mechanism/activation.hpp"

#include "mechanism_detail.hpp"

namespace fork1s {

bool HasDynamics(const MechanismState& state, Eigen::Index control) {
  return state.activation.size() > 0 &&
         state.model->mechanism->definition().controls[static_cast<std::size_t>(control)].dynamics !=
             ControlDynamics::kNone;
}

double ActivationOf(const MechanismState& state, Eigen::Index control) {
  return HasDynamics(state, control) ? state.activation(control) : state.controls(control);
}

VectorX ActivationsOf(const MechanismState& state) {
  VectorX a = state.controls;
  for (Eigen::Index k = 0; k < state.activation.size(); ++k) a(k) = ActivationOf(state, k);
  return a;
}

const VectorX& UpdateActivations(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  if (state.activation.size() == 0) return state.controls;
  for (Eigen::Index k = 0; k < state.controls.size(); ++k) ws.scratch.activation(k) = ActivationOf(state, k);
  return ws.scratch.activation;
}

double ActivationAfter(const MechanismState& start, Eigen::Index control, double t, double h) {
  const double u = start.controls_move ? start.controls_from(control) : start.controls(control),
               rate = (start.controls(control) - u) / h;
  return internal::AdvanceActivation(
      start.model->mechanism->definition().controls[static_cast<std::size_t>(control)],
      start.activation(control), u, rate, t);
}

void AdvanceActivations(const StepContext& ctx, const MechanismState& start, double share, double h) {
  for (Eigen::Index k = 0; k < start.activation.size(); ++k)
    if (HasDynamics(start, k)) ctx.state.activation(k) = ActivationAfter(start, k, share * h, h);
}

}  // namespace fork1s
