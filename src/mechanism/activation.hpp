// Activation of controls with dynamics: its equation, solved for an input that moves linearly.
#pragma once

#include <fork1s/mechanism/definition.hpp>

namespace fork1s::internal {

/// The activation after `t` [s] from a, while the input of the control goes from u at `rate` [1/s].
double AdvanceActivation(const ControlDef& control, double a, double u, double rate, double t);

/// Where the activation comes to rest with the input at its initial value: there, of an integrator where it starts.
double RestingActivation(const ControlDef& control);

/// Whether any control has dynamics.
bool HasActivation(const MechanismDef& def);

/// Activations at the start, one per control and 0 of those without dynamics; empty where none has any.
VectorX InitialActivation(const MechanismDef& def);

}  // namespace fork1s::internal
