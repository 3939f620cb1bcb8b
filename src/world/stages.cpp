// A step of implicit stages (implicit_stage.cpp): two of them, Alexander's SDIRK2, or one, backward Euler.
//
// Each stage is solved by Newton iteration with the contact solve inside: contacts are found, and forces
// evaluated, at the pose that the velocity at hand leads to, first an extrapolated one; the velocity found
// leads to another pose, and where the equation of the stage has a residual there, the iteration goes on from
// it.
//
// A step that contains an event is taken as two of half the length, and so on: an impact, a change of
// saturation between its stages, a stage that does not converge. The shortest parts are one stage with b = h,
// backward Euler: extrapolated, the velocity that the first stage stopped would come back. No stage is
// accepted unless it is solved; where the shortest parts are not, the step is undone.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "detail.hpp"
#include "step_report.hpp"

namespace fork1s {
namespace {

constexpr double kStageShare = 1 - 1 / std::numbers::sqrt2;            // γ
constexpr double kOnward = (1 - kStageShare) / kStageShare;            // s
// A stage that takes more Newton iterations, or whose residual grows more often, diverges or cycles: it is
// halved; one of backward Euler, which falls back to no better scheme, first tries as often as that with
// inertial stiffness in its matrix (RenewStageMatrix).
constexpr int kMaxNewtonIterations = 10, kMaxResidualGrowths = 1;
// The matrix of a stage is renewed where this many more iterations would not solve it: they cost as much as a
// new matrix.
constexpr int kIterationsOfMatrix = 3;
// What moves by less than these shares of the stage's motion and of a mechanism's length does not matter.
constexpr double kRelativeTolerance = 1e-6, kLengthTolerance = 1e-9;
// A stage is solved where another iteration would change poses by less than kRelativeTolerance of the motion
// and than kChangeTolerance of what the velocity has changed by in the step. What is left adds up to at most
// that share of all that the velocity changes by, however many steps that takes. kRounding is a share of the
// length below which nothing is counted. Stiff mechanisms leave more by rounding: where an iteration no
// longer helps, what does not matter is accepted.
constexpr double kChangeTolerance = 1e-5, kRounding = 1e-12;
// Contacts of meshes jump from one facet to another between iterations. A stage that would be halved is
// accepted with a residual within this share of the length, and reported.
constexpr double kStagnationTolerance = 1e-6;

// The contraction of an iteration is taken for no less than rounding leaves, and for no contraction from 1
// on.
constexpr double kLeastContraction = 1e-12, kNoContraction = 1 - 1e-6;
// Residual after an iteration and change by it, in tolerances.
bool IsSlow(double residual, double change) {
  const double contraction = change > 0 ? residual / change : 0;
  return !(residual * std::pow(contraction, kIterationsOfMatrix) <= 1);
}

double Negligible(double motion, double length) {
  return kRelativeTolerance * motion + kLengthTolerance * length;
}

double Tolerance(const StageMotion& moved, double length) {
  return std::min(kRelativeTolerance * moved.motion, kChangeTolerance * moved.velocity_change) +
         kRounding * length;
}

}  // namespace

StepReport World::Detail::StepByStages(const StepOptions& options) {
  StepReport report;
  const double h = options.h;
  BeginStep(h);
  is_backward_euler_ = options.integrator == Integrator::kEuler || depth_ >= kMaxEventHalvings;
  const double b = is_backward_euler_ ? h : kStageShare * h;
  if (depth_ == 0) {
    approaches_.SetSpeeds(options);
    sums_.Clear(bodies_.mechanisms.size());
  }
  halvings_[static_cast<std::size_t>(depth_)].sums = sums_;
  RecordStops(h);
  history_.StartStep();
  // Of backward Euler those of the last step, which were found where it ended.
  if (depth_ == 0 && is_backward_euler_) start_points_ = detection_.points;
  if (!is_backward_euler_) {
    PrepareContacts(options, report);
    if (depth_ == 0) start_points_ = detection_.points;
    RecordStartGaps();
    report.halving_of = FindClosingAtSpeed(Impacts(), h);
    if (report.halving_of.kind != StepSubject::Kind::kNone)
      return HalveOrUndo(options, HalvingCause::kImpact, report);
  }
  {
    const PartClock clock(times_, &StepPartTimes::moving);
    bodies_.ForMechanisms(
        [&](std::size_t i) { fork1s::BeginStep(bodies_.mechanisms[i], h, b, options.gravity); });
    for (FreeBody& body : bodies_.free_bodies) body.BeginStep(b, options.gravity);
    RecordStageStart(true);
  }
  for (StageScheme scheme = is_backward_euler_ ? StageScheme::kBackwardEuler : StageScheme::kFirstOfTwo;;
       scheme = StageScheme::kSecondOfTwo) {
    if (const HalvingCause cause = SolveStage(options, scheme, report); cause != HalvingCause::kNone)
      return HalveOrUndo(options, cause, report);
    StoreStage(b, scheme, report);
    if (scheme != StageScheme::kFirstOfTwo) break;
    RecordStageStart(false);
    for (MechanismDynamics& m : bodies_.mechanisms) ExtrapolateStage(m, b, kOnward);
    for (FreeBody& body : bodies_.free_bodies) body.ExtrapolateStage(b, kOnward);
    history_.CarryStartGaps();
    history_.Take(contacts_, b, detection_.poses);
  }
  const double between_stages = is_backward_euler_ ? 0 : h - b;
  bodies_.ForMechanisms([&](std::size_t i) { fork1s::EndStep(bodies_.mechanisms[i], between_stages); });
  for (FreeBody& body : bodies_.free_bodies) body.EndStep(between_stages);
  if (depth_ == 0) return FinishStep(options, before_, report);
  return IsFinite(true) ? report : UndoStep(before_, report);
}

// What follows the last stage; `start` is where the step is undone to if it is not finite.
StepReport World::Detail::FinishStep(const StepOptions& options, WorldState& start, StepReport report) {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    StoreBaseHistory(bodies_.mechanisms[i], start.mechanisms[i], options.h);
    RecordLoads(bodies_.mechanisms[i], start.mechanisms[i], stops_[i].impulses, stops_[i].friction_impulses);
  }
  sums_.StoreContacts(contacts_);
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    stops_[i].impulses = sums_.rows[i].limit_impulses;
    stops_[i].friction_impulses = sums_.rows[i].friction_impulses;
  }
  contacts_h_ = options.h;
  report.contacts = static_cast<int>(
      std::count_if(contacts_.begin(), contacts_.end(), [](const auto& c) { return c.impulse(0) > 0; }));
  report.forces_at_bound = 0;
  for (const MechanismDynamics& m : bodies_.mechanisms) {
    report.forces_at_bound += m.NumForcesAtBound();
    report.loop_residual = std::max(report.loop_residual, m.configuration().loop_residual);
  }
  in_stage_ = false;
  if (options.refresh) {
    const PartClock clock(times_, &StepPartTimes::refreshing);
    bodies_.ForMechanisms([&](std::size_t i) {
      refreshes_[i].result = 0;
      RefreshIfStale(i, options.h);
    });
    CountRefreshes(report);
  }
  return IsFinite(true) ? report : UndoStep(start, report);
}

