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
// accepted unless it is solved; where the shortest part is not, it is solved with artificial damping and
// reported, and where that is not solved either, the step is undone. Where shortest parts have led one shape
// through another they are accepted and reported.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "detail.hpp"
#include "step_report.hpp"

namespace fork1s {
namespace {

// A stage that takes more Newton iterations, or whose residual grows more often, diverges or cycles: it is
// halved; one of backward Euler, which falls back to no better scheme, first tries as often as that with
// the geometric stiffness of inertia in its matrix (RenewStageMatrix).
constexpr int kMaxNewtonIterations = 10, kMaxResidualGrowths = 1;
// Points come and go, and normals jump, with poses that differ by rounding or little more: where an edge lies flat, at
// facets of meshes. The equation jumps there, and iterations swing between its sides. Where residuals are small
// (StageResidual) after as many iterations, where most stages take three or fewer, contacts stay as they are,
// each with its plane, until a residual is as many times what is negligible: 1e-4 of the length, by whose square, which is
// negligible again, the planes of surfaces as curved as the body is long are off.
constexpr int kIterationsWithDetection = 4;
constexpr double kReleasedContacts = 1e4;
// A shortest part that cannot be solved is solved with artificial damping: reduced velocities are damped by the
// first of these times their inertia over the length of the part that makes it solvable. A floating mechanism
// keeps its momentum, energy is lost, and the part is reported. Where its iteration stagnates or takes more than
// kIterationsWithDetection, it is accepted with a residual of kMaxDampedResidual times what is negligible, a
// hundredth of the motion and 1e-4 of the length.
constexpr double kArtificialDamping[] = {1e2, 1e4, 1e6}, kMaxDampedResidual = 1e4;

}  // namespace

StepReport World::Detail::StepByStages(const StepOptions& options) {
  StepReport report;
  const double h = options.h;
  BeginStep(h);
  stage_.is_backward_euler = options.integrator == Integrator::kEuler || halving_.depth >= kMaxEventHalvings;
  const double b = stage_.is_backward_euler ? h : kStageShare * h;
  if (halving_.depth == 0) {
    stage_.artificial_damping = 0;
    approaches_.SetSpeeds(options);
    halving_.predicted = {};
    sums_.Clear(bodies_.mechanisms.size(), closures_.size());
  }
  StartSwitchedClosures(bodies_, detection_, h, closures_);
  halving_.levels[static_cast<std::size_t>(halving_.depth)].sums = sums_;
  RecordStops(bodies_, stage_, approaches_.impact_speed, stops_);
  history_.StartStep();
  // Of backward Euler those of the last step, which were found where it ended.
  if (halving_.depth == 0 && stage_.is_backward_euler) start_points_ = detection_.points;
  if (!stage_.is_backward_euler) {
    if (const SwitchedClosure* of =
            FindClosureImpact(closures_, bodies_, detection_, approaches_.impact_speed)) {
      report.halving_of = {StepSubject::Kind::kMechanism, static_cast<int>(of->mechanism), -1};
      return HalveOrUndo(options, HalvingCause::kImpact, report);
    }
    // The first part of a step that was halved starts with what the whole foresaw.
    if (!(halving_.predicted.time < h)) {
      PrepareContacts(options, report);
      if (halving_.depth == 0) start_points_ = detection_.points;
      history_.RecordStartGaps(detection_.points, approaches_.carried_speed);
      halving_.predicted = FindPredictedImpact(Impacts());
    }
    if (halving_.predicted.time < h) {
      report.halving_of = halving_.predicted.of;
      return HalveOrUndo(options, HalvingCause::kImpact, report);
    }
  }
  {
    const PartClock clock(times_, &StepPartTimes::moving);
    bodies_.ForMechanisms([&](std::size_t i) {
      fork1s::BeginStep(bodies_.mechanisms[i], h, b, stage_.is_backward_euler, options.gravity);
      SetArtificialDamping(bodies_.mechanisms[i], DampingOf(i));
    });
    for (FreeBody& body : bodies_.free_bodies) body.BeginStep(b, options.gravity);
    RecordStageStart(true);
  }
  for (StageScheme scheme = stage_.is_backward_euler ? StageScheme::kBackwardEuler : StageScheme::kFirstOfTwo;
       ; scheme = StageScheme::kSecondOfTwo) {
    if (const HalvingCause cause = SolveStage(options, scheme, report); cause != HalvingCause::kNone)
      return HalveOrUndo(options, cause, report);
    StoreStage(b, scheme, report);
    if (scheme != StageScheme::kFirstOfTwo) break;
    RecordStageStart(false);
    for (MechanismDynamics& m : bodies_.mechanisms) ExtrapolateStage(m, b, kOnward);
    for (FreeBody& body : bodies_.free_bodies) body.ExtrapolateStage(b, kOnward);
    history_.CarryStartGaps();
    history_.Store(contacts_, b, detection_.poses);
  }
  const double between_stages = stage_.is_backward_euler ? 0 : h - b;
  bodies_.ForMechanisms([&](std::size_t i) { fork1s::EndStep(bodies_.mechanisms[i], between_stages); });
  for (FreeBody& body : bodies_.free_bodies) body.EndStep(between_stages);
  if (halving_.depth == 0) return FinishStep(options, halving_.before, report);
  bodies_.ForMechanisms([&](std::size_t i) { DropExpansionIfFar(bodies_.mechanisms[i]); });
  return IsFinite(true) ? report : UndoStep(halving_.before, report);
}

double World::Detail::DampingOf(std::size_t mechanism) const {
  const bool is_damped = !stage_.damped_mechanism || *stage_.damped_mechanism == static_cast<int>(mechanism);
  return is_damped ? stage_.artificial_damping : 0;
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
  RecordClosures(closures_, bodies_, detection_, sums_.closures, closure_records_);
  contacts_h_ = options.h;
  report.contacts = static_cast<int>(
      std::count_if(contacts_.begin(), contacts_.end(), [](const auto& c) { return c.impulse(0) > 0; }));
  report.forces_at_bound = 0;
  for (const MechanismDynamics& m : bodies_.mechanisms) {
    report.forces_at_bound += m.NumForcesAtBound();
    report.loop_residual = std::max(report.loop_residual, LoopResidualNow(m));
  }
  stage_.within = false;
  {
    const PartClock clock(times_, &StepPartTimes::refreshing);
    bodies_.ForMechanisms([&](std::size_t i) {
      MechanismDynamics& m = bodies_.mechanisms[i];
      if (options.refresh)
        RefreshIfStale(i, options.h, detection_, rows_, m, refreshes_[i]);
      else
        ExpandIfFar(options.h, m, refreshes_[i]);
    });
  }
  CountRefreshes(refreshes_, report);
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
  stage_.within = true;
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    SetInputsWithin(bodies_.mechanisms[i], halving_.before.mechanisms[i], share);
    AdvanceActivations(bodies_.mechanisms[i], halving_.before.mechanisms[i], share, options.h);
  }
  if (scheme == StageScheme::kFirstOfTwo)
    bodies_.ForMechanisms([&](std::size_t i) {
      ReduceControlJumps(bodies_.mechanisms[i], halving_.before.mechanisms[i], stage.h, kOnward);
    });
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    bodies_.free_bodies[i].SetInputsWithin(halving_.before.free_bodies[i], 0, share);
  MoveAllToStagePoses(stage.h, time);
  ++report.stages;
  detection_.ForgetMotion();
  stage_.all_stops = stage_.rows_from_start = stage_.keeps_contacts = false;
  StartStops(history_.TimeStepRatio(stage.h), stops_);
  const ContactSolverReport of_stages_before = report.solver;
  StageResidual last;
  StepSubject passed;    // by the contacts found last
  double passed_by = 0;  // m
  int growths = 0, max_iterations = kMaxNewtonIterations;
  bool inertial = false, has_kept_contacts = false;
  bool is_fresh = scheme != StageScheme::kSecondOfTwo;
  for (int iteration = 1;; ++iteration) {
    ++report.stage_iterations;
    report.max_stage_iterations = std::max(report.max_stage_iterations, iteration);
    if (!stage_.rows_from_start && !PrepareContacts(stage, report)) break;
    if ((stage_.rows_from_start || (iteration == 1 && MayHavePassed(stage.h))) &&
        !PrepareContactsAtStageStart(stage, report))
      break;
    {
      const PartClock clock(times_, &StepPartTimes::free_velocities);
      bodies_.ForMechanisms([&](std::size_t i) { SolveFreeStage(bodies_.mechanisms[i], stage.h); });
      detection_.FindTouched(bodies_.free_bodies.size());
      for (const SwitchedClosure& closure : closures_)
        for (const int side : {closure.a, closure.b})
          if (const CollisionBody& c = detection_.collision_bodies[static_cast<std::size_t>(side)];
              closure.acts && c.kind == CollisionBody::Kind::kFreeBody)
            detection_.touched[static_cast<std::size_t>(c.index)] = 1;
      for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
        bodies_.free_bodies[i].PredictStage(stage.h, detection_.touched[i] != 0);
    }
    // Whether contact was solved counts where the stage ends alone.
    const ContactSolverReport of_iterations = iteration == 1 ? ContactSolverReport() : report.solver;
    report.solver = ContactSolverReport();
    SolveContacts(stage, report);
    report.solver.newton_iterations =
        std::max(report.solver.newton_iterations, of_iterations.newton_iterations);
    report.solver.fallback = std::max(report.solver.fallback, of_iterations.fallback);
    if (!IsFinite(false)) break;
    if (const HalvingCause event = FindStageEvent(options, scheme, iteration, report);
        event != HalvingCause::kNone)
      return event;
    if (!stage_.keeps_contacts) {
      passed = stage_.rows_from_start ? StepSubject() : FindTunnelling(Impacts());
      if (passed.kind != StepSubject::Kind::kNone)
        passed_by = detection_.PairMotion(passed.index, passed.part);
    }
    const StageResidual found = [&] {
      const PartClock clock(times_, &StepPartTimes::moving);
      // An iteration with the contacts of the stage's start is never the last. Of forces that changed sides
      // in the solve the contraction of other iterations says nothing.
      const bool may_accept = !stage_.rows_from_start && rows_.bounded_forces.empty();
      return MoveAndComputeResiduals(
          {scheme, stage.h, time, options.newton_tolerance, iteration == 1, may_accept,
           !stage_.rows_from_start, inertial || stage_.artificial_damping > 0},
          bodies_, newton_);
    }();
    if (!IsFinite(true)) break;
    const bool from_start = stage_.rows_from_start;
    stage_.rows_from_start = !CoversMotion();
    if (stage_.rows_from_start) {
      stage_.keeps_contacts = false;
      if (iteration == max_iterations || !detection_.IsWidthFinite()) break;
      continue;
    }
    const bool stagnates = iteration > 1 && !(found.ratio < last.ratio),
               is_slow_end = iteration > 1 && found.is_slow &&
                             found.negligible <= options.newton_tolerance / StepOptions{}.newton_tolerance,
               is_accepted = is_slow_end || (stagnates && found.negligible <= 1);
    // By a matrix of another pose a growth says nothing of the equation.
    growths += iteration > 1 && is_fresh && !(found.ratio < last.ratio) ? 1 : 0;
    last = found;
    if (stage_.keeps_contacts && found.negligible > kReleasedContacts) stage_.keeps_contacts = false;
    if (!has_kept_contacts && iteration >= kIterationsWithDetection && found.is_small) {
      stage_.keeps_contacts = has_kept_contacts = true;
      growths = 0;
      max_iterations = std::max(max_iterations, iteration + kMaxNewtonIterations);
    }
    const bool is_usable = stage_.artificial_damping > 0 && found.negligible <= kMaxDampedResidual &&
                           (stagnates || iteration > kIterationsWithDetection);
    bool ends =
        iteration == max_iterations || (growths > kMaxResidualGrowths && stage_.artificial_damping == 0);
    const bool begins_inertial =
        ends && scheme == StageScheme::kBackwardEuler && !inertial && found.ratio > 1;
    if (begins_inertial) {
      inertial = true;
      ends = false;
      growths = 0;
      max_iterations = iteration + 2 * kMaxNewtonIterations;
    }
    if (!from_start && (found.ratio <= 1 || is_accepted || is_usable || (ends && found.is_small))) {
      if (!report.solver.converged && halving_.depth < kMaxHalvings) break;
      MergeSolverReport(of_stages_before, report.solver);
      const bool has_passed = passed.kind != StepSubject::Kind::kNone;
      if (has_passed && halving_.depth < kMaxHalvings) {
        report.halving_of = passed;
        return HalvingCause::kImpact;
      }
      if (has_passed || (found.ratio > 1 && found.negligible > 1)) report.stages_converged = false;
      if (found.largest > report.stage_residual) {
        report.stage_residual = found.largest;
        report.stage_residual_of = found.subject;
      }
      // Without damping the joints would move on by about as much.
      for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
        if (const double damping = DampingOf(i),
            held = damping > 0 ? damping * JointDisplacement(bodies_.mechanisms[i], stage.h) : 0;
            held > report.stage_residual) {
          report.stage_residual = held;
          report.stage_residual_of = {StepSubject::Kind::kMechanism, static_cast<int>(i), -1};
        }
      // The side on which the body ends is uncertain, and its place by its motion in the stage.
      if (has_passed) {
        report.stage_residual = std::max(report.stage_residual, passed_by);
        report.stage_residual_of = passed;
      }
      if (scheme == StageScheme::kSecondOfTwo) report.halving_of = FindSaturationChange(bodies_, stage.h);
      return report.halving_of.kind == StepSubject::Kind::kNone ? HalvingCause::kNone
                                                                : HalvingCause::kSaturation;
    }
    if (ends) break;
    RelaxSwinging(stage.h, time, bodies_, newton_);
    is_fresh = found.is_slow || begins_inertial;
    if (!is_fresh) continue;
    // What is compressed by its weight buckles; the last resort goes without.
    const GeometricStiffness of_parts = inertial ? GeometricStiffness::kOfWeightAndInertia
                                        : scheme == StageScheme::kBackwardEuler ? GeometricStiffness::kNone
                                        : found.is_small ? GeometricStiffness::kOfWeightAndTension
                                                         : GeometricStiffness::kOfWeight;
    bodies_.ForMechanisms([&](std::size_t i) { RenewStageMatrix(bodies_.mechanisms[i], of_parts); });
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
  if (iteration == 1 || stage_.rows_from_start) report.halving_of = FindImpact(at, options.h);
  const auto none = [&] { return report.halving_of.kind == StepSubject::Kind::kNone; };
  if (scheme == StageScheme::kSecondOfTwo) {
    if (none()) report.halving_of = FindBeyondAtBasePoint(at, options.h, stage_.rows_from_start);
    if (none()) report.halving_of = FindParting(at, stops_);
  }
  return none() ? HalvingCause::kNone : HalvingCause::kImpact;
}

// Contacts as the stage at hand, of length h, solved them.
void World::Detail::RecordContacts(double h) {
  contacts_.resize(detection_.points.size());
  ForContacts(detection_, [&](std::size_t i) {
    const ContactConstraint& c = rows_.contacts[i];
    contacts_[i].point = detection_.points[i];
    contacts_[i].impulse = c.impulse;
    contacts_[i].pull = Vector3(-rows_.PullOf(i), 0, 0);
    contacts_[i].friction = c.FrictionAlong(c.impulse.tail<2>());
    contacts_[i].moment = c.moment;
    contacts_[i].utilization = c.utilization;
    contacts_[i].gives_way = c.gives_way;
    contacts_[i].end_force = c.impulse / h;
    contacts_[i].end_moment = c.moment / h;
    contacts_[i].end_speed = RelativeSpeed(c, rows_.velocities)(0);
  });
}

void World::Detail::SumImpulses(double weight) {
  summation_.Add(weight, contacts_, history_.match, history_.contacts, sums_);
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
    sums_.AddRows(weight, i, stops_[i].impulses, stops_[i].friction_impulses);
  SumClosureImpulses(weight, rows_, sums_.closures);
}

// Contacts of a stage that was solved: what the next one starts from, and their share of the impulses of the step.
void World::Detail::StoreStage(double b, StageScheme scheme, StepReport& report) {
  history_.is_fresh.resize(detection_.points.size());
  for (std::size_t i = 0; i < detection_.points.size(); ++i)
    history_.is_fresh[i] =
        rows_.contacts[i].impulse(0) > 0 &&
        !history_.CarriedAtRest(i, kPartingRate * detection_.shapes.PairSize(detection_.points[i]));
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
    if (HasComplementarity(m)) StoreActiveSetForces(m, b);
  // The second stage starts where tangential springs are at its base point.
  history_.to_base_point.resize(contacts_.size());
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const ContactConstraint& c = rows_.contacts[i];
    history_.to_base_point[i].head<3>() = (kOnward - 1) / b * (c.moment - c.previous_moment);
    history_.to_base_point[i].tail<3>() = (kOnward - 1) / b * (c.impulse - c.previous_impulse);
    history_.to_base_point[i](3) = 0;  // the normal force has no spring
  }
}

