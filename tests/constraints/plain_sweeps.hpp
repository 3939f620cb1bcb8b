// The same law by another method: projected Gauss-Seidel on the dense operator, row by row, with what the
// material gives on the diagonal. Slow and plain; shares no code with the solver.
#pragma once

#include "problems.hpp"

namespace fork1s::testing {

struct SweepResult {
  VectorX velocity;
  std::vector<Vector3> impulses;
  bool settled = false;
};

/// Sweeps until no velocity changes by more than `tolerance` of the fastest.
inline SweepResult SweepPlainly(const Problem& p, double tolerance, int max_sweeps) {
  const MatrixX W = p.FullW();
  SweepResult out;
  out.velocity = p.velocity;
  out.impulses.assign(p.contacts.size(), Vector3::Zero());
  std::vector<double> limits(p.limits.size(), 0.0);
  std::vector<MatrixX> J, K;
  for (const ContactConstraint& c : p.contacts) {
    J.push_back(p.RowsOf(c));
    K.push_back(W * J.back().transpose());
  }
  const double speed = std::max(1e-12, p.velocity.cwiseAbs().maxCoeff());
  for (int sweep = 0; sweep < max_sweeps && !out.settled; ++sweep) {
    double change = 0;
    for (std::size_t i = 0; i < p.contacts.size(); ++i) {
      const ContactConstraint& c = p.contacts[i];
      Vector3& l = out.impulses[i];
      const Vector3 before = l;
      const Vector3 own = (J[i] * K[i]).diagonal();
      double u = J[i].row(0).dot(out.velocity) + c.bias[0] + c.compliance_normal * l[0];
      l[0] = std::max(0.0, l[0] - u / (own[0] + c.compliance_normal));
      out.velocity += K[i].col(0) * (l[0] - before[0]);
      const double stiff = own.tail<2>().sum() + c.compliance_tangent;
      const Vector2 slip = J[i].bottomRows(2) * out.velocity + c.bias.tail<2>() +
                           c.compliance_tangent * (l.tail<2>() - c.previous_impulse.tail<2>());
      Vector2 t = l.tail<2>() - slip / stiff;
      const double bound = c.friction * l[0];
      if (t.norm() > bound) t *= bound / t.norm();
      l.tail<2>() = t;
      const VectorX dv = K[i].rightCols(2) * (l.tail<2>() - before.tail<2>());
      out.velocity += dv;
      change = std::max(change, (K[i] * (l - before)).cwiseAbs().maxCoeff());
    }
    for (std::size_t i = 0; i < p.limits.size(); ++i) {
      const LimitConstraint& c = p.limits[i];
      const double before = limits[i], own = W(c.row, c.row) + c.compliance;
      const double u = c.sign * out.velocity[c.row] + c.bias + c.compliance * (before - c.previous_impulse);
      limits[i] = std::min(std::max(before - u / own, c.lower), c.upper);
      out.velocity += W.col(c.row) * (c.sign * (limits[i] - before));
      change = std::max(change, (W.col(c.row) * (limits[i] - before)).cwiseAbs().maxCoeff());
    }
    out.settled = change <= tolerance * speed;
  }
  return out;
}

}  // namespace fork1s::testing
