// Elastic coordinates branch by branch.
#pragma once

#include <vector>

#include "elastic_basis.hpp"

namespace fork1s::internal {

/// Elastic columns of a diagonal basis in depth-first order of their joints, each joint before those that it
/// carries and a branch in one run. In these coordinates, taken from the last to the first, the operator of a
/// step fills nothing in: a finger depends on itself and the arm that carries it.
std::vector<int> BranchOrder(const Mechanism& mechanism, const ElasticBasis& basis);

/// The identity with its columns in BranchOrder, elastic x elastic.
MatrixX BranchIdentity(const Mechanism& mechanism, const ElasticBasis& basis);

}  // namespace fork1s::internal