void World::Detail::MoveAllToStagePoses(double b, double time) {
  const PartClock clock(times_, &StepPartTimes::moving);
  bodies_.ForMechanisms([&](std::size_t i) { MoveToStagePose(bodies_.mechanisms[i], b, time); });
  for (FreeBody& body : bodies_.free_bodies) body.MoveToStagePose(b);
}

// Newton iteration of one stage; what the step is to be halved for, if anything.
HalvingCause World::Detail::SolveStage(const StepOptions& options, StageScheme scheme, StepReport& report) {
  StepOptions stage = options;
  if (scheme != StageScheme::kBackwardEuler) stage.h = kStageShare * options.h;
  const double share = scheme == StageScheme::kFirstOfTwo ? kStageShare : 1, time = share * options.h;
  in_stage_ = true;
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
    SetInputsWithin(bodies_.mechanisms[i], before_.mechanisms[i], share);
  if (scheme == StageScheme::kFirstOfTwo)
    bodies_.ForMechanisms([&](std::size_t i) {
      ReduceControlJumps(bodies_.mechanisms[i], before_.mechanisms[i], stage.h, kOnward);
    });
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    bodies_.free_bodies[i].SetInputsWithin(before_.free_bodies[i], 0, share);
  MoveAllToStagePoses(stage.h, time);
  ++report.stages;
  detection_.least_margin = 0;
  all_stops_ = from_stage_start_ = false;
  StartRows(stage.h);
  StageResidual last;
  int growths = 0, max_iterations = kMaxNewtonIterations;
  bool inertial = false;
  bool is_fresh = scheme != StageScheme::kSecondOfTwo;
  for (int iteration = 1;; ++iteration) {
    ++report.stage_iterations;
    report.max_stage_iterations = std::max(report.max_stage_iterations, iteration);
    if (!from_stage_start_ && !PrepareContacts(stage, report)) break;
    if ((from_stage_start_ || (iteration == 1 && MayHavePassed())) &&
        !PrepareContactsAtStageStart(stage, report))
      break;
    {
      const PartClock clock(times_, &StepPartTimes::free_velocities);
      bodies_.ForMechanisms([&](std::size_t i) { SolveFreeStage(bodies_.mechanisms[i], stage.h); });
      detection_.FindTouched(bodies_.free_bodies.size());
      for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
        bodies_.free_bodies[i].PredictStage(stage.h, detection_.touched[i] != 0);
    }
    const ContactSolverReport before = report.solver;
    SolveContacts(stage, report);
    MergeSolverReport(before, report.solver);
    if (!IsFinite(false)) break;
    if (const HalvingCause event = FindStageEvent(options, scheme, iteration, report); event != HalvingCause::kNone)
      return event;
    const StageResidual found = MoveAndComputeResiduals(stage, scheme, time, iteration == 1);
    if (!IsFinite(true)) break;
    const bool from_start = from_stage_start_;
    from_stage_start_ = !CoversMotion();
    if (from_stage_start_) {
      if (iteration == max_iterations || !std::isfinite(detection_.least_margin)) break;
      continue;
    }
    const bool helps = iteration == 1 || (found.ratio < last.ratio && !found.is_slow);
    // By a matrix of another pose a growth says nothing of the equation.
    growths += iteration > 1 && is_fresh && !(found.ratio < last.ratio) ? 1 : 0;
    last = found;
    bool ends = iteration == max_iterations || growths > kMaxResidualGrowths;
    const bool begins_inertial =
        ends && scheme == StageScheme::kBackwardEuler && !inertial && found.ratio > 1;
    if (begins_inertial) {
      inertial = true;
      ends = false;
      growths = 0;
      max_iterations = iteration + 2 * kMaxNewtonIterations;
    }
    if (!from_start && (found.ratio <= 1 || (found.is_negligible && !helps) || (ends && found.is_small))) {
      if (found.ratio > 1 && !found.is_negligible) report.stages_converged = false;
      if (found.largest > report.stage_residual) {
        report.stage_residual = found.largest;
        report.stage_residual_of = found.subject;
      }
      if (scheme == StageScheme::kSecondOfTwo && ChangesSaturation(stage.h, report)) return HalvingCause::kSaturation;
      return HalvingCause::kNone;
    }
    if (ends) break;
    is_fresh = found.is_slow || begins_inertial;
    if (is_fresh)
      bodies_.ForMechanisms([&](std::size_t i) { RenewStageMatrix(bodies_.mechanisms[i], inertial); });
  }
  const StepSubject not_finite = FindNotFinite();
  report.halving_of = not_finite.kind == StepSubject::Kind::kNone ? last.subject : not_finite;
  return HalvingCause::kUnsolved;
}

