// A long path of one state by a blocked scan, one kernel for each instruction set (scan_kernels-inl.hpp).
//
// Along a path every pose waits for the one before, three fused products of four cycles each, and most of the
// processor with it. So a run of links, each hanging on the one before, is cut into kBlock segments of
// `steps` links; the lanes of a register walk the segments side by side, each from the identity; what a
// segment stands on is a product of a few segments; and multiplies all of it in a second pass. Twice the
// products, kBlock lanes.
#pragma once

#include "link_rows.hpp"
#include "twist_kernels.hpp"

namespace fork1s::internal {

/// A run of links of one freedom or none. Link l is step l % steps of segment l / steps.
template <class Real>
struct RunMap {
  int count = 0, steps = 0;  // steps: kBlock or more
  // θ of links l in blocks of kBlock, as OneMap has them.
  const int *first = nullptr, *inputs = nullptr;
  const Real* weights = nullptr;
  const Real* constants =
      nullptr;  // for each step kLinkRows rows of kBlock segments; beyond the last link the identity
};

/// Numbers of the first pass: θ and its sine and versine, and the poses from where each segment begins, as
/// rows of kBlock segments.
template <class Real>
std::size_t RunTurns(const RunMap<Real>& map) {
  constexpr std::size_t block = kBlock<Real>;
  return 4 * static_cast<std::size_t>(map.steps) * block;
}
template <class Real>
std::size_t RunPoses(const RunMap<Real>& map) {
  constexpr std::size_t block = kBlock<Real>;
  return 12 * static_cast<std::size_t>(map.steps) * block;
}

void ScanFirst(const RunMap<float>& map, const float* y, float* turns, float* poses);
void ScanFirst(const RunMap<double>& map, const double* y, double* turns, double* poses);
/// Rows of the run's links, the first at out[0], from what each segment stands on: twelve rows of kBlock.
void ScanLast(const RunMap<float>& map, const float* poses, const float* stands, float* out,
              std::size_t stride);
void ScanLast(const RunMap<double>& map, const double* poses, const double* stands, double* out,
              std::size_t stride);

/// Numbers of that many bytes in a register of the processor.
int RegisterLanes(std::size_t bytes);

}  // namespace fork1s::internal
