// What a link of one freedom is, where the lanes of a register are links and every number of a link is read
// once.
#pragma once

namespace fork1s::internal {

/// Rows of constants: C, the pose at θ = 0, by entries; ω of length 1 or 0; ω × v; and a, the slide with θ.
/// A_0 to a_3 of chain_kernels.hpp follow from them in registers: 21 numbers instead of 39, since what a long
/// chain takes is mostly the reading.
inline constexpr int kLinkRows = 21;

}  // namespace fork1s::internal
