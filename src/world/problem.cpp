// The contact problem of the last step, taken out of a world.
#include "constraints/contact_problem.hpp"

#include "detail.hpp"

namespace fork1s {

ContactProblem World::LastContactProblem() const {
  const Detail& d = *detail_;
  ContactProblem out;
  if (d.detection_.points.empty() && d.rows_.limits.empty()) return out;
  for (const VelocityBlock& b : d.rows_.blocks)
    out.Y.push_back(Eigen::Map<const MatrixX, 0, Eigen::OuterStride<>>(b.Y, b.freedoms, b.size,
                                                                       Eigen::OuterStride<>(b.stride)));
  out.contacts = d.rows_.contacts;
  out.limits = d.rows_.limits;
  // A world leaves room between blocks, for servos that may become rows; here they stand side by side.
  std::vector<int> place(static_cast<std::size_t>(d.rows_.velocities.size()), -1);
  int size = 0;
  for (const VelocityBlock& b : d.rows_.blocks)
    for (int i = 0; i < b.size; ++i) place[static_cast<std::size_t>(b.offset + i)] = size++;
  const auto move = [&](int& row) {
    if (row >= 0) row = place[static_cast<std::size_t>(row)];
  };
  for (ContactConstraint& c : out.contacts) {
    move(c.port_a);
    move(c.port_b);
  }
  for (LimitConstraint& limit : out.limits) move(limit.row);
  // The solve left the velocities of the end; what it did to them is taken back.
  out.velocity = VectorX::Zero(size);
  VectorX end(size);
  for (std::size_t row = 0; row < place.size(); ++row)
    if (place[row] >= 0) end(place[row]) = d.rows_.velocities(static_cast<Eigen::Index>(row));
  out.velocity = end - out.VelocityUnderImpulses();
  for (ContactConstraint& c : out.contacts) {
    c.impulse = c.previous_impulse;
    c.moment = c.previous_moment;
  }
  for (std::size_t i = 0; i < d.bodies_.mechanisms.size(); ++i) {
    std::size_t next = d.rows_.mechanisms[i].first_limit;
    for (const PartRows& part : d.rows_.mechanisms[i].parts) {
      for (const int at : part.limits)
        out.limits[next++].impulse = d.halving_.before.rows[i].limit_impulses[static_cast<std::size_t>(at)];
      for (const int at : part.frictions)
        out.limits[next++].impulse =
            d.halving_.before.rows[i].friction_impulses[static_cast<std::size_t>(at)];
    }
  }
  return out;
}

}  // namespace fork1s
