// Forces that have no potential: those that turn with a body (PathKind::kWrench).
//
// No energy that the chord of a step asks for knows of them: their work is one from outside, as that of
// contact is.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>

namespace fork1s {

void MechanismDynamics::FindFollowers() {
  const Mechanism& m = mechanism();
  const auto follows = [&](const auto& d) { return !m.HasPotential(d.length); };
  const auto any = [&](const auto& list) { return std::any_of(list.begin(), list.end(), follows); };
  has_follower_springs_ = any(m.springs()) || any(m.force_limits());
  has_followers_ = has_follower_springs_ || any(m.controls());
}

// tau += factor times all of them at the present pose.
void MechanismDynamics::AddFollowerForce(double factor, VectorX& tau) const {
  const Mechanism& m = mechanism();
  for (const Mechanism::Spring& s : m.springs())
    if (!m.HasPotential(s.length)) AddLengthForce(s.length, factor * s.Force(Length(s.length)), tau);
  for (std::size_t i = 0; i < m.controls().size(); ++i) {
    const Mechanism::Control& c = m.controls()[i];
    if (!m.HasPotential(c.length))
      AddLengthForce(c.length, factor * c.gain * state_.controls(static_cast<Eigen::Index>(i)), tau);
  }
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    if (m.HasPotential(limit.length)) continue;
    const double f = UnboundedForce(limit);
    AddLengthForce(limit.length, -factor * (f - std::clamp(f, limit.lower, limit.upper)), tau);
  }
}

}  // namespace fork1s
