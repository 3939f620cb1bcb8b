#include <algorithm>
#include <cmath>

#include "detail.hpp"

namespace fork1s {

// Mechanisms that are worth a thread: some 200 joint coordinates, 30 us.
int World::Detail::WorthAThread() const {
  int coordinates = 0;
  for (const MechanismDynamics& m : mechanisms_) coordinates += 1 + m.mechanism().num_coordinates();
  return coordinates == 0 ? 1 : std::max(1, 200 * static_cast<int>(mechanisms_.size()) / coordinates);
}

void World::Detail::GatherContactImpulses(std::size_t i) {
  const MechanismDynamics& m = mechanisms_[i];
  MechanismBlock& block = mechanism_blocks_[i];
  block.contact_impulses_R.setZero(6, m.mechanism().num_bodies());
  for (std::size_t c = 0; c < contactors_.size(); ++c) {
    const Contactor& contactor = contactors_[c];
    if (contactor.kind != Contactor::Kind::kGroup || contactor.index != static_cast<int>(i) ||
        port_offset_[c] < 0 || !is_pushed_[c])
      continue;
    const PartBlock& part = block.parts[static_cast<std::size_t>(port_part_[c])];
    const BodyIndex body = m.groups()[static_cast<std::size_t>(contactor.group)].body;
    block.contact_impulses_R.col(body.value()) += part.port_impulse.segment<6>(port_offset_[c] - part.offset);
  }
}

void World::Detail::RefreshIfStale(std::size_t i, double h) {
  MechanismDynamics& m = mechanisms_[i];
  MechanismBlock& block = mechanism_blocks_[i];
  block.drift = m.ComputeLinearizationDrift();
  if (!(block.drift.share > 1) && m.model().has_complement) {
    GatherContactImpulses(i);
    block.drift = FindMissingLoad(m, h, block.contact_impulses_R);
  }
  if (!(block.drift.share > 1)) return;
  block.refreshed = m.Refresh() ? 1 : -1;
}

void World::Detail::CountRefreshes(StepReport& report) const {
  for (std::size_t i = 0; i < mechanism_blocks_.size(); ++i) {
    const MechanismBlock& block = mechanism_blocks_[i];
    report.failed_refreshes += block.refreshed < 0 ? 1 : 0;
    if (block.refreshed <= 0) continue;
    const LinearizationDrift& drift = block.drift;
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
    for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_velocity_[i] = free_bodies_[i].velocity();
  bool starts = true;
  do {
    if (points_.empty() && limits_.empty()) continue;
    AssembleOperators();
    if (starts) Rebound(options.h);
    starts = false;
    report.solver = solver_.Solve(blocks_, constraints_, limits_, velocities_, options.contact);
    ApplyImpulses(true);
  } while (has_switches_ && UpdateSwitches(options));
  if (!bounded_forces_.empty()) SolveWithSidesFound(options.h);
}

bool World::Detail::UpdateSwitches(const StepOptions& options) {
  bool changed = false;
  for (MechanismDynamics& m : mechanisms_)
    if (fork1s::UpdateSwitches(m, options.h)) changed = true;
  if (!changed) return false;
  PredictAllAgain(options.h);
  AddBoundedForceRows(options.h);
  return true;
}

void World::Detail::PredictAllAgain(double h) {
  for (MechanismDynamics& m : mechanisms_) SolveFreeStage(m, h);
  for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_bodies_[i].ResetVelocity(free_velocity_[i]);
}

bool World::Detail::PrepareContacts(const StepOptions& options, StepReport& report) {
  if (!FindContacts(options, report)) return false;
  const PartClock clock(times_, &StepPartTimes::rows);
  LayOutPorts(options);
  MatchPrevious();
  AssembleConstraints(options);
  return true;
}

// Joints may be out of all proportion and finite, and the poses they lead to not.
bool World::Detail::IsFinite(bool poses) {
  ForMechanisms([&](std::size_t i) {
    const MechanismDynamics& m = mechanisms_[i];
    const auto& X_RB = m.configuration().kinematics.X_RB;
    mechanism_blocks_[i].finite =
        fork1s::IsFinite(m) && (!poses || std::all_of(X_RB.begin(), X_RB.end(),
                                                      [](const RigidTransform& X) { return X.IsFinite(); }));
  });
  return std::all_of(mechanism_blocks_.begin(), mechanism_blocks_.end(),
                     [](const MechanismBlock& b) { return b.finite; }) &&
         std::all_of(free_bodies_.begin(), free_bodies_.end(), [](const auto& b) { return b.IsFinite(); });
}

// The first that the last call of IsFinite found not to be.
StepSubject World::Detail::FindNotFinite() const {
  for (std::size_t i = 0; i < mechanism_blocks_.size(); ++i)
    if (!mechanism_blocks_[i].finite) return {StepSubject::Kind::kMechanism, static_cast<int>(i), -1};
  for (std::size_t i = 0; i < free_bodies_.size(); ++i)
    if (!free_bodies_[i].IsFinite()) return {StepSubject::Kind::kFreeBody, static_cast<int>(i), -1};
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
  for (MechanismDynamics& m : mechanisms_) m.StopPointSpring();
  for (FreeBody& body : free_bodies_) body.StopPointSpring();
  return report;
}

void World::Detail::BeginStep(double h) {
  Save(before_);
  previous_.swap(contacts_);
  previous_h_ = contacts_h_;
  contacts_h_ = h;
  previous_pose_ = contactor_pose_;
  least_margin_ = 0;
  in_stage_ = all_stops_ = from_stage_start_ = false;
}

void World::Watch(StepPartTimes* times) { detail_->times_ = times; }

StepReport World::Step(const StepOptions& options) { return detail_->Step(options); }

}  // namespace fork1s
