// The largest eigenpairs of a symmetric matrix: all values of its tridiagonal form, and the wanted vectors by
// inverse iteration. Rotating all vectors along costs as much at 40 rows, half as much again at 100, and
// nearly twice as much at 150.
#include <fork1s/linalg/spectrum.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

namespace fork1s {
namespace {

// T - value = P L U with row pivoting: U has three diagonals.
class ShiftedTridiagonal {
 public:
  ShiftedTridiagonal(const VectorX& diagonal, const VectorX& beside, double value, double size)
      : n_(static_cast<std::size_t>(diagonal.size())), u0_(n_), u1_(n_), u2_(n_), l_(n_), swapped_(n_) {
    // A pivot of nothing stands for one of rounding, as the value does for one near by.
    const double least = std::numeric_limits<double>::epsilon() * size;
    double a = diagonal(0) - value, b = n_ > 1 ? beside(0) : 0;  // of the row at hand
    for (std::size_t k = 0; k < n_; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      if (k + 1 == n_) {
        u0_[k] = 1 / (std::abs(a) > least ? a : least);
        break;
      }
      const double c = beside(at), d = diagonal(at + 1) - value, e = k + 2 < n_ ? beside(at + 1) : 0;
      swapped_[k] = std::abs(c) > std::abs(a);
      if (swapped_[k]) {
        u0_[k] = 1 / c, u1_[k] = d, u2_[k] = e;
        l_[k] = a * u0_[k];
        a = b - l_[k] * d;
        b = -l_[k] * e;
      } else {
        u0_[k] = 1 / (std::abs(a) > least ? a : least);
        u1_[k] = b, u2_[k] = 0;
        l_[k] = c * u0_[k];
        a = d - l_[k] * b;
        b = e;
      }
    }
  }
  void SolveInPlace(VectorX& x) const {
    for (std::size_t k = 0; k + 1 < n_; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      if (swapped_[k]) std::swap(x(at), x(at + 1));
      x(at + 1) -= l_[k] * x(at);
    }
    for (std::size_t k = n_; k-- > 0;) {
      const auto at = static_cast<Eigen::Index>(k);
      double sum = x(at);
      if (k + 1 < n_) sum -= u1_[k] * x(at + 1);
      if (k + 2 < n_) sum -= u2_[k] * x(at + 2);
      x(at) = sum * u0_[k];
    }
  }

 private:
  std::size_t n_;
  std::vector<double> u0_, u1_, u2_, l_;  // one over the diagonal of U, its other two, L
  std::vector<char> swapped_;
};

VectorX TimesTridiagonal(const VectorX& diagonal, const VectorX& beside, const VectorX& x) {
  const Eigen::Index n = x.size();
  VectorX y = diagonal.cwiseProduct(x);
  y.head(n - 1) += beside.cwiseProduct(x.tail(n - 1));
  y.tail(n - 1) += beside.cwiseProduct(x.head(n - 1));
  return y;
}

// Numbers in [-1, 1) in no order, the same every time.
VectorX Scattered(Eigen::Index n, std::uint32_t seed) {
  VectorX x(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    seed = seed * 1664525u + 1013904223u;
    x(i) = static_cast<double>(seed >> 8) / 8388608.0 - 1;
  }
  return x;
}

void TakeOut(const MatrixX& Y, Eigen::Index first, VectorX& y) {
  for (int pass = 0; pass < 2; ++pass)
    for (Eigen::Index k = first; k < Y.cols(); ++k) y -= Y.col(k).dot(y) * Y.col(k);
}

// Vectors of the last values(...) in Y's columns. False where one does not come to rounding.
bool Vectors(const VectorX& diagonal, const VectorX& beside, const VectorX& values, MatrixX& Y) {
  const Eigen::Index n = diagonal.size(), count = Y.cols();
  const double size = values.cwiseAbs().maxCoeff();
  for (Eigen::Index k = count; k-- > 0;) {
    const double value = values(n - count + k);
    const ShiftedTridiagonal shifted(diagonal, beside, value, size);
    VectorX y = Scattered(n, static_cast<std::uint32_t>(k + 1));
    bool found = false;
    for (int i = 0; i < 5 && !found; ++i) {
      TakeOut(Y, k + 1, y);
      shifted.SolveInPlace(y);
      y /= y.cwiseAbs().maxCoeff();  // of any size
      TakeOut(Y, k + 1, y);
      y.normalize();
      const double off = (TimesTridiagonal(diagonal, beside, y) - value * y).cwiseAbs().maxCoeff();
      found = i > 0 && off < 1e-15 * static_cast<double>(n) * size;
    }
    if (!found) return false;
    Y.col(k) = y;
  }
  return true;
}

}  // namespace

SymmetricSpectrum LargestOf(const MatrixX& symmetric, int count) {
  const Eigen::Index n = symmetric.rows();
  if (n > 2 && 3 * count < n && symmetric.allFinite()) {
    const Eigen::Tridiagonalization<MatrixX> form(symmetric);
    const VectorX diagonal = form.diagonal(), beside = form.subDiagonal();
    Eigen::SelfAdjointEigenSolver<MatrixX> all;
    all.computeFromTridiagonal(diagonal, beside, Eigen::EigenvaluesOnly);
    MatrixX Y(n, count);
    if (all.info() == Eigen::Success && Vectors(diagonal, beside, all.eigenvalues(), Y))
      return {all.eigenvalues().tail(count), form.matrixQ() * Y};
  }
  SymmetricSpectrum all = SpectrumOf(symmetric);
  return {all.values.tail(count), all.vectors.rightCols(count)};
}

}  // namespace fork1s
