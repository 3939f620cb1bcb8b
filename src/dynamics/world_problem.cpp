// The contact problem of the last step, taken out of a world.
#include <fork1s/contact/contact_problem.hpp>

#include "world_detail.hpp"

namespace fork1s {

ContactProblem World::LastContactProblem() const {
  const Detail& d = *detail_;
  ContactProblem out;
  if (d.points_.empty() && d.limits_.empty()) return out;
  for (const VelocityBlock& b : d.blocks_)
    out.Y.push_back(Eigen::Map<const MatrixX, 0, Eigen::OuterStride<>>(b.Y, b.freedoms, b.size,
                                                                       Eigen::OuterStride<>(b.stride)));
  out.contacts = d.constraints_;
  out.limits = d.limits_;
  // The solve left the velocities of the end; what it did to them is taken back.
  const Eigen::Index size = out.Y.empty() ? 0 : d.blocks_.back().offset + d.blocks_.back().size;
  out.velocity = VectorX::Zero(size);
  out.velocity = d.velocities_.head(size) - out.VelocityUnderImpulses();
  for (ContactConstraint& c : out.contacts) {
    c.impulse = c.held;
    c.moment = c.held_moment;
  }
  for (std::size_t i = 0; i < d.mechanisms_.size(); ++i) {
    std::size_t next = d.mechanism_blocks_[i].first_limit;
    for (const Detail::PartBlock& part : d.mechanism_blocks_[i].parts) {
      for (const int at : part.limits)
        out.limits[next++].impulse = d.before_.rows[i].limit_impulses[static_cast<std::size_t>(at)];
      for (const int at : part.frictions)
        out.limits[next++].impulse = d.before_.rows[i].friction_impulses[static_cast<std::size_t>(at)];
    }
  }
  return out;
}

}  // namespace fork1s
