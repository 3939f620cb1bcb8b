// What a port is in freedoms: six columns Y of a frame's twist, and what is summed over them.
#pragma once

#include <cstddef>
#include <fork1s/base/types.hpp>

#include "padded.hpp"

namespace fork1s::internal {

/// out += X t, X of n rows and six columns `stride` apart. Sums are by fours from the first row on, here and
/// below: where Eigen starts its packets depends on the address, and with it the last bit.
void AddSixColumns(const double* X, int stride, const double* t, int n, double* out);

/// T of six rows, entry (k, c) at t[k * by_row + c * by_column].
struct SixRows {
  const double* t;
  std::ptrdiff_t by_row, by_column;
};

/// out += X T, X of n rows and six columns `stride` apart, columns of `out` out_stride apart.
void AddSixTimesSix(const double* X, int stride, int n, SixRows T, int columns, double* out,
                    std::ptrdiff_t out_stride);

struct PortRows {
  const double* Y = nullptr;  // freedoms x 6
  int stride = 0;
  int begin = 0, freedoms = 0;  // of d
  // A foot has its leg's and, with those of other legs between them, the base's.
  const double* Y_apart = nullptr;  // freedoms_apart x 6, of the same stride
  int begin_apart = 0, freedoms_apart = 0;
  int row = 0;                          // in the stacked velocities
  int first_pair = -1;                  // that it is one of; the others by PairRows::next
  const double* by_freedom = nullptr;   // Y again, padded, all freedoms one after another
  Padded6 change = Padded6::Zero();     // Yᵀ d
  Padded6 push = Padded6::Zero();       // impulse on the port
  PaddedBlock S = PaddedBlock::Zero();  // Σ Jᵀ D J
  PaddedBlock W = PaddedBlock::Zero();  // Yᵀ Y
  Padded6 W_diagonal = Padded6::Zero();

  void SetChange(const double* d);
  /// sum += Y wrench
  void AddTo(const Padded6& wrench, double* sum) const;
  /// `by_freedom`, to be kept there: 8 a freedom. And W.
  void SetByFreedom(double* rows);
  /// sum += Y T, T six rows of four wrenches; `sum` freedoms x 4 row by row.
  void AddFourTo(const double* T, double* sum) const;
  /// Yᵀ d of four d at once, d freedoms x 4 row by row: six rows of four.
  void FourChanges(const double* d, double* out) const;
};

}  // namespace fork1s::internal
