// One contact problem by itself: to study, to solve by other means, to compare.
#pragma once

#include <fork1s/constraints/contact_solver.hpp>
#include <vector>

namespace fork1s {

/// What ContactSolver::Solve is asked, with operators of its own: copies stay whole.
struct ContactProblem {
  std::vector<MatrixX> Y;                   // a block: freedoms x size, W = Yᵀ Y
  std::vector<ContactConstraint> contacts;  // impulse, moment: the warm start
  std::vector<LimitConstraint> limits;      // impulse: the warm start
  VectorX velocity;                         // v*, block after block

  /// Views of Y; they end with this problem, or when it is moved or changed.
  std::vector<VelocityBlock> Blocks() const;
  /// v* + Yᵀ Y Σ p for the impulses of contacts and limits.
  VectorX VelocityUnderImpulses() const;
};

}  // namespace fork1s
