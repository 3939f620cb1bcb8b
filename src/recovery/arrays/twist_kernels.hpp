// Loops over blocks of bodies or states, one for each instruction set (twist_kernels-inl.hpp).
#pragma once

#include <cstddef>
#include <cstdint>

namespace fork1s::internal {

/// One cache line of bodies.
template <class Real>
inline constexpr int kBlock = 64 / static_cast<int>(sizeof(Real));

/// T and the poses at the reference, in blocks of `width` bodies: kBlock, or 1 for RecoverStates. Of block i
/// the coordinates that any of its bodies depends on are inputs[first[i]] up to inputs[first[i + 1]], and for each
/// of these T has six rows of `width` entries, rotations first. X_ref: twelve rows of as many a block, as
/// PoseArrays has them.
template <class Real>
struct TwistMap {
  const int* first = nullptr;
  const int* inputs = nullptr;
  const Real* T = nullptr;
  const Real* X_ref = nullptr;
};

/// Where a pose is not right because its twist turns by more than half a turn: bit k of the mask of each
/// block.
using Missed = std::uint32_t;

void RecoverBlocks(const TwistMap<float>& map, const float* z, int begin, int end, float* out,
                   std::size_t stride, Missed* missed);
void RecoverBlocks(const TwistMap<double>& map, const double* z, int begin, int end, double* out,
                   std::size_t stride, Missed* missed);
/// One body, states in blocks of kBlock; z and out are padded to whole ones.
void RecoverStates(const TwistMap<float>& map, int body, const float* z, std::size_t z_stride, int begin,
                   int end, float* out, std::size_t stride, Missed* missed);
void RecoverStates(const TwistMap<double>& map, int body, const double* z, std::size_t z_stride, int begin,
                   int end, double* out, std::size_t stride, Missed* missed);

}  // namespace fork1s::internal
