// Forces that change sides within a step, as rows of the contact solve (force_limits.cpp, slack.cpp).
#include <algorithm>

#include "detail.hpp"

namespace fork1s {

// Those that mechanisms now leave to the solve get their rows.
void World::Detail::AddBoundedForceRows(double h) {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const MechanismDynamics& m = mechanisms_[i];
    const std::vector<int>& part_of = m.step_model().part_of_bounded_force;
    for (std::size_t k = 0; k < part_of.size(); ++k) {
      if (!IsInSolve(m, k)) continue;
      const auto p = static_cast<std::size_t>(part_of[k]);
      PartBlock& part = mechanism_blocks_[i].parts[p];
      const int force = static_cast<int>(k);
      if (std::find(part.bounded_forces.begin(), part.bounded_forces.end(), force) !=
          part.bounded_forces.end())
        continue;
      const Eigen::Index row = part.BoundedForceRow(part.bounded_forces.size());
      bounded_forces_.push_back({i, p, part.bounded_forces.size(), k});
      limits_.emplace_back();
      limits_.back().row = part.offset + static_cast<int>(row);
      LengthRow(m, LengthOfBoundedForce(m, k), m.step_model().parts[p], part.J_T.col(row));
      part.bounded_forces.push_back(force);
      ++part.rows;
    }
  }
  AssembleBoundedForces(h);
}

// Of all, since what is at an end of the step may change with the first that is at its bound.
void World::Detail::AssembleBoundedForces(double h) {
  for (std::size_t k = 0; k < bounded_forces_.size(); ++k) {
    const BoundedForceInSolve& force = bounded_forces_[k];
    const fork1s::BoundedForceRow row = RowOfBoundedForce(mechanisms_[force.mechanism], force.index, h);
    LimitConstraint& limit = limits_[limits_.size() - bounded_forces_.size() + k];
    limit.bias = -row.speed;
    limit.compliance = row.compliance;
    limit.lower = row.lower;
    limit.upper = row.upper;
    limit.impulse = std::clamp(limit.impulse, limit.lower, limit.upper);
  }
}

// The sides that were found, and the same step again with these forces where they belong: to rounding it is
// the same velocity, and the rest of the step knows of no such rows.
void World::Detail::SolveWithSidesFound(double h) {
  for (std::size_t k = 0; k < bounded_forces_.size(); ++k) {
    const LimitConstraint& limit = limits_[limits_.size() - bounded_forces_.size() + k];
    const double unbounded = -(velocities_(limit.row) + limit.bias) / limit.compliance;
    SetSideOfBoundedForce(mechanisms_[bounded_forces_[k].mechanism], bounded_forces_[k].index, limit.impulse,
                           unbounded, h);
  }
  PredictAllAgain(h);
  if (!points_.empty() || limits_.size() > bounded_forces_.size()) ApplyImpulses(false);
}

}  // namespace fork1s
