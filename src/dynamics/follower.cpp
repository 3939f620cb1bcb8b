// Forces that have no potential: those that turn with a body (PathKind::kWrench).
//
// No energy that the chord of a step asks for knows of them: their work is one from outside, as that of
// contact is.
#include <algorithm>

#include "mechanism_detail.hpp"

namespace fork1s {

void FindFollowers(MechanismModel& model) {
  const Mechanism& m = model.mechanism();
  const auto follows = [&](const auto& d) { return !m.HasPotential(d.length); };
  const auto any = [&](const auto& list) { return std::any_of(list.begin(), list.end(), follows); };
  model.has_follower_springs = any(m.springs()) || any(m.force_limits());
  model.has_followers = model.has_follower_springs || any(m.controls());
}

// tau += factor times all of them at the present pose.
void AddFollowerForce(const MechanismView& here, double factor, VectorX& tau) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  for (const Mechanism::Spring& s : m.springs())
    if (!m.HasPotential(s.length))
      AddLengthForce(here, s.length, factor * s.Force(Length(here, s.length)), tau);
  for (std::size_t i = 0; i < m.controls().size(); ++i) {
    const Mechanism::Control& c = m.controls()[i];
    if (!m.HasPotential(c.length))
      AddLengthForce(here, c.length, factor * c.gain * state.controls(static_cast<Eigen::Index>(i)), tau);
  }
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    if (m.HasPotential(limit.length)) continue;
    const double f = UnboundedForce(here, limit);
    AddLengthForce(here, limit.length, -factor * (f - std::clamp(f, limit.lower, limit.upper)), tau);
  }
}

}  // namespace fork1s
