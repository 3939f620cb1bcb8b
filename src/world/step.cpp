#include <algorithm>
#include <cmath>

#include "detail.hpp"

namespace fork1s {

// Mechanisms that are worth a thread: some 200 joint coordinates, 30 us.
int World::Detail::WorthAThread() const {
  int coordinates = 0;
  for (const MechanismDynamics& m : bodies_.mechanisms) coordinates += 1 + m.mechanism().num_coordinates();
  return coordinates == 0 ? 1 : std::max(1, 200 * static_cast<int>(bodies_.mechanisms.size()) / coordinates);
}

void World::Detail::GatherContactImpulses(std::size_t i) {
  const MechanismDynamics& m = bodies_.mechanisms[i];
  Refresh& refresh = refreshes_[i];
  refresh.contact_impulses_R.setZero(6, m.mechanism().num_bodies());
  for (std::size_t c = 0; c < detection_.contactors.size(); ++c) {
    const Contactor& contactor = detection_.contactors[c];
    if (contactor.kind != Contactor::Kind::kGroup || contactor.index != static_cast<int>(i) ||
        rows_.port_offset[c] < 0 || !rows_.is_pushed[c])
      continue;
    const PartRows& part = rows_.mechanisms[i].parts[static_cast<std::size_t>(rows_.port_part[c])];
    const BodyIndex body = m.groups()[static_cast<std::size_t>(contactor.group)].body;
    refresh.contact_impulses_R.col(body.value()) +=
        part.impulse.segment<6>(rows_.port_offset[c] - part.offset);
  }
}

void World::Detail::RefreshIfStale(std::size_t i, double h) {
  MechanismDynamics& m = bodies_.mechanisms[i];
  Refresh& refresh = refreshes_[i];
  refresh.drift = m.ComputeLinearizationDrift();
  if (!(refresh.drift.share > 1) && m.model().has_complement) {
    GatherContactImpulses(i);
    refresh.drift = FindMissingLoad(m, h, refresh.contact_impulses_R);
  }
  if (!(refresh.drift.share > 1)) return;
  refresh.result = m.Refresh() ? 1 : -1;
}

void World::Detail::CountRefreshes(StepReport& report) const {
  for (std::size_t i = 0; i < refreshes_.size(); ++i) {
    const Refresh& refresh = refreshes_[i];
    report.failed_refreshes += refresh.result < 0 ? 1 : 0;
    if (refresh.result <= 0) continue;
    const LinearizationDrift& drift = refresh.drift;
    ++report.refreshes;
    Relinearizations& of_cause = report.refreshes_by_cause[static_cast<std::size_t>(drift.cause)];
    ++of_cause.count;
    if (!(drift.share > of_cause.largest.share)) continue;
    of_cause.largest = drift;
    of_cause.of = {drift.coordinate < 0 ? StepSubject::Kind::kMechanism : StepSubject::Kind::kCoordinate,
                   static_cast<int>(i), drift.coordinate};
  }
}

// Contact, and with it which servos are at the bounds of their forces and which springs are slack: in each
// round those that change sides come into the solve. None leaves it, so this ends.
void World::Detail::SolveContacts(const StepOptions& options, StepReport& report) {
  const PartClock clock(times_, &StepPartTimes::solving);
  if (has_switches_)
    for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
      free_velocity_[i] = bodies_.free_bodies[i].velocity();
  bool starts = true;
  do {
    if (detection_.points.empty() && rows_.limits.empty()) continue;
    AssembleOperators(bodies_, detection_, rows_);
    if (starts) Rebound(options.h);
    starts = false;
    report.solver =
        solver_.Solve(rows_.blocks, rows_.contacts, rows_.limits, rows_.velocities, options.contact);
    ApplyImpulses(detection_, true, bodies_, stops_, rows_);
  } while (has_switches_ && UpdateSwitches(options));
  if (!rows_.bounded_forces.empty()) SolveWithSidesFound(options.h);
}

bool World::Detail::UpdateSwitches(const StepOptions& options) {
  bool changed = false;
  for (MechanismDynamics& m : bodies_.mechanisms)
    if (fork1s::UpdateSwitches(m, options.h)) changed = true;
  if (!changed) return false;
  PredictAllAgain(options.h);
  AddBoundedForceRows(options.h);
  return true;
}

void World::Detail::PredictAllAgain(double h) {
  for (MechanismDynamics& m : bodies_.mechanisms) SolveFreeStage(m, h);
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    bodies_.free_bodies[i].ResetVelocity(free_velocity_[i]);
}

bool World::Detail::PrepareContacts(const StepOptions& options, StepReport& report) {
  {
    const PartClock finding(times_, &StepPartTimes::finding);
    if (!detection_.Find(bodies_, options.h, options.gravity, in_stage_)) return false;
    report.contacts_dropped = detection_.dropped;
  }
  const PartClock clock(times_, &StepPartTimes::rows);
  const bool with_start_velocities = in_stage_ && (is_backward_euler_ || from_stage_start_);
  LayOutPorts(bodies_, detection_, {options.h, all_stops_, with_start_velocities}, stops_, rows_);
  history_.Match(detection_);
  AssembleConstraints(options);
  return true;
}

// Joints may be out of all proportion and finite, and the poses they lead to not.
bool World::Detail::IsFinite(bool poses) {
  bodies_.ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    const auto& X_RB = m.configuration().kinematics.X_RB;
    finite_[i] =
        fork1s::IsFinite(m) && (!poses || std::all_of(X_RB.begin(), X_RB.end(),
                                                      [](const RigidTransform& X) { return X.IsFinite(); }));
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

// What was meant for one step alone.
void World::Detail::ForgetInputs(WorldState& state) {
  for (MechanismState& m : state.mechanisms) {
    ClearLoads(m);
    m.controls_move = m.knows_driven_rate = false;
  }
  for (FreeBody::State& b : state.free_bodies) b.load = {};
}

// Goes back to `start`, but for wrenches, which may be what was not finite.
StepReport World::Detail::UndoStep(WorldState& start, StepReport report) {
  ForgetInputs(start);
  Restore(start);
  report.finite = false;
  return report;
}

StepReport World::Detail::Step(const StepOptions& options) {
  FORK1S_REQUIRE(options.h > 0 && std::isfinite(options.h), options.h);
  if (times_) *times_ = StepPartTimes();
  const PartClock clock(times_, &StepPartTimes::all);
  const StepReport report = StepByStages(options);
  for (MechanismDynamics& m : bodies_.mechanisms) m.StopPointSpring();
  for (FreeBody& body : bodies_.free_bodies) body.StopPointSpring();
  return report;
}

void World::Detail::BeginStep(double h) {
  Save(before_);
  history_.Take(contacts_, contacts_h_, detection_.poses);
  contacts_h_ = h;
  detection_.least_margin = 0;
  in_stage_ = all_stops_ = from_stage_start_ = false;
}

void World::Watch(StepPartTimes* times) { detail_->times_ = times; }

StepReport World::Step(const StepOptions& options) { return detail_->Step(options); }

}  // namespace fork1s
