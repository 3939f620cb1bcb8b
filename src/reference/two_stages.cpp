// A step in full coordinates: one stage of backward Euler, or two of them for second order.
//
// Alexander's rule (SIAM J. Numer. Anal. 14, 1977): with g = 1 - 1/√2 a stage is implicit Euler over g h,
// what changed in it goes on evenly to (1 - g) h, and from there a second stage goes over g h to the end,
//     x₁ = x + g h f(x₁),    x' = x + s (x₁ - x),  s = (1 - g)/g,    x⁺ = x' + g h f(x⁺)
// of order two, and as implicit Euler it brings to rest what a step cannot follow. x are momenta as the world
// sees them, joint displacements and rates, centres and turns of bases and free bodies: no force has to be
// known but by what it did to them. Joints and loops hold at the end of either stage, velocities too, so the
// rule is that of constraints on velocities (index two), and poses are put onto those on positions. Contact
// is a force like any other, f of both stages within the cone, so what the step gives, (1 - g) f₁ + g f₂, is
// too.
//
// An impact is none: going on evenly would throw back what was stopped, at (s - 1) times its speed. Such a
// part of the step is taken back and halved, up to four times; the sixteenth in which something is met is one
// stage over its whole length.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "simulation_detail.hpp"

namespace fork1s {

using internal::FullFreeBody;
using internal::FullMechanism;

namespace {

constexpr double kStage = 1 - 1 / std::numbers::sqrt2;
constexpr double kOnward = (1 - kStage) / kStage;
constexpr int kHalvings = 4;
// What comes slower than this share of g h is met without being thrown back: gravity takes (s - 1) times it
// within the second stage.
constexpr double kCaught = kStage / (kOnward - 1) * 0.99;
constexpr double kSlow = 1e-5;  // m/s, where there is no gravity

double LargestGap(const std::vector<FullMechanism>& mechanisms) {
  double gap = 0;
  for (const FullMechanism& m : mechanisms) gap = std::max(gap, m.NextGap());
  return gap;
}

bool AreOne(const ContactPoint& a, const ContactPoint& b) {
  return a.body_a == b.body_a && a.body_b == b.body_b && a.geometry_a == b.geometry_a &&
         a.geometry_b == b.geometry_b && (a.point - b.point).norm() < 0.02 &&
         a.frame.row(0).dot(b.frame.row(0)) > 0.8;
}

}  // namespace

FullSimulation::Detail::Saved FullSimulation::Detail::Save() const {
  Saved saved{{}, free_bodies, contact_set.Save(), contacts};
  for (const FullMechanism& m : mechanisms) saved.mechanisms.push_back(m.Save());
  return saved;
}

double FullSimulation::Detail::Slow(double part) const {
  return kCaught * scene.gravity.norm() * part + kSlow;
}

void FullSimulation::Detail::Restore(const Saved& saved) {
  for (std::size_t i = 0; i < mechanisms.size(); ++i) mechanisms[i].Restore(saved.mechanisms[i]);
  free_bodies = saved.free_bodies;
  contact_set.Restore(saved.contacts);
  contacts = saved.told;
}

void FullSimulation::Detail::StartBasePaths() {
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    if (mechanisms[i].mechanism().base() != BaseKind::kDriven) continue;
    const Vector6 rate_W = InAxes(base_now[i].rotation(), mechanisms[i].BodyTwist(0));
    base_path[i] = ComputeBasePath(base_now[i], rate_W, base_next[i], base_rate_next[i], base_history[i], dt);
  }
}