// The step from its start again, by two of half the length, or undone where even the shortest part is not solved.
StepReport World::Detail::HalveOrUndo(const StepOptions& options, HalvingCause cause,
                                      const StepReport& attempt) {
  StepReport report;
  report.stages = attempt.stages;
  report.stage_iterations = attempt.stage_iterations;
  report.max_stage_iterations = attempt.max_stage_iterations;
  report.halving_of = attempt.halving_of;
  Halving::Level& whole = halving_.levels[static_cast<std::size_t>(halving_.depth)];
  if (halving_.depth == kMaxHalvings) {
    report.stages_converged = false;
    if (stage_.artificial_damping > 0) return UndoStep(halving_.before, report);
    stage_.damped_mechanism.reset();
    if (attempt.halving_of.kind == StepSubject::Kind::kMechanism)
      stage_.damped_mechanism = attempt.halving_of.index;
    StepReport part;
    whole.start = halving_.before;  // which an attempt that fails clears the inputs of
    for (const double damping : kArtificialDamping) {
      report.parts = 0;
      sums_ = whole.sums;
      Restore(whole.start);
      stage_.artificial_damping = damping;
      part = StepByStages(options);
      stage_.artificial_damping = 0;
      if (part.finite) break;
    }
    AddReport(part, report);
    if (report.halving_of.kind == StepSubject::Kind::kNone) report.halving_of = attempt.halving_of;
    return report;
  }
  whole.start = halving_.before;
  if (halving_.depth == 0) step_start_ = &whole.start;
  sums_ = whole.sums;
  if (attempt.stages > 0)
    Restore(whole.start);
  else
    RestoreContacts(whole.start);
  StepOptions half = options;
  half.h = 0.5 * options.h;
  half.refresh = false;
  report.parts = 0;
  report.impact = cause == HalvingCause::kImpact;
  for (int k = 0; k < 2; ++k) {
    SetInputsOfPart(whole.start, options.h, 0.5 * k, 0.5 * (k + 1));
    if (k > 0) halving_.predicted = {};
    ++halving_.depth;
    const StepReport part = StepByStages(half);
    --halving_.depth;
    AddReport(part, report);
    if (!part.finite) return UndoStep(whole.start, report);
  }
  report.halving = cause;
  report.halving_of = attempt.halving_of;
  return halving_.depth > 0 ? report : FinishStep(options, whole.start, report);
}

}  // namespace fork1s
