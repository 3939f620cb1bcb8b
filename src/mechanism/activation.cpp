// Activation a of a control with the input u(t) = u + r t, between its bounds.
//
//   Lag:         da/dt = (u - a)/T,  a(t) = u + r (t - T e) + (a - u)(1 - e),  e = 1 - exp(-t/T)
//   Integrator:  da/dt = u,          a(t) = a + u t + r t²/2
//
// At a bound the activation stands until its rate points inward: until the input of a lag passes the bound, or
// that of an integrator passes 0. Between two such times the activation leaves no bound that it has reached,
// so the solution without bounds, clamped at the end, is exact there.
#include "mechanism/activation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace fork1s::internal {
namespace {

double AdvanceWithoutBounds(const ControlDef& control, double a, double u, double rate, double t) {
  if (control.dynamics == ControlDynamics::kIntegrator) return a + t * (u + 0.5 * rate * t);
  const double e = -std::expm1(-t / control.time_constant);
  return u + rate * (t - control.time_constant * e) + (a - u) * (1 - e);
}

}  // namespace

double AdvanceActivation(const ControlDef& control, double a, double u, double rate, double t) {
  const double lower = control.activation_lower, upper = control.activation_upper;
  const bool integrates = control.dynamics == ControlDynamics::kIntegrator;
  // Times at which a bound may be left, and the end.
  std::array<double, 3> ends = {t, t, t};
  if (rate != 0) {
    ends[0] = std::clamp(((integrates ? 0 : lower) - u) / rate, 0.0, t);
    ends[1] = std::clamp(((integrates ? 0 : upper) - u) / rate, 0.0, t);
    if (ends[0] > ends[1]) std::swap(ends[0], ends[1]);
  }
  double from = 0;
  for (const double end : ends) {
    if (!(end > from)) continue;
    a = std::clamp(AdvanceWithoutBounds(control, a, u + rate * from, rate, end - from), lower, upper);
    from = end;
  }
  return a;
}

double RestingActivation(const ControlDef& control) {
  if (control.dynamics == ControlDynamics::kIntegrator) return control.initial_activation;
  if (control.dynamics == ControlDynamics::kNone) return control.initial;
  return std::clamp(control.initial, control.activation_lower, control.activation_upper);
}

bool HasActivation(const MechanismDef& def) {
  return std::any_of(def.controls.begin(), def.controls.end(),
                     [](const ControlDef& c) { return c.dynamics != ControlDynamics::kNone; });
}

VectorX InitialActivation(const MechanismDef& def) {
  if (!HasActivation(def)) return {};
  VectorX a = VectorX::Zero(static_cast<Eigen::Index>(def.controls.size()));
  for (std::size_t k = 0; k < def.controls.size(); ++k)
    if (def.controls[k].dynamics != ControlDynamics::kNone)
      a(static_cast<Eigen::Index>(k)) = def.controls[k].initial_activation;
  return a;
}

}  // namespace fork1s::internal
