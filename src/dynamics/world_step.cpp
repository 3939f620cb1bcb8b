#include <algorithm>
#include <cmath>
#include <fork1s/parallel/parallel_for.hpp>

#include "world_detail.hpp"

namespace fork1s {

// Mechanisms that are worth a thread: some 200 joint coordinates, 30 us.
int World::Detail::MechanismGrain() const {
  int coordinates = 0;
  for (const MechanismDynamics& m : mechanisms_) coordinates += 1 + m.mechanism().num_coordinates();
  return coordinates == 0 ? 1 : std::max(1, 200 * static_cast<int>(mechanisms_.size()) / coordinates);
}

void World::Detail::MoveMechanisms(const StepOptions& options, StepReport& report) {
  ParallelFor(0, static_cast<int>(mechanisms_.size()), MechanismGrain(),
              [this, &options](int begin, int end) {
                for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
                  MechanismDynamics& m = mechanisms_[i];
                  m.Integrate(options.h);
                  mechanism_blocks_[i].refreshed = 0;
                  if (options.refresh && m.Staleness() > 1)
                    mechanism_blocks_[i].refreshed = m.Refresh() ? 1 : -1;
                }
              });
  if (by_theta_)
    for (const MechanismDynamics& m : mechanisms_) {
      report.newton_steps = std::max(report.newton_steps, m.NewtonSteps());
      report.minimum_found = report.minimum_found && m.FoundMinimum();
    }
  for (const MechanismBlock& block : mechanism_blocks_) {
    report.refreshes += block.refreshed > 0 ? 1 : 0;
    report.failed_refreshes += block.refreshed < 0 ? 1 : 0;
  }
}

// Contact, and with it which servos are at the bounds of their forces and which springs are slack: each round
// knows more of them, or lets go those that contact took back.
void World::Detail::SolveContacts(const StepOptions& options, StepReport& report) {
  constexpr int kRounds = 50;  // a set that comes back has no end, and is said in the report
  if (has_switches_)
    for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_velocity_[i] = free_bodies_[i].velocity();
  for (int round = 0; round < kRounds; ++round) {
    if (!points_.empty() || !limits_.empty()) {
      AssembleOperators();
      if (round == 0) Rebound(options.h);
      report.solver = solver_.Solve(blocks_, constraints_, limits_, velocities_, options.contact);
      ApplyImpulses();
    }
    if (!has_switches_ || !UpdateSwitches(options)) return;
  }
  report.solver.converged = false;
}

bool World::Detail::UpdateSwitches(const StepOptions& options) {
  bool changed = false;
  for (MechanismDynamics& m : mechanisms_)
    if (m.UpdateSwitches(options.h)) changed = true;
  if (!changed) return false;
  for (MechanismDynamics& m : mechanisms_) m.PredictAgain(options.h);
  for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_bodies_[i].ResetVelocity(free_velocity_[i]);
  return true;
}

void World::Detail::PrepareContacts(const StepOptions& options, StepReport& report) {
  FindContacts(options, report);
  LayOutPorts(options);
  MatchPrevious();
  // Rows first: the curvature term compares them on the velocities of the start of the step.
  AssembleConstraints(options);
}

bool World::Detail::IsFinite() const {
  return std::all_of(mechanisms_.begin(), mechanisms_.end(), [](const auto& m) { return m.IsFinite(); }) &&
         std::all_of(free_bodies_.begin(), free_bodies_.end(), [](const auto& b) { return b.IsFinite(); });
}

// Joints may be out of all proportion and finite, and the poses they lead to not.
bool World::Detail::PosesAreFinite() const {
  return std::all_of(mechanisms_.begin(), mechanisms_.end(), [](const MechanismDynamics& m) {
    const auto& X_RB = m.configuration().kinematics.X_RB;
    return std::all_of(X_RB.begin(), X_RB.end(), [](const auto& X) { return X.IsFinite(); });
  });
}

// As before the step, but for wrenches: they were meant for this step, and may be what was not finite.
StepReport World::Detail::TakeBack(StepReport report) {
  for (MechanismState& m : before_.mechanisms) {
    m.wrenches_W.setZero();
    m.has_wrenches = false;
    m.controls_move = false;
  }
  for (FreeBody::State& b : before_.free_bodies) b.force_W = b.moment_W = Vector3::Zero();
  Restore(before_);
  report.finite = false;
  return report;
}

StepReport World::Detail::Step(const StepOptions& options) {
  StepReport report;
  const double h = options.h;
  FORK1S_REQUIRE(h > 0 && std::isfinite(h), h);

  Save(before_);
  previous_.swap(contacts_);
  previous_pose_ = contactor_pose_;
  previous_speed_W_.swap(speed_W_);
  previous_missed_W_.swap(missed_W_);
  by_theta_ = UsesTheta(options);
  middle_ = false;
  if (by_theta_)
    BeginTheta(options, report);
  else
    PrepareContacts(options, report);
  ParallelFor(0, static_cast<int>(mechanisms_.size()), MechanismGrain(),
              [this, &options](int begin, int end) {
                for (int i = begin; i < end; ++i)
                  mechanisms_[static_cast<std::size_t>(i)].Predict(options.h, options.gravity);
              });
  for (FreeBody& b : free_bodies_) b.Predict(h, options.gravity);
  if (middle_) ShiftRows();
  SolveContacts(options, report);

  if (!IsFinite()) return TakeBack(report);
  KeepForNextStep(h, report);
  curvature_valid_ = !by_theta_;
  MoveMechanisms(options, report);
  for (FreeBody& b : free_bodies_) b.Integrate(h);
  for (const MechanismDynamics& m : mechanisms_)
    report.loop_residual = std::max(report.loop_residual, m.configuration().loop_residual);
  return IsFinite() && PosesAreFinite() ? report : TakeBack(report);
}

StepReport World::Step(const StepOptions& options) { return detail_->Step(options); }

}  // namespace fork1s
