// What all parts of a step did together: reports and impulses.
#include <algorithm>

#include "detail.hpp"

namespace fork1s {
namespace {

void Add(double weight, const std::vector<double>& more, std::vector<double>& sums) {
  sums.resize(more.size(), 0.0);
  for (std::size_t i = 0; i < more.size(); ++i) sums[i] += weight * more[i];
}

}  // namespace

// What a step of parts has to say, `part` its last so far.
void World::Detail::AddReport(const StepReport& part, StepReport& whole) {
  const StepReport before = whole;
  whole = part;
  whole.max_penetration = std::max(before.max_penetration, part.max_penetration);
  whole.refreshes += before.refreshes;
  whole.failed_refreshes += before.failed_refreshes;
  whole.contacts_dropped = before.contacts_dropped || part.contacts_dropped;
  whole.loop_residual = std::max(before.loop_residual, part.loop_residual);
  whole.parts = before.parts + part.parts;
  whole.stages += before.stages;
  whole.stage_iterations += before.stage_iterations;
  whole.max_stage_iterations = std::max(before.max_stage_iterations, part.max_stage_iterations);
  if (before.stage_residual > part.stage_residual) {
    whole.stage_residual = before.stage_residual;
    whole.stage_residual_of = before.stage_residual_of;
  }
  whole.impact = before.impact || part.impact;
  whole.stages_converged = before.stages_converged && part.stages_converged;
  MergeSolverReport(before.solver, whole.solver);
}

void MergeSolverReport(const ContactSolverReport& then, ContactSolverReport& solver) {
  solver.newton_iterations = std::max(solver.newton_iterations, then.newton_iterations);
  solver.stage = std::max(solver.stage, then.stage);
  solver.residual = std::max(solver.residual, then.residual);
  solver.residual_impulse = std::max(solver.residual_impulse, then.residual_impulse);
  solver.residual_speed = std::max(solver.residual_speed, then.residual_speed);
  solver.active = std::max(solver.active, then.active);
  solver.sticking = std::max(solver.sticking, then.sticking);
  solver.sliding = std::max(solver.sliding, then.sliding);
  solver.converged = solver.converged && then.converged;
}

void World::Detail::ClearSums() {
  sums_.contacts.clear();
  sums_.ended.clear();
  sums_.rows.resize(mechanisms_.size());
  for (WorldState::Rows& rows : sums_.rows) {
    rows.limit_impulses.clear();
    rows.friction_impulses.clear();
  }
}

void World::Detail::SetSum(const ContactSum& sum, ContactRecord& contact) {
  contact.moment = contact.point.frame * sum.wrench_W.head<3>();
  contact.impulse = contact.point.frame * sum.wrench_W.tail<3>();
  contact.normal_sum = sum.normal;
  contact.tangential_sum = sum.tangential;
}

// Impulses and moments of all stages of the step so far, contact by contact: vectors in world axes,
// magnitudes along and across the normal of each stage.
void World::Detail::SumImpulses(double weight) {
  next_sums_.resize(contacts_.size());
  goes_on_.assign(sums_.contacts.size(), 0);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const Matrix3 frame_W = contacts_[i].point.frame.transpose();
    ContactSum& sum = next_sums_[i];
    sum.wrench_W.head<3>() = weight * (frame_W * contacts_[i].moment);
    sum.wrench_W.tail<3>() = weight * (frame_W * contacts_[i].impulse);
    sum.normal = weight * contacts_[i].impulse(0);
    sum.tangential = weight * contacts_[i].impulse.tail<2>().norm();
    if (match_[i] < 0 || sums_.contacts.empty()) continue;
    const auto k = static_cast<std::size_t>(match_[i]);
    const ContactSum& before = sums_.contacts[k];
    sum.wrench_W += before.wrench_W;
    sum.normal += before.normal;
    sum.tangential += before.tangential;
    goes_on_[k] = 1;
  }
  for (std::size_t i = 0; i < goes_on_.size(); ++i) {
    if (goes_on_[i] || sums_.contacts[i].wrench_W.isZero(0)) continue;
    sums_.ended.push_back(previous_[i]);
    SetSum(sums_.contacts[i], sums_.ended.back());
  }
  sums_.contacts.swap(next_sums_);
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    Add(weight, mechanism_blocks_[i].limit_impulses, sums_.rows[i].limit_impulses);
    Add(weight, mechanism_blocks_[i].friction_impulses, sums_.rows[i].friction_impulses);
  }
}

// Whoever asks what acted in the step is told of all of it, what parted again within it too.
void World::Detail::StoreSums() {
  for (std::size_t i = 0; i < contacts_.size(); ++i) SetSum(sums_.contacts[i], contacts_[i]);
  for (const ContactRecord& c : sums_.ended) {
    contacts_.push_back(c);
  }
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    mechanism_blocks_[i].limit_impulses = sums_.rows[i].limit_impulses;
    mechanism_blocks_[i].friction_impulses = sums_.rows[i].friction_impulses;
  }
}

}  // namespace fork1s
