// A step of two implicit stages (implicit_stage.cpp): Alexander's SDIRK2.
//
// Each stage is solved by Newton iteration with the contact solve inside: contacts are found, and forces evaluated, at
// the pose that the velocity at hand leads to, first an extrapolated one; the velocity found leads to another pose,
// and where the equation of the stage has a residual there, the iteration goes on from it.
//
// A step that contains an impact is taken as two of half the length, and so on; the shortest is one of implicit Euler:
// extrapolated, the velocity that the first stage stopped would come back.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "world_detail.hpp"

namespace fork1s {
namespace {

constexpr double kStageShare = 1 - 1 / std::numbers::sqrt2;            // γ
constexpr double kOnward = (1 - kStageShare) / kStageShare;            // s
constexpr int kMaxIterations = 20;                                     // of Newton's method, per stage
// A stage is solved where another iteration would change poses by less than this share of the stage's motion
// (docs/decisions/001-time-stepping.md, Newton variants f and h), or of a mechanism's length.
constexpr double kRelativeTolerance = 1e-4, kLengthTolerance = 1e-8;

}  // namespace

bool World::Detail::UsesTwoStages(const StepOptions& options) const {
  return options.integrator == Integrator::kTwoStage &&
         std::all_of(mechanisms_.begin(), mechanisms_.end(),
                     [](const auto& m) { return m.recovery() != Recovery::kTwist; });
}

StepReport World::Detail::TwoStageStep(const StepOptions& options) {
  StepReport report;
  const double h = options.h, b = kStageShare * h;
  StartOfStep();
  if (depth_ == 0) {
    impact_speed_ = ImpactSpeedOf(options);
    ClearSums();
  }
  halvings_[static_cast<std::size_t>(depth_)].sums = sums_;
  PrepareContacts(options, report);
  if (ClosesAtSpeed(options)) return StepInHalves(options);
  {
    const PartClock clock(times_, &StepPartTimes::moving);
    ForMechanisms([&](std::size_t i) { BeginTwoStageStep(mechanisms_[i], h, options.gravity); });
    for (FreeBody& body : free_bodies_) body.BeginTwoStageStep(options.gravity);
  }
  for (const bool second : {false, true}) {
    switch (SolveStage(options, second, report)) {
      case StageOutcome::kImpact: return StepInHalves(options);
      case StageOutcome::kNotFinite: return UndoStep(before_, report);
      case StageOutcome::kDone: break;
    }
    StoreStage(b, second, report);
    if (second) break;
    for (MechanismDynamics& m : mechanisms_) ExtrapolateStage(m, b, kOnward);
    for (FreeBody& body : free_bodies_) body.ExtrapolateStage(b, kOnward);
    previous_.swap(contacts_);
    previous_h_ = b;
    previous_pose_ = contactor_pose_;
    previous_speed_W_.swap(speed_W_);
    previous_missed_W_.swap(missed_W_);
  }
  ForMechanisms([&](std::size_t i) { EndTwoStageStep(mechanisms_[i]); });
  for (FreeBody& body : free_bodies_) body.EndTwoStageStep();
  if (depth_ == 0) return FinishTwoStageStep(options, before_, report);
  return IsFinite(true) ? report : UndoStep(before_, report);
}

// What follows the last stage; `start` is where the step is undone to if it is not finite.
StepReport World::Detail::FinishTwoStageStep(const StepOptions& options, WorldState& start, StepReport report) {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i)
    StoreBaseHistory(mechanisms_[i], start.mechanisms[i], options.h);
  TellSums();
  contacts_h_ = options.h;
  report.contacts = static_cast<int>(
      std::count_if(contacts_.begin(), contacts_.end(), [](const auto& c) { return c.impulse(0) > 0; }));
  report.forces_at_bound = 0;
  for (const MechanismDynamics& m : mechanisms_) {
    report.forces_at_bound += m.NumForcesAtBound();
    report.loop_residual = std::max(report.loop_residual, m.configuration().loop_residual);
  }
  report.minimum_found = report.stages_converged;
  curvature_valid_ = false;
  rule_ = StepRule::kEuler;
  if (options.refresh) {
    const PartClock clock(times_, &StepPartTimes::refreshing);
    ForMechanisms([&](std::size_t i) {
      mechanism_blocks_[i].refreshed = 0;
      RefreshIfStale(i);
    });
    CountRefreshes(report);
  }
  return IsFinite(true) ? report : UndoStep(start, report);
}

void World::Detail::MoveAllToStagePoses(double b, double time) {
  const PartClock clock(times_, &StepPartTimes::moving);
  ForMechanisms([&](std::size_t i) { MoveToStagePose(mechanisms_[i], b, time); });
  for (FreeBody& body : free_bodies_) body.MoveToStagePose(b);
}