namespace {

// Of a muscle: da/dt at its activation a and input u.
double MuscleRate(const ControlDef& def, double a, double u) {
  const auto held = [](double x) { return std::min(std::max(x, 0.0), 1.0); };
  const double difference = held(u) - a, factor = 0.5 + 1.5 * held(a);
  const double rise = def.time_constant * factor, fall = def.deactivation_time / factor;
  if (def.smoothing == 0) return difference / (difference > 0 ? rise : fall);
  const double x = held(0.5 + difference / def.smoothing);
  return difference /
         (fall + (rise - fall) * (6 * std::pow(x, 5) - 15 * std::pow(x, 4) + 10 * std::pow(x, 3)));
}

// Heun's rule of third order with halved steps until two halves differ by less than 1e-11 from the whole: where the rate
// has a kink, steps become short by themselves.
double SolveMuscle(const ControlDef& def, double a, double u, double r, double t, int halvings) {
  const auto step = [&](double from, double start, double h) {
    const auto rate = [&](double x, double s) { return MuscleRate(def, x, u + r * s); };
    const double first = rate(from, start), second = rate(from + h / 3 * first, start + h / 3),
                 third = rate(from + 2 * h / 3 * second, start + 2 * h / 3);
    return from + h / 4 * (first + 3 * third);
  };
  const double whole = step(a, 0, t), halves = step(step(a, 0, t / 2), t / 2, t / 2);
  if (std::abs(halves - whole) < 1e-11 || halvings == 0) return halves + (halves - whole) / 7;
  const double middle = SolveMuscle(def, a, u, r, t / 2, halvings - 1);
  return SolveMuscle(def, middle, u + r * t / 2, r, t / 2, halvings - 1);
}

// Solves da/dt = (u - a)/T, or da/dt = u, or that of a muscle over t from a, u moving at the rate r. Where it turns towards the inside of
// the bounds, the rest is a problem of its own.
double SolveActivation(const ControlDef& def, double a, double u, double r, double t) {
  const bool lag = def.dynamics != ControlDynamics::kIntegrator;
  for (const double pivot : {lag ? def.activation_lower : 0, lag ? def.activation_upper : 0}) {
    const double at = (pivot - u) / r;
    if (at > 0 && at < t) return SolveActivation(def, SolveActivation(def, a, u, r, at), pivot, r, t - at);
  }
  if (def.dynamics == ControlDynamics::kMuscle)
    return std::min(std::max(SolveMuscle(def, a, u, r, t, 40), def.activation_lower), def.activation_upper);
  const double T = def.time_constant, last = u + r * t;
  const double free = lag ? (a - u + r * T) * std::exp(-t / T) + last - r * T : a + 0.5 * (u + last) * t;
  return std::min(std::max(free, def.activation_lower), def.activation_upper);
}

}  // namespace

double FullSimulation::Detail::ActivationAfter(Eigen::Index k, double share) const {
  const double from = options.controls_move ? controls_before(k) : controls(k);
  return SolveActivation(*dynamics[static_cast<std::size_t>(k)], activation(k), from,
                         (controls(k) - from) / dt, share * dt);
}

// Controls as they are at a share of the step, driven bases on their paths.
void FullSimulation::Detail::SetInputs(double share) {
  Eigen::Index next = 0;
  for (FullMechanism& m : mechanisms) {
    const Eigen::Index n = m.controls.size();
    m.controls = controls.segment(next, n);
    if (options.controls_move)
      m.controls -= (1 - share) * (controls.segment(next, n) - controls_before.segment(next, n));
    for (Eigen::Index k = 0; k < n; ++k)
      if (dynamics[static_cast<std::size_t>(next + k)]) m.controls(k) = ActivationAfter(next + k, share);
    next += n;
  }
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    if (mechanisms[i].mechanism().base() != BaseKind::kDriven) continue;
    mechanisms[i].driven_next = base_path[i].PoseAt(share);
    mechanisms[i].driven_twist =
        InAxes(mechanisms[i].driven_next.rotation().transpose(), base_path[i].RateAt(share));
  }
}

FullStepReport FullSimulation::Detail::StepByStages() {
  FullStepReport report;
  report.parts = 0;
  const Saved before = Save();
  contacts.clear();
  for (FullMechanism& m : mechanisms) m.StartReactions();
  StartBasePaths();
  report.finite = Advance(0, 1, kHalvings, report);
  if (report.finite) {
    for (const FullContact& c : contacts) report.contacts += c.force.isZero(0) ? 0 : 1;
    for (std::size_t i = 0; i < base_now.size(); ++i)
      if (mechanisms[i].mechanism().base() == BaseKind::kDriven)
        base_history[i] = base_path[i].History(base_history[i]);
    base_now = base_next;
    VectorX next = activation;
    for (Eigen::Index k = 0; k < controls.size(); ++k)
      if (dynamics[static_cast<std::size_t>(k)]) next(k) = ActivationAfter(k, 1);
    activation = next;
    controls_before = controls;
    ++steps;
  } else {
    Restore(before);
    report.converged = false;
  }
  base_rates.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (FullMechanism& m : mechanisms) m.ClearLoads();
  for (FullFreeBody& b : free_bodies) b.ClearLoads();
  return report;
}

