// The most that a core multiplies and adds, and that it reads, by the widest registers it has.
#pragma once

#include <cstddef>

namespace fork1s::internal {

/// Does `rounds` rounds of independent fused multiply-adds and returns how many operations, two each, that
/// was. `sum` takes a number that depends on all of them.
double FusedSums(bool single_precision, int rounds, double& sum);
/// Of `count` numbers.
double SumOfAll(const double* at, std::size_t count);

}  // namespace fork1s::internal
