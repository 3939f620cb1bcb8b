// What stops and dry frictions of joints and tendons did in the last step.
#include "detail.hpp"

namespace fork1s {

void World::AddStopForces(int mechanism, double h, VectorX& tau) const {
  const auto i = static_cast<std::size_t>(mechanism);
  const MechanismDynamics& m = detail_->mechanisms_[i];
  const Detail::MechanismBlock& block = detail_->mechanism_blocks_[i];
  auto add = [&](const Mechanism::Length& length, double impulse) {
    if (impulse != 0) m.AddLengthForce(length, impulse / h, tau);
  };
  for (std::size_t k = 0; k < m.length_limits().size(); ++k)
    add(m.length_limits()[k].length, block.limit_impulses[2 * k] - block.limit_impulses[2 * k + 1]);
  for (std::size_t k = 0; k < m.mechanism().frictions().size(); ++k)
    add(m.mechanism().frictions()[k].length, block.friction_impulses[k]);
}

}  // namespace fork1s
