// Six numbers of a twist or wrench with two zeros behind them: two registers of four.
#pragma once

#include <fork1s/base/quad.hpp>

namespace fork1s::internal {

using Padded6 = Eigen::Matrix<double, 8, 1>;
using PaddedRows = Eigen::Matrix<double, 8, 3>;   // three rows of six, one a column
using PaddedBlock = Eigen::Matrix<double, 8, 6>;  // 6 x 6

inline void PadRows(const Matrix36& J, PaddedRows& out) {
  for (int k = 0; k < 3; ++k)
    for (int c = 0; c < 6; ++c) out(c, k) = J(k, c);
}

/// Columns are a point's axes on the angular part of a twist.
inline Eigen::Block<const PaddedRows, 3, 3> AxesOf(const PaddedRows& rows) { return rows.block<3, 3>(3, 0); }

/// out += rows x
inline void AddRows(const PaddedRows& rows, const Vector3& x, Padded6& out) {
  const double* r = rows.data();
  Quad low = QuadAt(out.data()), high = QuadAt(out.data() + 4);
  for (int k = 0; k < 3; ++k) {
    low += x[k] * QuadAt(r + 8 * k);
    high += x[k] * QuadAt(r + 8 * k + 4);
  }
  QuadAt(out.data()) = low;
  QuadAt(out.data() + 4) = high;
}

/// rows D, D of three columns
inline PaddedRows RowsTimes(const PaddedRows& rows, const Matrix3& D) {
  PaddedRows out;
  const double* r = rows.data();
  for (int k = 0; k < 3; ++k)
    for (int half = 0; half < 8; half += 4) {
      Quad sum = D(0, k) * QuadAt(r + half);
      sum += D(1, k) * QuadAt(r + 8 + half);
      sum += D(2, k) * QuadAt(r + 16 + half);
      QuadAt(out.data() + 8 * k + half) = sum;
    }
  return out;
}

/// S += left rightᵀ
inline void AddProduct(const PaddedRows& left, const PaddedRows& right, PaddedBlock& S) {
  const double *l = left.data(), *r = right.data();
  const Quad l0 = QuadAt(l), h0 = QuadAt(l + 4), l1 = QuadAt(l + 8), h1 = QuadAt(l + 12), l2 = QuadAt(l + 16),
             h2 = QuadAt(l + 20);
  for (int c = 0; c < 6; ++c) {
    double* s = S.data() + 8 * c;
    const double r0 = r[c], r1 = r[c + 8], r2 = r[c + 16];
    Quad low = QuadAt(s) + r0 * l0, high = QuadAt(s + 4) + r0 * h0;
    low += r1 * l1;
    high += r1 * h1;
    low += r2 * l2;
    high += r2 * h2;
    QuadAt(s) = low;
    QuadAt(s + 4) = high;
  }
}

/// Sums of rowᵀ W row, and of the same without what stands beside the diagonal.
inline void AddTraces(const PaddedRows& rows, const PaddedBlock& W, const Padded6& diagonal, Quad& trace,
                      Quad& of_diagonal) {
  const double *w = W.data(), *d = diagonal.data();
  for (int k = 0; k < 3; ++k) {
    const double* r = rows.data() + 8 * k;
    const Quad low = QuadAt(r), high = QuadAt(r + 4);
    Quad W_low = r[0] * QuadAt(w), W_high = r[0] * QuadAt(w + 4);
    for (int c = 1; c < 6; ++c) {
      W_low += r[c] * QuadAt(w + 8 * c);
      W_high += r[c] * QuadAt(w + 8 * c + 4);
    }
    trace += low.cwiseProduct(W_low);
    trace += high.cwiseProduct(W_high);
    of_diagonal += low.cwiseProduct(low).cwiseProduct(QuadAt(d));
    of_diagonal += high.cwiseProduct(high).cwiseProduct(QuadAt(d + 4));
  }
}

/// rowsᵀ x, but for what is left to be summed within the four.
struct ThreeSums {
  Quad s[3] = {Quad::Zero(), Quad::Zero(), Quad::Zero()};
  void Add(const PaddedRows& rows, const Padded6& x) {
    const double* r = rows.data();
    const Quad low = QuadAt(x.data()), high = QuadAt(x.data() + 4);
    for (int k = 0; k < 3; ++k) {
      s[k] += QuadAt(r + 8 * k).cwiseProduct(low);
      s[k] += QuadAt(r + 8 * k + 4).cwiseProduct(high);
    }
  }
  Vector3 Sum() const { return {s[0].sum(), s[1].sum(), s[2].sum()}; }
};

}  // namespace fork1s::internal
