#include "constraints/contact_problem.hpp"

namespace fork1s {

std::vector<VelocityBlock> ContactProblem::Blocks() const {
  std::vector<VelocityBlock> blocks;
  int offset = 0;
  for (const MatrixX& y : Y) {
    const int size = static_cast<int>(y.cols()), freedoms = static_cast<int>(y.rows());
    blocks.push_back({offset, size, y.data(), freedoms, freedoms});
    offset += size;
  }
  return blocks;
}

VectorX ContactProblem::VelocityUnderImpulses() const {
  VectorX p = VectorX::Zero(velocity.size()), out = velocity;
  for (const ContactConstraint& c : contacts) {
    if (c.port_a >= 0) p.segment<6>(c.port_a) += c.ImpulseOn(c.J_a);
    if (c.port_b >= 0) p.segment<6>(c.port_b) += c.ImpulseOn(c.J_b);
  }
  for (const LimitConstraint& l : limits) p(l.row) += l.sign * l.impulse;
  Eigen::Index offset = 0;
  for (const MatrixX& y : Y) {
    if (y.rows() > 0) {
      const VectorX d = y * p.segment(offset, y.cols());
      out.segment(offset, y.cols()) += y.transpose() * d;
    }
    offset += y.cols();
  }
  return out;
}

}  // namespace fork1s