// Events that the velocity found tells; parts by backward Euler carry them.
HalvingCause World::Detail::FindStageEvent(const StepOptions& options, StageScheme scheme, int iteration,
                                           StepReport& report) const {
  if (scheme == StageScheme::kBackwardEuler) return HalvingCause::kNone;
  const ImpactView at = Impacts();
  // At the first iteration rows still know the velocity that the stage starts with.
  if (iteration == 1 || from_stage_start_) report.halving_of = FindMetAtSpeed(at, options.h);
  const auto none = [&] { return report.halving_of.kind == StepSubject::Kind::kNone; };
  if (scheme == StageScheme::kSecondOfTwo) {
    if (none()) report.halving_of = FindBeyondAtBasePoint(at, options.h, from_stage_start_);
    if (none()) report.halving_of = FindParting(at, stops_, kStageShare * options.h);
  }
  return none() ? HalvingCause::kNone : HalvingCause::kImpact;
}

namespace {

// Adds a residual [m] of something that moves by `motion` [m] in the stage.
void Add(double residual, const StageMotion& moved, double length, StepSubject subject, StageResidual& out) {
  // What is beyond the range of numbers is not solved, however large the motion that the residual is compared
  // with.
  const double ratio = std::isfinite(moved.motion) && std::isfinite(residual)
                           ? residual / std::max(Tolerance(moved, length), 1e-300)
                           : std::numeric_limits<double>::infinity();
  out.largest = std::max(out.largest, residual);
  out.is_negligible = out.is_negligible && residual <= Negligible(moved.motion, length);
  out.is_small = out.is_small && (ratio <= 1 || residual <= kStagnationTolerance * length);
  if (ratio <= out.ratio && out.subject.kind != StepSubject::Kind::kNone) return;
  out.ratio = ratio;
  out.subject = subject;
}

}  // namespace

