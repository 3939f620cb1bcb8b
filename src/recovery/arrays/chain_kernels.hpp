// Poses as products along the tree, for one state or for blocks of them, one kernel for each instruction set
// (chain_kernels-inl.hpp).
//
// A tree of links: link l has the pose X_l = X_parent L_l(q). What moves it are linear forms of
// y = [1, z, µ], µ the loops' share. A link that turns about an axis by θ, or slides by θ, has
//     L = A_0 + sin θ A_1 + (1 - cos θ) A_2 + θ a_3
// with constant A, of which a slide has the first and last and a hinge all but the last. (Of the screw
// [ω; v], |ω| = 1, behind the constant pose C it is R = R_C (1 + sin θ [ω] + (1 - cos θ) [ω]²),
// p = p_C + R_C ((1 - cos θ) ω × v - sin θ ω × (ω × v) + θ (ω·v) ω).) Joints of several freedoms have one
// twist, L = Exp(x) C.
#pragma once

#include <cstddef>

#include "link_rows.hpp"
#include "twist_kernels.hpp"

namespace fork1s::internal {

enum class LinkKind { kFixed, kSlide, kTurn, kScrew, kTwist };

/// Entries of A_0, A_1, A_2 and a_3 that a link of some kind has, in this order; of a twist that of C.
constexpr int NumConstants(LinkKind kind) {
  constexpr int all[] = {12, 15, 36, 39, 12};
  return all[static_cast<int>(kind)];
}

struct Link {
  int slot = 0;     // where its pose goes
  int parent = -1;  // slot; -1: the root
  LinkKind kind = LinkKind::kFixed;
  int first = 0, last = 0;    // in heard: the entries of y that move it, the constant 1 first
  std::size_t weights = 0;    // of these, one each, of a twist six
  std::size_t constants = 0;  // NumConstants
};

/// Links, parents first.
template <class Real>
struct LinkMap {
  const Link* links = nullptr;
  int count = 0;
  const int* inputs = nullptr;
  const Real* weights = nullptr;
  const Real* constants = nullptr;
};

/// Where poses of a slot go: entry e of state i at first[e * stride + i].
template <class Real>
struct Place {
  Real* first = nullptr;
  std::size_t stride = 0;
};

/// Poses of all links for `states` states, a multiple of kBlock. Entry k of y for state i is
/// y[k * y_stride + i], on cache lines.
void ForwardKinematicsBatch(const LinkMap<float>& map, const float* y, std::size_t y_stride,
                            std::size_t states, const Place<float>* places);
void ForwardKinematicsBatch(const LinkMap<double>& map, const double* y, std::size_t y_stride,
                            std::size_t states, const Place<double>* places);

/// Links of one state in blocks of kBlock in the order in which they are walked, every parent before its
/// children.
template <class Real>
struct OneMap {
  int count = 0, slots = 0;
  const int *slot = nullptr, *parent = nullptr;   // parent: `slots` for the root
  const int *first = nullptr, *inputs = nullptr;  // of block i inputs[first[i]] up to inputs[first[i + 1]]
  const Real* weights = nullptr;                  // kBlock for each of these
  const Real* constants = nullptr;  // of a block: 39 rows, as a screw has them; 0 where it has not
  const int* twist = nullptr;       // which twist a link has, -1: none; nullptr: none has one
  const Real* twists = nullptr;     // their poses in their parents, twelve rows
  std::size_t twist_stride = 0;
};

/// Poses by columns: column k of slot s begins at X[(k * (slots + 1) + s) * 4], its fourth number is not
/// used. The slot behind the last is the root.
void ForwardKinematicsSingle(const OneMap<float>& map, const float* y, float* X);
void ForwardKinematicsSingle(const OneMap<double>& map, const double* y, double* X);
/// Rows of PoseArrays from the columns of slots begin to end; begin is a multiple of kBlock. Reads and writes
/// whole blocks.
void PutPoses(const float* X, int slots, int begin, int end, float* out, std::size_t stride);
void PutPoses(const double* X, int slots, int begin, int end, double* out, std::size_t stride);

}  // namespace fork1s::internal
