// Forces that change sides within a step, as rows of the contact solve (force_limits.cpp, slack.cpp).
#include <algorithm>

#include "assembly.hpp"

namespace fork1s {

namespace {

// Of all, since what is at an end of the step may change with the first that is at its bound.
void AssembleBoundedForces(Bodies& bodies, double h, ConstraintRows& rows) {
  for (std::size_t k = 0; k < rows.bounded_forces.size(); ++k) {
    const ConstraintRows::BoundedForce& force = rows.bounded_forces[k];
    const BoundedForceRow row = RowOfBoundedForce(bodies.mechanisms[force.mechanism], force.index, h);
    LimitConstraint& limit = rows.LimitOfBoundedForce(k);
    limit.bias = -row.speed;
    limit.compliance = row.compliance;
    limit.lower = row.lower;
    limit.upper = row.upper;
    limit.impulse = std::clamp(limit.impulse, limit.lower, limit.upper);
  }
}

}  // namespace

void AddBoundedForceRows(Bodies& bodies, double h, ConstraintRows& rows) {
  for (std::size_t i = 0; i < bodies.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies.mechanisms[i];
    const std::vector<int>& part_of = m.step_model().part_of_bounded_force;
    for (std::size_t k = 0; k < part_of.size(); ++k) {
      if (!IsInSolve(m, k)) continue;
      const auto p = static_cast<std::size_t>(part_of[k]);
      PartRows& part = rows.mechanisms[i].parts[p];
      const int force = static_cast<int>(k);
      if (std::find(part.bounded_forces.begin(), part.bounded_forces.end(), force) !=
          part.bounded_forces.end())
        continue;
      const Eigen::Index row = part.BoundedForceRow(part.bounded_forces.size());
      rows.bounded_forces.push_back({i, p, part.bounded_forces.size(), k});
      rows.limits.emplace_back();
      rows.limits.back().row = part.offset + static_cast<int>(row);
      LengthRow(m, LengthOfBoundedForce(m, k), m.step_model().parts[p], part.J_T.col(row));
      part.bounded_forces.push_back(force);
      ++part.size;
    }
  }
  AssembleBoundedForces(bodies, h, rows);
}

void SetSidesFound(double h, Bodies& bodies, const ConstraintRows& rows) {
  for (std::size_t k = 0; k < rows.bounded_forces.size(); ++k) {
    const LimitConstraint& limit = rows.LimitOfBoundedForce(k);
    const double unbounded = -(rows.velocities(limit.row) + limit.bias) / limit.compliance;
    SetSideOfBoundedForce(bodies.mechanisms[rows.bounded_forces[k].mechanism], rows.bounded_forces[k].index,
                          limit.impulse, unbounded, h);
  }
}

}  // namespace fork1s
