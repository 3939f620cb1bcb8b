// What loops add to y = [1, z, ν] for blocks of states, one kernel for each instruction set
// (loop_kernels-inl.hpp).
#pragma once

#include "chain_kernels.hpp"

namespace fork1s::internal {

/// ν of loops that depend on each other by their curvature: rows of N[z, z]/2, by pairs of entries of y.
struct BendGroup {
  int entry = 0, rows = 0;  // of y
  int first_pair = 0, pairs = 0;
  std::size_t at = 0;  // in N: `pairs` for each row
};
template <class Real>
struct BendMap {
  const BendGroup* groups = nullptr;
  int count = 0;
  const int *a = nullptr, *b = nullptr;  // of pairs
  const Real* N = nullptr;
};

/// A closure's frames on two of the links that loops ask for (-1: on the root), and the rows that are kept of
/// its six errors.
template <class Real>
struct ClosureRows {
  int slot_a = -1, slot_b = -1;
  Real X_a[12], X_b[12];
  int rows = 0;
  int component[6], row[6];
};
/// A coupling: a - polynomial(q_b), with a = q_a - Σ coefficient q; both as forms of y.
template <class Real>
struct CouplingRow {
  int row = 0;
  int first_a = 0, last_a = 0, last_b = 0;  // in heard and weights; those of b follow those of a
  Real polynomial[5], unit;
};
struct LoopGroup {
  int row = 0, rows = 0;
  std::size_t at = 0;  // in G: rows x rows
};

/// Loops of a model: c(q) in units of like size, and G = (A_ref B)⁻¹ in those.
template <class Real>
struct LoopMap {
  LinkMap<Real> links;  // those on the way to a closure
  int slots = 0;
  const ClosureRows<Real>* closures = nullptr;
  int num_closures = 0;
  const CouplingRow<Real>* couplings = nullptr;
  int num_couplings = 0;
  const int* inputs = nullptr;
  const Real* weights = nullptr;
  const LoopGroup* groups = nullptr;
  int num_groups = 0;
  const Real* G = nullptr;
  int rows = 0, entry = 0;  // ν begins at this entry of y
  Real shift_unit = 1;      // of a slide, 1/m
};

inline constexpr int kMostCorrections = 12;
/// Residual at which a state is closed, before its last correction.
template <class Real>
inline constexpr double kClosed = sizeof(Real) == 4 ? 1e-5 : 1e-12;

/// Numbers that BendStates and CloseBlock need beside.
template <class Real>
std::size_t BendScratch(int most_pairs) {
  return static_cast<std::size_t>(most_pairs) * kBlock<Real>;
}
template <class Real>
std::size_t CloseScratch(const LoopMap<Real>& map) {
  const auto m = static_cast<std::size_t>(map.rows), groups = static_cast<std::size_t>(map.num_groups);
  return (12 * static_cast<std::size_t>(map.slots) + 2 * m + (kMostCorrections + 1) * (m + groups) + groups) *
         kBlock<Real>;
}

/// ν at the entries behind z.
void BendStates(const BendMap<float>& map, float* y, std::size_t y_stride, std::size_t states,
                float* scratch);
void BendStates(const BendMap<double>& map, double* y, std::size_t y_stride, std::size_t states,
                double* scratch);

struct Closing {
  Missed open = 0;  // states that are not closed
  int corrections = 0;
};
/// Closes the loops of kBlock states, from the ν at hand. Of these `states` count.
Closing CloseBlock(const LoopMap<float>& map, float* y, std::size_t y_stride, std::size_t states,
                   float* scratch);
Closing CloseBlock(const LoopMap<double>& map, double* y, std::size_t y_stride, std::size_t states,
                   double* scratch);

}  // namespace fork1s::internal