// Ends a Newton iteration: everything moves to the pose found. Where mechanisms change so little that by the
// contraction seen last the next iteration would change less than the tolerance, their stage is accepted
// without another evaluation.
StageResidual World::Detail::MoveAndComputeResiduals(const StepOptions& stage, StageScheme scheme,
                                                     double time, bool is_first) {
  const PartClock clock(times_, &StepPartTimes::moving);
  const double b = stage.h;
  StageResidual bodies, changes, found;
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i) {
    FreeBody& body = bodies_.free_bodies[i];
    StageMotion moved;
    const double residual = body.MoveAndComputeResidual(b, moved);
    Add(residual, moved, std::sqrt(body.inertia().rotational.trace() / body.inertia().mass),
        {StepSubject::Kind::kFreeBody, static_cast<int>(i), -1}, bodies);
  }
  const auto length = [&](std::size_t i) { return bodies_.mechanisms[i].mechanism().length_scale(); };
  const auto subject = [](std::size_t i) {
    return StepSubject{StepSubject::Kind::kMechanism, static_cast<int>(i), -1};
  };
  stage_changes_.resize(bodies_.mechanisms.size());
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    stage_changes_[i] = ComputeStageChange(bodies_.mechanisms[i], b);
    Add(stage_changes_[i].change, stage_changes_[i], length(i), subject(i), changes);
  }
  double& contraction = contraction_[scheme == StageScheme::kSecondOfTwo ? 1 : 0];
  const double next = contraction / (1 - contraction);
  // An iteration with the contacts of the stage's start is never the last. Of forces that changed sides in
  // the solve the contraction of other iterations says nothing.
  if (bodies.ratio <= 1 && next * changes.ratio <= 1 && !from_stage_start_ && rows_.bounded_forces.empty()) {
    const bool is_last = scheme != StageScheme::kFirstOfTwo;
    bodies_.ForMechanisms([&](std::size_t i) { AcceptStage(bodies_.mechanisms[i], b, time, is_last); });
    for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
      Add(next * stage_changes_[i].change, stage_changes_[i], length(i), subject(i), bodies);
    // What is not measured is trusted less and less (Hairer & Wanner II, IV.8).
    contraction = std::pow(contraction, 0.8);
    return bodies;
  }
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
    Add(MoveAndComputeResidual(bodies_.mechanisms[i], b, time), stage_changes_[i], length(i), subject(i),
        found);
  if (changes.ratio > 0 && !from_stage_start_) {
    const double measured = std::clamp(found.ratio / changes.ratio, kLeastContraction, kNoContraction);
    contraction = is_first ? measured : std::max(contraction, measured);
  }
  found.is_slow = IsSlow(found.ratio, changes.ratio);
  if (bodies.ratio <= found.ratio && found.subject.kind != StepSubject::Kind::kNone)
    bodies.subject = found.subject;
  found.subject = bodies.subject;
  found.ratio = std::max(found.ratio, bodies.ratio);
  found.largest = std::max(found.largest, bodies.largest);
  found.is_small = found.is_small && bodies.is_small;
  found.is_negligible = found.is_negligible && bodies.is_negligible;
  return found;
}

// Whether a force whose saturation differs between the two stages changes by so much that its extrapolation, s b Δf of
// momentum, moves something by more than the tolerance. A stage without the spring of a servo is not L-stable in it.
bool World::Detail::ChangesSaturation(double b, StepReport& report) {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    if (!HasSwitches(m)) continue;
    const SaturationChange change = ComputeSaturationChange(bodies_.mechanisms[i], b, kOnward);
    if (change.displacement <= Negligible(change.motion, m.mechanism().length_scale())) continue;
    report.halving_of = {change.is_servo ? StepSubject::Kind::kServo : StepSubject::Kind::kSpring, static_cast<int>(i),
                         change.index};
    return true;
  }
  return false;
}

