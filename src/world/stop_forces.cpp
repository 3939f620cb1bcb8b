// What stops and dry frictions of joints and tendons did in the last step.
#include "detail.hpp"

namespace fork1s {

void World::AddStopForces(int mechanism, double h, VectorX& tau) const {
  const auto i = static_cast<std::size_t>(mechanism);
  const MechanismDynamics& m = detail_->bodies_.mechanisms[i];
  const StopHistory& stops = detail_->stops_[i];
  auto add = [&](const Mechanism::Length& length, double impulse) {
    if (impulse != 0) m.AddLengthForce(length, impulse / h, tau);
  };
  for (std::size_t k = 0; k < m.length_limits().size(); ++k)
    add(m.length_limits()[k].length, stops.impulses[2 * k] - stops.impulses[2 * k + 1]);
  for (std::size_t k = 0; k < m.mechanism().frictions().size(); ++k)
    add(m.mechanism().frictions()[k].length, stops.friction_impulses[k]);
}

}  // namespace fork1s
