// Servos that change sides within a step, as rows of the contact solve (force_limits.cpp).
#include <algorithm>

#include "world_detail.hpp"

namespace fork1s {

// Those that mechanisms now leave to the solve get their rows.
void World::Detail::TakeServosIn(double h) {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    const MechanismDynamics& m = mechanisms_[i];
    const std::vector<signed char>& at_bound = MechanismView(m).state.at_bound;
    for (std::size_t k = 0; k < at_bound.size(); ++k) {
      if (at_bound[k] != MechanismState::kInSolve) continue;
      const auto p = static_cast<std::size_t>(m.step_model().part_of_force_limit[k]);
      PartBlock& part = mechanism_blocks_[i].parts[p];
      const int servo = static_cast<int>(k);
      if (std::find(part.servos.begin(), part.servos.end(), servo) != part.servos.end()) continue;
      servos_.push_back({i, p, part.servos.size(), k});
      limits_.emplace_back();
      limits_.back().row = part.offset + static_cast<int>(part.ServoRow(part.servos.size()));
      LengthRow(m, m.mechanism().force_limits()[k].length, m.step_model().parts[p],
                part.J_T.col(part.ServoRow(part.servos.size())));
      part.servos.push_back(servo);
      ++part.rows;
    }
  }
  AssembleServos(h);
}

// Of all, since what is at an end of the step may change with the first that is at its bound.
void World::Detail::AssembleServos(double h) {
  for (std::size_t k = 0; k < servos_.size(); ++k) {
    const ServoInSolve& servo = servos_[k];
    const ServoRow row = RowOfServo(mechanisms_[servo.mechanism], servo.force_limit, h);
    LimitConstraint& limit = limits_[limits_.size() - servos_.size() + k];
    limit.bias = -row.speed;
    limit.compliance = row.compliance;
    limit.lower = row.lower;
    limit.upper = row.upper;
    limit.impulse = std::clamp(limit.impulse, limit.lower, limit.upper);
  }
}

// The sides that were found, and the same step again with these servos where they belong: to rounding it is the
// same velocity, and the rest of the step knows of no such rows.
void World::Detail::SettleServos(double h) {
  for (std::size_t k = 0; k < servos_.size(); ++k)
    TakeSideOfServo(mechanisms_[servos_[k].mechanism], servos_[k].force_limit,
                    limits_[limits_.size() - servos_.size() + k].impulse, h);
  PredictAllAgain(h);
  if (!points_.empty() || limits_.size() > servos_.size()) ApplyImpulses(false);
}

}  // namespace fork1s
