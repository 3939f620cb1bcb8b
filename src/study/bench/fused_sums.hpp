// The most multiplications and additions that a core does, by the widest registers it has.
#pragma once

namespace fork1s::internal {

/// Does `rounds` rounds of independent fused multiply-adds and returns how many operations, two each, that
/// was. `sum` takes a number that depends on all of them.
double FusedSums(bool single_precision, int rounds, double& sum);

}  // namespace fork1s::internal
