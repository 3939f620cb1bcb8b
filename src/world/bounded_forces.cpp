// Forces that change sides within a step, as rows of the contact solve (force_limits.cpp, slack.cpp).
#include <algorithm>

#include "detail.hpp"

namespace fork1s {

// Those that mechanisms now leave to the solve get their rows.
void World::Detail::AddBoundedForceRows(double h) {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    const std::vector<int>& part_of = m.step_model().part_of_bounded_force;
    for (std::size_t k = 0; k < part_of.size(); ++k) {
      if (!IsInSolve(m, k)) continue;
      const auto p = static_cast<std::size_t>(part_of[k]);
      PartRows& part = rows_.mechanisms[i].parts[p];
      const int force = static_cast<int>(k);
      if (std::find(part.bounded_forces.begin(), part.bounded_forces.end(), force) !=
          part.bounded_forces.end())
        continue;
      const Eigen::Index row = part.BoundedForceRow(part.bounded_forces.size());
      rows_.bounded_forces.push_back({i, p, part.bounded_forces.size(), k});
      rows_.limits.emplace_back();
      rows_.limits.back().row = part.offset + static_cast<int>(row);
      LengthRow(m, LengthOfBoundedForce(m, k), m.step_model().parts[p], part.J_T.col(row));
      part.bounded_forces.push_back(force);
      ++part.size;
    }
  }
  AssembleBoundedForces(h);
}

// Of all, since what is at an end of the step may change with the first that is at its bound.
void World::Detail::AssembleBoundedForces(double h) {
  for (std::size_t k = 0; k < rows_.bounded_forces.size(); ++k) {
    const ConstraintRows::BoundedForce& force = rows_.bounded_forces[k];
    const fork1s::BoundedForceRow row =
        RowOfBoundedForce(bodies_.mechanisms[force.mechanism], force.index, h);
    LimitConstraint& limit = rows_.LimitOfBoundedForce(k);
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
  for (std::size_t k = 0; k < rows_.bounded_forces.size(); ++k) {
    const LimitConstraint& limit = rows_.LimitOfBoundedForce(k);
    const double unbounded = -(rows_.velocities(limit.row) + limit.bias) / limit.compliance;
    SetSideOfBoundedForce(bodies_.mechanisms[rows_.bounded_forces[k].mechanism],
                          rows_.bounded_forces[k].index, limit.impulse, unbounded, h);
  }
  PredictAllAgain(h);
  if (!detection_.points.empty() || rows_.limits.size() > rows_.bounded_forces.size())
    ApplyImpulses(detection_, false, bodies_, stops_, rows_);
}

}  // namespace fork1s
