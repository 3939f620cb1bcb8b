#include <algorithm>
#include <cmath>

#include "detail.hpp"

namespace fork1s {

// Contact, and with it which servos are at the bounds of their forces and which springs are slack: in each
// round those that change sides come into the solve. None leaves it, so this ends.
void World::Detail::SolveContacts(const StepOptions& options, StepReport& report) {
  const PartClock clock(times_, &StepPartTimes::solving);
  if (switches_.any)
    for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
      switches_.free_velocity[i] = bodies_.free_bodies[i].velocity();
  bool starts = true;
  do {
    if (detection_.points.empty() && rows_.limits.empty() && rows_.closures.empty()) continue;
    AssembleOperators(bodies_, detection_, rows_);
    ApplyPulls(rows_);
    EliminateClosures(rows_);
    if (starts) {
      Rebound(detection_, approaches_, options.h, rows_);
      BoundRecoveryMomentum(bodies_, rows_);
    }
    starts = false;
    report.solver =
        solver_.Solve(rows_.blocks, rows_.contacts, rows_.limits, rows_.velocities, options.contact);
    ComputeClosureImpulses(rows_);
    ApplyImpulses(detection_, closures_, true, bodies_, stops_, rows_);
  } while (switches_.any && UpdateActiveSet(options));
  if (rows_.bounded_forces.empty()) return;
  // The same step again with these forces where they belong: to rounding it is the same velocity, and the
  // rest of the step knows of no such rows.
  SetSidesFound(options.h, bodies_, rows_);
  PredictAllAgain(options.h);
  if (!detection_.points.empty() || !rows_.closures.empty() ||
      rows_.limits.size() > rows_.bounded_forces.size())
    ApplyImpulses(detection_, closures_, false, bodies_, stops_, rows_);
}

bool World::Detail::UpdateActiveSet(const StepOptions& options) {
  bool changed = false;
  for (MechanismDynamics& m : bodies_.mechanisms)
    if (fork1s::UpdateActiveSet(m, options.h)) changed = true;
  if (!changed) return false;
  PredictAllAgain(options.h);
  AddBoundedForceRows(bodies_, options.h, rows_);
  return true;
}

void World::Detail::PredictAllAgain(double h) {
  for (MechanismDynamics& m : bodies_.mechanisms) SolveFreeStage(m, h);
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    bodies_.free_bodies[i].ResetVelocity(switches_.free_velocity[i]);
}

bool World::Detail::PrepareContacts(const StepOptions& options, StepReport& report) {
  if (!stage_.keeps_contacts) {
    const PartClock finding(times_, &StepPartTimes::finding);
    if (!detection_.Find(bodies_, options.h, options.gravity, stage_.within)) return false;
    report.contacts_dropped = detection_.dropped;
  }
  const PartClock clock(times_, &StepPartTimes::rows);
  const bool with_start_velocities = stage_.within && (stage_.is_backward_euler || stage_.rows_from_start);
  AssignPorts(bodies_, detection_, closures_, {options.h, stage_.all_stops, with_start_velocities}, stops_,
              rows_);
  if (!stage_.keeps_contacts) history_.Match(detection_);
  FindPortFrames(bodies_, detection_, rows_);
  AssembleContacts(stage_, options, history_, detection_, approaches_, rows_);
  AssemblePulls(adhesions_, bodies_, detection_, history_, options.h, options.material.depth, rows_);
  AssembleClosures(closures_, bodies_, detection_, rows_);
  AssembleStops(bodies_, stage_, options, stops_, approaches_, rows_);
  return true;
}

// Joints may be out of all proportion and finite, and the poses they lead to not.
bool World::Detail::IsFinite(bool poses) {
  bodies_.ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    finite_[i] = fork1s::IsFinite(m) && IsWithinExpansion(m) && (!poses || PosesAreFinite(m));
  });
  return std::all_of(finite_.begin(), finite_.end(), [](char finite) { return finite != 0; }) &&
         std::all_of(bodies_.free_bodies.begin(), bodies_.free_bodies.end(),
                     [](const auto& b) { return b.IsFinite(); });
}

// The first that the last call of IsFinite found not to be.
StepSubject World::Detail::FindNotFinite() const {
  for (std::size_t i = 0; i < finite_.size(); ++i)
    if (!finite_[i]) return {StepSubject::Kind::kMechanism, static_cast<int>(i), -1};
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    if (!bodies_.free_bodies[i].IsFinite()) return {StepSubject::Kind::kFreeBody, static_cast<int>(i), -1};
  return {};
}

namespace {

// What was meant for one step alone.
void ClearOneShotInputs(WorldState& state) {
  for (MechanismState& m : state.mechanisms) {
    ClearLoads(m);
    m.controls_move = m.knows_driven_rate = false;
  }
  for (FreeBody::State& b : state.free_bodies) b.load = {};
}

}  // namespace

// Goes back to `start`, but for wrenches, which may be what was not finite.
StepReport World::Detail::UndoStep(WorldState& start, StepReport report) {
  ClearOneShotInputs(start);
  Restore(start);
  report.finite = false;
  return report;
}

void World::Detail::BeginStep(double h) {
  Save(halving_.before);
  if (halving_.depth == 0) step_start_ = &halving_.before;
  history_.Store(contacts_, contacts_h_, detection_.poses);
  contacts_h_ = h;
  detection_.ForgetMotion();
  stage_.within = stage_.all_stops = stage_.rows_from_start = stage_.keeps_contacts = false;
}

void World::Watch(StepPartTimes* times) { detail_->times_ = times; }

StepReport World::Step(const StepOptions& options) {
  FORK1S_REQUIRE(options.h > 0 && std::isfinite(options.h), options.h);
  Detail& d = *detail_;
  if (d.times_) *d.times_ = StepPartTimes();
  const PartClock clock(d.times_, &StepPartTimes::all);
  const double share = std::min(1.0, options.newton_tolerance / StepOptions{}.newton_tolerance);
  for (MechanismDynamics& m : d.bodies_.mechanisms)
    m.SetClosingTolerance(std::max(ClosedToRounding(m.mechanism()), share * kClosingTolerance));
  const StepReport report = d.StepByStages(options);
  for (MechanismDynamics& m : d.bodies_.mechanisms) m.StopPointSpring();
  for (FreeBody& body : d.bodies_.free_bodies) body.StopPointSpring();
  return report;
}

// Inputs between two shares of a step of length h that begins at `start`.
void World::Detail::SetInputsOfPart(const WorldState& start, double h, double share_start, double share_end) {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i)
    fork1s::SetInputsOfPart(bodies_.mechanisms[i], start.mechanisms[i], h, share_start, share_end);
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    bodies_.free_bodies[i].SetInputsWithin(start.free_bodies[i], share_start, share_end);
}

const WorldState& World::StartOfLastStep() const {
  FORK1S_REQUIRE(detail_->step_start_, "before the first step");
  return *detail_->step_start_;
}

StepReport World::StepInParts(const WorldState& inputs, const StepOptions& options, int parts) {
  const auto fits = CanRestore(inputs);
  FORK1S_REQUIRE(fits.has_value(), fits ? "" : fits.error().Text());
  FORK1S_REQUIRE(parts >= 1, parts);
  StepOptions part = options;
  part.h = options.h / parts;
  StepReport report;
  report.parts = 0;
  for (int k = 0; k < parts; ++k) {
    detail_->SetInputsOfPart(inputs, options.h, static_cast<double>(k) / parts,
                             static_cast<double>(k + 1) / parts);
    AddReport(Step(part), report);
    if (!report.finite) break;
  }
  return report;
}

}  // namespace fork1s
