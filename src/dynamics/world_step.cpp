#include <algorithm>
#include <cmath>

#include <fork1s/dynamics/point_response.hpp>

#include "world_detail.hpp"

namespace fork1s {

// Mechanisms that are worth a thread: some 200 joint coordinates, 30 us.
int World::Detail::WorthAThread() const {
  int coordinates = 0;
  for (const MechanismDynamics& m : mechanisms_) coordinates += 1 + m.mechanism().num_coordinates();
  return coordinates == 0 ? 1 : std::max(1, 200 * static_cast<int>(mechanisms_.size()) / coordinates);
}

// Mechanisms move and are refreshed in one loop: its time goes to either as that of its mechanisms does.
void World::Detail::ShareRefreshes(double moving_before) {
  double moved = 0, refreshed = 0;
  for (const MechanismBlock& block : mechanism_blocks_) {
    moved += block.own.moving;
    refreshed += block.own.refreshing;
  }
  if (!(refreshed > 0)) return;
  times_->refreshing += (times_->moving - moving_before) * refreshed / (moved + refreshed);
  times_->moving -= times_->refreshing;
}

void World::Detail::MoveMechanisms(const StepOptions& options, StepReport& report) {
  const double moving_before = times_ ? times_->moving : 0;
  PartClock clock(times_, &StepPartTimes::moving);
  ForMechanisms([&](std::size_t i) {
    MechanismDynamics& m = mechanisms_[i];
    MechanismBlock& block = mechanism_blocks_[i];
    block.own = StepPartTimes();
    {
      const PartClock own(times_ ? &block.own : nullptr, &StepPartTimes::moving);
      m.Integrate(options.h);
    }
    block.refreshed = 0;
    if (options.refresh) RefreshIfStale(i);
  });
  for (FreeBody& b : free_bodies_) b.Integrate(options.h);
  clock.Stop();
  if (times_) ShareRefreshes(moving_before);
  for (const MechanismDynamics& m : mechanisms_) {
    report.newton_steps = std::max(report.newton_steps, NewtonSteps(m));
    report.minimum_found = report.minimum_found && FoundMinimum(m);
  }
  CountRefreshes(report);
}

void World::Detail::RefreshIfStale(std::size_t i) {
  MechanismDynamics& m = mechanisms_[i];
  MechanismBlock& block = mechanism_blocks_[i];
  if (!(m.Staleness(by_theta_) > 1) && !(two_stage_ && MissesAppliedForces(m))) return;
  const PartClock own(times_ ? &block.own : nullptr, &StepPartTimes::refreshing);
  block.refreshed = m.Refresh() ? 1 : -1;
}

void World::Detail::CountRefreshes(StepReport& report) const {
  for (const MechanismBlock& block : mechanism_blocks_) {
    report.refreshes += block.refreshed > 0 ? 1 : 0;
    report.failed_refreshes += block.refreshed < 0 ? 1 : 0;
  }
}

void World::Detail::PredictAll(const StepOptions& options) {
  const PartClock clock(times_, &StepPartTimes::free_velocities);
  ForMechanisms([&](std::size_t i) { Predict(mechanisms_[i], options.h, options.gravity); });
  for (FreeBody& b : free_bodies_) b.Predict(options.h, options.gravity);
}

// Contact, and with it which servos are at the bounds of their forces and which springs are slack: in each round
// servos that change sides come into the solve, and springs change theirs.
void World::Detail::SolveContacts(const StepOptions& options, StepReport& report) {
  const PartClock clock(times_, &StepPartTimes::solving);
  // Of servos no more come in than there are. Of springs a set that comes back has no end, and is said in the
  // report.
  constexpr int kRounds = 50;
  if (has_switches_)
    for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_velocity_[i] = free_bodies_[i].velocity();
  bool settled = false;
  int alike = 0;  // rounds in which no servo came in
  for (int round = 0; alike < kRounds && !settled; ++round) {
    if (!points_.empty() || !limits_.empty()) {
      AssembleOperators();
      if (round == 0) Rebound(options.h);
      report.solver = solver_.Solve(blocks_, constraints_, limits_, velocities_, options.contact);
      ApplyImpulses(true);
    }
    const std::size_t servos = servos_.size();
    settled = !has_switches_ || !UpdateSwitches(options);
    alike += servos_.size() == servos ? 1 : 0;
  }
  if (!settled) report.solver.converged = false;
  if (!servos_.empty()) SettleServos(options.h);
}

bool World::Detail::UpdateSwitches(const StepOptions& options) {
  bool changed = false;
  for (MechanismDynamics& m : mechanisms_)
    if (fork1s::UpdateSwitches(m, options.h)) changed = true;
  if (!changed) return false;
  PredictAllAgain(options.h);
  TakeServosIn(options.h);
  return true;
}

void World::Detail::PredictAllAgain(double h) {
  for (MechanismDynamics& m : mechanisms_) PredictAgain(m, h);
  for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_bodies_[i].ResetVelocity(free_velocity_[i]);
}

bool World::Detail::PrepareContacts(const StepOptions& options, StepReport& report) {
  if (!FindContacts(options, report)) return false;
  const PartClock clock(times_, &StepPartTimes::rows);
  LayOutPorts(options);
  MatchPrevious();
  // Rows first: the curvature term compares them on the velocities of the start of the step.
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

// Completes before_, which IntegrateStep leaves without what it keeps as `previous_`.
WorldState& World::Detail::StartOfStep() {
  before_.contacts = previous_;
  before_.contacts_h = previous_h_;
  before_.speeds_W = previous_speed_W_;
  before_.missed_W = previous_missed_W_;
  before_.contactor_poses = previous_pose_;
  return before_;
}

// Goes back to `start`, but for wrenches, which may be what was not finite.
StepReport World::Detail::UndoStep(WorldState& start, StepReport report) {
  ForgetInputs(start);
  Restore(start);
  report.finite = false;
  return report;
}

StepReport World::Detail::Step(const StepOptions& options) {
  if (times_) *times_ = StepPartTimes();
  const PartClock clock(times_, &StepPartTimes::all);
  if (!UsesTwoStages(options)) AddPointSpringForces(options);
  const StepReport report = IntegrateStep(options);
  for (MechanismDynamics& m : mechanisms_) m.StopPointSpring();
  for (FreeBody& body : free_bodies_) body.StopPointSpring();
  return report;
}

// By theta and euler a point spring is a force of the step.
void World::Detail::AddPointSpringForces(const StepOptions& options) {
  const auto add = [&](auto& body, const PointSpring& spring, const RigidTransform& X_WB, const auto&... of) {
    const Vector3 force_W =
        EndForce(RespondAt(body, of..., spring.point_B, options.h, options.gravity), spring, options.h);
    body.AddWrench(of..., force_W, Vector3::Zero(), X_WB * spring.point_B);
  };
  for (MechanismDynamics& m : mechanisms_)
    if (m.point_spring().IsActive())
      add(m, m.point_spring(), m.BodyPose(m.point_spring_body()), m.point_spring_body());
  for (FreeBody& body : free_bodies_)
    if (body.point_spring().IsActive()) add(body, body.point_spring(), body.pose());
}

StepReport World::Detail::IntegrateStep(const StepOptions& options) {
  StepReport report;
  const double h = options.h;
  FORK1S_REQUIRE(h > 0 && std::isfinite(h), h);

  by_theta_ = UsesTheta(options);
  two_stage_ = UsesTwoStages(options);
  if (!two_stage_ && !in_parts_)
    for (MechanismDynamics& m : mechanisms_) InvalidateBaseHistory(m);
  // What is not kept as `previous_` anyway.
  SaveBodies(before_);
  before_.port_twists = last_twist_;
  before_.speeds_are_last = curvature_valid_;
  before_.has_contactor_poses = has_previous_pose_;
  previous_.swap(contacts_);
  previous_h_ = contacts_h_;
  contacts_h_ = h;
  previous_pose_ = contactor_pose_;
  previous_speed_W_.swap(speed_W_);
  previous_missed_W_.swap(missed_W_);
  rule_ = StepRule::kEuler;
  begins_anew_ = false;
  least_margin_ = 0;
  all_stops_ = from_stage_start_ = false;
  if (two_stage_) return TwoStageStep(options);
  if (by_theta_)
    BeginTheta(options, report);
  else
    BeginEuler(options, report);
  if (report.impact || begins_anew_) return StepInParts(options, report.impact);
  PredictAll(options);
  report.forces_at_end = rule_ != StepRule::kMiddle;
  if (rule_ != StepRule::kEuler) ShiftRows();
  SolveContacts(options, report);

  if (!IsFinite(false)) return UndoStep(StartOfStep(), report);
  if (by_theta_ && MetAtSpeed(options)) return StepInParts(options, true);
  const bool jumps = by_theta_ && PushesApart(options);
  KeepForNextStep(h, report);
  curvature_valid_ = rule_ != StepRule::kMiddle;
  MoveMechanisms(options, report);
  if (jumps) ForgetPasts();
  if (rule_ != StepRule::kMiddle) KeepEndVelocities();
  for (const MechanismDynamics& m : mechanisms_)
    report.loop_residual = std::max(report.loop_residual, m.configuration().loop_residual);
  return IsFinite(true) ? report : UndoStep(StartOfStep(), report);
}

void World::Watch(StepPartTimes* times) { detail_->times_ = times; }

StepReport World::Step(const StepOptions& options) { return detail_->Step(options); }

}  // namespace fork1s