World::Detail::StageOutcome World::Detail::SolveStage(const StepOptions& options, bool second, StepReport& report) {
  StepOptions stage = options;
  stage.h = kStageShare * options.h;
  const double share = second ? 1 : kStageShare, time = share * options.h;
  rule_ = StepRule::kStage;
  for (std::size_t i = 0; i < mechanisms_.size(); ++i)
    SetInputsWithin(mechanisms_[i], before_.mechanisms[i], share);
  MoveAllToStagePoses(stage.h, time);
  for (int iteration = 1;; ++iteration) {
    ++report.stage_iterations;
    PrepareContacts(stage, report);
    {
      const PartClock clock(times_, &StepPartTimes::free_velocities);
      ForMechanisms([&](std::size_t i) { PredictStage(mechanisms_[i], stage.h); });
      FindTouchedBodies();
      for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_bodies_[i].PredictStage(stage.h, touched_[i] != 0);
    }
    const ContactSolverReport before = report.solver;
    SolveContacts(stage, report);
    KeepWorst(before, report.solver);
    if (!IsFinite(false)) return StageOutcome::kNotFinite;
    // At the first iteration rows still know the velocity that the stage starts with.
    if (iteration == 1 && MetAtSpeed(options)) return StageOutcome::kImpact;
    if (second && LeavesAtSpeed()) return StageOutcome::kImpact;
    if (MoveAndCheckResiduals(stage.h, time, report)) return StageOutcome::kDone;
    if (!IsFinite(true)) return StageOutcome::kNotFinite;
    if (iteration == kMaxIterations) {
      report.stages_converged = false;
      return StageOutcome::kDone;
    }
  }
}

// Moves everything to the pose found; true where every equation is solved there.
bool World::Detail::MoveAndCheckResiduals(double b, double time, StepReport& report) {
  const PartClock clock(times_, &StepPartTimes::moving);
  bool solved = true;
  double largest = 0;
  const auto check = [&](double residual, double motion, double length) {
    largest = std::max(largest, residual);
    solved = solved && residual <= kRelativeTolerance * motion + kLengthTolerance * length;
  };
  for (MechanismDynamics& m : mechanisms_) {
    double motion = 0;
    const double residual = MoveAndComputeResidual(m, b, time, motion);
    check(residual, motion, m.mechanism().length_scale());
  }
  for (FreeBody& body : free_bodies_) {
    double motion = 0;
    const double residual = body.MoveAndComputeResidual(b, motion);
    check(residual, motion, std::sqrt(body.inertia().rotational.trace() / body.inertia().mass));
  }
  if (solved) report.stage_residual = std::max(report.stage_residual, largest);
  return solved;
}

// Whether what the first stage stopped leaves again in the second at the speed of an impact.
bool World::Detail::LeavesAtSpeed() const {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const int before = match_[i];
    if (before < 0 || !previous_fresh_[static_cast<std::size_t>(before)] || constraints_[i].impulse(0) > 0) continue;
    if (RelativeSpeed(constraints_[i], velocities_)(0) > impact_speed_) return true;
  }
  return false;
}

// Contacts of a stage that was solved: what the next one starts from, and their share of the impulses of the step.
void World::Detail::StoreStage(double b, bool second, StepReport& report) {
  fresh_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) fresh_[i] = constraints_[i].impulse(0) > 0 && !Bore(i);
  previous_fresh_ = fresh_;
  StepReport stage;
  KeepForNextStep(b, stage);
  report.limits = std::max(report.limits, stage.limits);
  report.max_penetration = std::max(report.max_penetration, stage.max_penetration);
  // (1 - γ) f₁ + γ f₂ over the step, impulses being b f: s of the first and one of the second.
  SumImpulses(second ? 1 : kOnward);
  if (second) return;
  // The second stage starts where tangential springs are at its base point.
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const ContactConstraint& c = constraints_[i];
    contacts_[i].end_force.tail<2>() += (kOnward - 1) / b * (c.impulse - c.held).tail<2>();
    contacts_[i].end_moment += (kOnward - 1) / b * (c.moment - c.held_moment);
  }
}

// The step from its start again, by two of half the length, the shortest by implicit Euler.
StepReport World::Detail::StepInHalves(const StepOptions& options) {
  Halving& whole = halvings_[static_cast<std::size_t>(depth_)];
  whole.start = before_;
  sums_ = whole.sums;
  Restore(whole.start);
  StepOptions half = options;
  half.h = 0.5 * options.h;
  half.refresh = false;
  StepReport report;
  report.parts = 0;
  for (int k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < mechanisms_.size(); ++i)
      SetInputsOfHalf(mechanisms_[i], whole.start.mechanisms[i], options.h, k == 1);
    for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_bodies_[i].SetWrench(whole.start.free_bodies[i]);
    ++depth_;
    const bool shortest = depth_ == kMostHalvings;
    half.integrator = shortest ? Integrator::kEuler : Integrator::kTwoStage;
    in_parts_ = shortest;
    const StepReport part = TakeStep(half);
    in_parts_ = false;
    --depth_;
    two_stage_ = true;
    AddReport(part, report);
    if (!part.finite) return UndoStep(whole.start, report);
    if (shortest) SumImpulses();
  }
  report.impact = true;
  return depth_ > 0 ? report : FinishTwoStageStep(options, whole.start, report);
}

}  // namespace fork1s
