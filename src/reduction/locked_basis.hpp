// Elastic and spring-free motions of a mechanism with some joint coordinates locked.
#pragma once

#include <vector>

#include "elastic_basis.hpp"

namespace fork1s::internal {

/// Let N be the spring-free motions (q = N a) and p the locked coordinates. Under joint forces g the springs
/// give q = V Vᵀ g up to N a; the forces r that lock p make Nᵀ(g + r) = 0, and a makes q_p = 0. Hence q = Π V
/// (Π V)ᵀ g with Π V = V − N (N_p)⁺ V_p.
struct LockedBasis {
  MatrixX elastic;  ///< n x elastic: Π V
  MatrixX free;     ///< n x what is left of the spring-free motions
};

/// For coordinates that are part of spring-free motions, one for each that is to be held (CoordinatesToLock).
LockedBasis LockCoordinates(const ElasticBasis& basis, int n, const std::vector<int>& locked);

/// What the columns of `motions` (n x k, q = scale ∘ x, x in one unit) span with the coordinates at rest.
MatrixX WithLocked(const MatrixX& motions, const VectorX& scale, const std::vector<int>& locked);

}  // namespace fork1s::internal
