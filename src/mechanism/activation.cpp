// Activation a of a control with the input u(t) = u + r t, between its bounds.
//
//   Lag:         da/dt = (u - a)/T,  a(t) = u + r (t - T e) + (a - u)(1 - e),  e = 1 - exp(-t/T)
//   Integrator:  da/dt = u,          a(t) = a + u t + r t²/2
//   Muscle:      da/dt = (u' - a)/τ, u' and a' are u and a held between 0 and 1,
//                τ = T₁ (0.5 + 1.5 a') where a rises, T₂/(0.5 + 1.5 a') where it falls; with a smoothing w it is
//                T₂/(..) + (T₁ (..) - T₂/(..)) S((u' - a)/w + 1/2), S(x) = x³(6 x² - 15 x + 10) held between 0 and 1
// Of a muscle with held input and without smoothing, p = |u - a| and c = 0.5 + 1.5 u obey
//     rising:   c ln(p₀/p) - 1.5 (p₀ - p) = t/T₁              falling:  p = c p₀ E/(c + 1.5 p₀ (1 - E)),  E = exp(-c t/T₂)
// else it is integrated in substeps of the classical Runge-Kutta rule, off by less than 1e-7 for time constants of 2 ms
// and more and w of 0 or of 0.05 and more.
//
// At a bound the activation stands until its rate points inward: until the input of a lag passes the bound, or
// that of an integrator passes 0, as for a lag where it is that of a muscle. Between two such times the activation leaves no bound that it has reached,
// so the solution without bounds, clamped at the end, is exact there.
#include "mechanism/activation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace fork1s::internal {
namespace {

double Held(double x) { return std::clamp(x, 0.0, 1.0); }

// rate [1/s] of the activation of a muscle; without smoothing on the side that `rises` tells.
double MuscleRate(const ControlDef& control, double a, double u, bool rises) {
  const double gap = u - a, slow = 0.5 + 1.5 * Held(a), up = control.time_constant * slow,
               down = control.deactivation_time / slow;
  if (!(control.smoothing > 0)) return gap / (rises ? up : down);
  const double x = Held(gap / control.smoothing + 0.5), share = x * x * x * (x * (6 * x - 15) + 10);
  return gap / (down + (up - down) * share);
}

// The classical rule of fourth order.
double RungeKutta(const ControlDef& control, double a, double u, double rate, double t, bool rises) {
  const double middle = u + 0.5 * rate * t, end = u + rate * t;
  const double k1 = MuscleRate(control, a, u, rises),
               k2 = MuscleRate(control, a + 0.5 * t * k1, middle, rises),
               k3 = MuscleRate(control, a + 0.5 * t * k2, middle, rises),
               k4 = MuscleRate(control, a + t * k3, end, rises);
  return a + t / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
}

// Solves f(y) = c y - 1.5 p (1 - exp(-y)) = time for y = ln(p/p_end): f rises and is convex, so Newton from above stays
// there.
double MuscleRise(double c, double p, double time) {
  double y = (time + 1.5 * p) / c;
  for (int i = 0; i < 60; ++i) {
    const double e = std::exp(-y), step = (c * y + 1.5 * p * std::expm1(-y) - time) / (c - 1.5 * p * e);
    y -= step;
    if (!(std::abs(step) > 1e-16 * (1 + y))) break;
  }
  return y;
}

// u between 0 and 1, at both ends.
double AdvanceMuscle(const ControlDef& control, double a, double u, double rate, double t) {
  if (rate == 0 && control.smoothing == 0 && a >= 0 && a <= 1) {
    const double c = 0.5 + 1.5 * u, p = std::abs(u - a);
    if (u > a) return u - p * std::exp(-MuscleRise(c, p, t / control.time_constant));
    const double x = -c * t / control.deactivation_time;
    return u + c * p * std::exp(x) / (c - 1.5 * p * std::expm1(x));
  }
  // The largest |d(da/dt)/da| without smoothing is 8/T₁ (a = 0, u = 1) or 3.5/T₂ (a = 1, u = 0). In substeps of 1/16 of
  // its inverse the activation is off by less than 1e-7 (tests/mechanism/activation_test.cpp).
  const double fastest = std::max(8 / control.time_constant, 3.5 / control.deactivation_time);
  // Nor does the input move by more than 1/32 of the smoothed range in one, but where that asks for more than 4096.
  const double moves =
      control.smoothing > 0 ? std::min(32 * std::abs(rate) * t / control.smoothing, 4096.0) : 0;
  const int count = static_cast<int>(std::ceil(std::max(16 * fastest * t, moves)));
  const double h = t / count;
  bool rises = u > a || (u == a && rate > 0);
  for (int i = 0; i < count; ++i) {
    const double from = u + rate * h * i, end = u + rate * h * (i + 1);
    const double next = RungeKutta(control, a, from, rate, h, rises);
    if (control.smoothing > 0 || (end > next) == rises || end == next) {
      a = next;
      continue;
    }
    // The input passes the activation once; from there on it goes by the other time constant.
    double below = 0, above = h;
    for (int k = 0; k < 50; ++k) {
      const double middle = 0.5 * (below + above);
      const bool is_before =
          (from + rate * middle > RungeKutta(control, a, from, rate, middle, rises)) == rises;
      (is_before ? below : above) = middle;
    }
    a = RungeKutta(control, a, from, rate, below, rises);
    rises = !rises;
    a = RungeKutta(control, a, from + rate * below, rate, h - below, rises);
  }
  return a;
}

double AdvanceWithoutBounds(const ControlDef& control, double a, double u, double rate, double t) {
  if (control.dynamics == ControlDynamics::kIntegrator) return a + t * (u + 0.5 * rate * t);
  const double e = -std::expm1(-t / control.time_constant);
  return u + rate * (t - control.time_constant * e) + (a - u) * (1 - e);
}

}  // namespace

double AdvanceActivation(const ControlDef& control, double a, double u, double rate, double t) {
  const double lower = control.activation_lower, upper = control.activation_upper;
  const bool integrates = control.dynamics == ControlDynamics::kIntegrator,
             is_muscle = control.dynamics == ControlDynamics::kMuscle;
  // Times at which a bound may be left, and the end.
  std::array<double, 5> ends = {t, t, t, t, t};
  if (rate != 0) {
    ends[0] = std::clamp(((integrates ? 0 : lower) - u) / rate, 0.0, t);
    ends[1] = std::clamp(((integrates ? 0 : upper) - u) / rate, 0.0, t);
    if (is_muscle) {  // where its input is held
      ends[2] = std::clamp(-u / rate, 0.0, t);
      ends[3] = std::clamp((1 - u) / rate, 0.0, t);
    }
    std::sort(ends.begin(), ends.end());
  }
  double from = 0;
  for (const double end : ends) {
    if (!(end > from)) continue;
    if (is_muscle) {
      const double first = Held(u + rate * from), last = Held(u + rate * end);
      a = std::clamp(AdvanceMuscle(control, a, first, (last - first) / (end - from), end - from), lower,
                     upper);
      from = end;
      continue;
    }
    a = std::clamp(AdvanceWithoutBounds(control, a, u + rate * from, rate, end - from), lower, upper);
    from = end;
  }
  return a;
}

double RestingActivation(const ControlDef& control) {
  if (control.dynamics == ControlDynamics::kIntegrator) return control.initial_activation;
  if (control.dynamics == ControlDynamics::kNone) return control.initial;
  const bool is_muscle = control.dynamics == ControlDynamics::kMuscle;
  return std::clamp(is_muscle ? Held(control.initial) : control.initial, control.activation_lower,
                    control.activation_upper);
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