// Contacts as the stage at hand, of length h, solved them.
void World::Detail::RecordContacts(double h) {
  contacts_.resize(detection_.points.size());
  ForContacts(detection_, [&](std::size_t i) {
    const ContactConstraint& c = rows_.contacts[i];
    contacts_[i].point = detection_.points[i];
    contacts_[i].impulse = c.impulse;
    contacts_[i].friction = c.friction;
    contacts_[i].moment = c.moment;
    contacts_[i].use = c.use;
    contacts_[i].end_force = c.impulse / h;
    contacts_[i].end_moment = c.moment / h;
    contacts_[i].end_speed = RelativeSpeed(c, rows_.velocities)(0);
  });
}

void World::Detail::SumImpulses(double weight) {
  summation_.Add(weight, contacts_, history_.match, history_.contacts, sums_);
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
    sums_.AddRows(weight, i, stops_[i].impulses, stops_[i].friction_impulses);
}

// Contacts of a stage that was solved: what the next one starts from, and their share of the impulses of the step.
void World::Detail::StoreStage(double b, StageScheme scheme, StepReport& report) {
  history_.is_fresh.resize(detection_.points.size());
  for (std::size_t i = 0; i < detection_.points.size(); ++i)
    history_.is_fresh[i] =
        rows_.contacts[i].impulse(0) > 0 &&
        !history_.CarriedAtRest(i, kPartingShare * detection_.shapes.PairSize(detection_.points[i]) / b);
  RecordContacts(b);
  for (StopHistory& stops : stops_)
    for (std::size_t at = 0; at < stops.impulses.size(); ++at) {
      stops.is_fresh[at] = stops.impulses[at] > 0 && (stops.is_fresh[at] || !stops.carried[at]);
      if (stops.impulses[at] > 0) stops.carried[at] = 1;
    }
  const auto bears = [](const LimitConstraint& row) {
    return !(row.lower < 0) && row.impulse > 0;
  };  // no friction
  report.limits =
      std::max(report.limits,
               static_cast<int>(std::count_if(
                   rows_.limits.begin(),
                   rows_.limits.end() - static_cast<std::ptrdiff_t>(rows_.bounded_forces.size()), bears)));
  for (const ContactRecord& c : contacts_)
    if (c.impulse(0) > 0) report.max_penetration = std::max(report.max_penetration, -c.point.gap);
  // (1 - γ) f₁ + γ f₂ over the step, impulses being b f: s of the first and one of the second.
  SumImpulses(scheme == StageScheme::kFirstOfTwo ? kOnward : 1);
  if (scheme != StageScheme::kFirstOfTwo) return;
  for (MechanismDynamics& m : bodies_.mechanisms)
    if (HasSwitches(m)) StoreSwitchedForces(m, b);
  // The second stage starts where tangential springs are at its base point.
  history_.to_base_point.resize(contacts_.size());
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const ContactConstraint& c = rows_.contacts[i];
    history_.to_base_point[i].head<3>() = (kOnward - 1) / b * (c.moment - c.held_moment);
    history_.to_base_point[i].tail<3>() = (kOnward - 1) / b * (c.impulse - c.held);
    history_.to_base_point[i](3) = 0;  // the normal force has no spring
  }
}

// The step from its start again, by two of half the length, or undone where even the shortest part is not solved.
StepReport World::Detail::HalveOrUndo(const StepOptions& options, HalvingCause cause, const StepReport& attempt) {
  StepReport report;
  report.stages = attempt.stages;
  report.stage_iterations = attempt.stage_iterations;
  report.max_stage_iterations = attempt.max_stage_iterations;
  report.halving_of = attempt.halving_of;
  if (depth_ == kMaxHalvings) {
    report.stages_converged = false;
    return UndoStep(before_, report);
  }
  Halving& whole = halvings_[static_cast<std::size_t>(depth_)];
  whole.start = before_;
  sums_ = whole.sums;
  Restore(whole.start);
  StepOptions half = options;
  half.h = 0.5 * options.h;
  half.refresh = false;
  report.parts = 0;
  report.impact = cause == HalvingCause::kImpact;
  for (int k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
      SetInputsOfHalf(bodies_.mechanisms[i], whole.start.mechanisms[i], options.h, k == 1);
    for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
      bodies_.free_bodies[i].SetInputsWithin(whole.start.free_bodies[i], k == 0 ? 0 : 0.5, k == 0 ? 0.5 : 1);
    ++depth_;
    const StepReport part = StepByStages(half);
    --depth_;
    AddReport(part, report);
    if (!part.finite) return UndoStep(whole.start, report);
  }
  report.halving = cause;
  report.halving_of = attempt.halving_of;
  return depth_ > 0 ? report : FinishStep(options, whole.start, report);
}

}  // namespace fork1s