bool FullSimulation::Detail::Advance(double from, double to, int halvings, FullStepReport& report) {
  if (options.integrator == FullIntegrator::kEuler) return OneStage(from, to, report);
  const Saved before = Save();
  const FullStepReport reported = report;
  const Outcome outcome = TwoStages(from, to, report);
  if (outcome == Outcome::kDone) {
    ++report.parts;
    return true;
  }
  Restore(before);
  const int iterations = report.iterations;
  report = reported;
  report.iterations = iterations;
  report.impact = report.impact || outcome == Outcome::kMeets;
  if (halvings > 0) {
    const double middle = 0.5 * (from + to);
    return Advance(from, middle, halvings - 1, report) && Advance(middle, to, halvings - 1, report);
  }
  return OneStage(from, to, report);
}

bool FullSimulation::Detail::OneStage(double from, double to, FullStepReport& report) {
  ++report.parts;
  if (options.integrator == FullIntegrator::kTwoStages) ++report.euler_parts;
  std::vector<FullContact> met;
  const bool converged = report.converged;
  if (Stage(from, to, to, false, report) == Outcome::kUnsolved && !report.finite) return false;
  report.converged = report.converged && converged;
  contact_set.CloseStage((to - from) * dt, Slow((to - from) * dt), report, met);
  AddForces(to - from, met);
  for (FullMechanism& m : mechanisms) m.Commit();
  for (FullFreeBody& b : free_bodies) b.Commit();
  return true;
}

// Opens and solves one stage that ends at the share `end` of the step, in a part of it.
FullSimulation::Detail::Outcome FullSimulation::Detail::Stage(double from, double to, double end, bool second,
                                                              FullStepReport& report) {
  const double part = (to - from) * dt, h = end < to || second ? kStage * part : part;
  SetInputs(end);
  const auto open = [&](bool at_guess) {
    if (!contact_set.OpenStage(mechanisms, free_bodies, h, part, scene.gravity, options, at_guess))
      report.contacts_dropped = true;
  };
  open(false);
  report.finite = Solve(
      [&] {
        for (FullMechanism& m : mechanisms)
          if (!m.BeginStage(h, scene.gravity, second)) return false;
        for (FullFreeBody& b : free_bodies) b.BeginStage(h, scene.gravity, second);
        return true;
      },
      report);
  if (!report.finite) return Outcome::kUnsolved;
  bool converged = report.converged;
  // Contact was found where the stage starts. Found again where that has brought the bodies, it is off by the
  // square of the step instead.
  if (!contact_set.empty()) {
    open(true);
    report.finite = Iterate(true, report);
    if (!report.finite) return Outcome::kUnsolved;
    converged = report.converged;
  }
  const double gap = LargestGap(mechanisms);
  report.joint_gap = std::max(report.joint_gap, gap);
  for (const FullMechanism& m : mechanisms)
    if (!(m.NextGap() < 1e-9 * std::max(1.0, m.mechanism().length_scale()))) converged = false;
  report.converged = converged;
  return converged || report.residual < 1e-6 ? Outcome::kDone : Outcome::kUnsolved;
}

FullSimulation::Detail::Outcome FullSimulation::Detail::TwoStages(double from, double to,
                                                                  FullStepReport& report) {
  const double part = (to - from) * dt, h = kStage * part;
  const double slow = Slow(part);
  bool converged = report.converged;
  for (const bool second : {false, true}) {
    const Outcome outcome = Stage(from, to, second ? to : from + kStage * (to - from), second, report);
    if (outcome != Outcome::kDone) return outcome;
    converged = converged && report.converged;
    if (contact_set.HasImpact(mechanisms, part, slow, second)) return Outcome::kMeets;
    std::vector<FullContact> stage;
    contact_set.CloseStage(h, slow, report, stage);
    AddForces((to - from) * (second ? kStage : 1 - kStage), stage);
    if (second) break;
    for (FullMechanism& m : mechanisms) m.GoOn(kOnward);
    for (FullFreeBody& b : free_bodies) b.GoOn(kOnward);
  }
  report.converged = converged;
  for (FullMechanism& m : mechanisms) m.Commit();
  for (FullFreeBody& b : free_bodies) b.Commit();
  return Outcome::kDone;
}

// Forces of the parts of a step add up, by their share of it, to its mean.
void FullSimulation::Detail::AddForces(double share, const std::vector<FullContact>& stage) {
  std::vector<char> taken(contacts.size(), 0);
  for (const FullContact& c : stage) {
    std::size_t at = 0;
    while (at < taken.size() && (taken[at] || !AreOne(contacts[at].point, c.point))) ++at;
    if (at < taken.size()) {
      taken[at] = 1;
      contacts[at].point = c.point;
    } else {
      at = contacts.size();
      contacts.push_back({c.point, Vector3::Zero()});
    }
    contacts[at].force += share * c.force;
  }
}

}  // namespace fork1s
