#include "linalg/cholesky.hpp"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <type_traits>
#include <utility>

namespace fork1s {

bool CholeskyInPlace(Eigen::Ref<MatrixX> A) {
  const Eigen::LLT<Eigen::Ref<MatrixX>> llt(A);
  return llt.info() == Eigen::Success && A.diagonal().allFinite();  // Eigen takes a pivot that is no number
}

namespace {

// Up to here plain loops cost less than setting up blocked ones.
constexpr int kSmall = 32;

// Of blocks up to here, a finger's or a body's, every size has its own code: loops cost more than what they do.
constexpr int kTiny = 6;

// f(k) for k from `first` up to `end`, each k known as it is compiled, so that what f keeps stays in registers.
// Left to itself the compiler makes loops of it that take six times the instructions.
template <int first, int end, class F>
inline void Each(const F& f) {
  [&]<int... k>(std::integer_sequence<int, k...>) {
    (f(std::integral_constant<int, first + k>()), ...);
  }(std::make_integer_sequence<int, end - first>());
}

// L of a block that begins at A, or with `last_first` of it with its rows and columns from the last to the first.
// Columns are of_A and of_L apart; what stands above the diagonals is neither read nor written.
template <int n, bool last_first>
bool FactorTiny(const double* A, std::ptrdiff_t of_A, double* L, std::ptrdiff_t of_L) {
  double a[n][n];
  Each<0, n>([&](auto k) {
    Each<k, n>([&](auto i) { a[k][i] = last_first ? A[(n - 1 - i) * of_A + n - 1 - k] : A[k * of_A + i]; });
  });
  bool ok = true;
  Each<0, n>([&](auto k) {
    ok = ok && a[k][k] > 0 && std::isfinite(a[k][k]);
    if (!ok) return;
    a[k][k] = std::sqrt(a[k][k]);
    const double inverse = 1 / a[k][k];
    Each<k + 1, n>([&](auto i) { a[k][i] *= inverse; });
    Each<k + 1, n>([&](auto j) { Each<j, n>([&](auto i) { a[j][i] -= a[k][j] * a[k][i]; }); });
  });
  if (!ok) return false;
  Each<0, n>([&](auto k) { Each<k, n>([&](auto i) { L[k * of_L + i] = a[k][i]; }); });
  return true;
}

template <int n, bool last_first>
void SolveTiny(const double* L, std::ptrdiff_t stride, double* x) {
  constexpr auto place = [](int k) { return last_first ? n - 1 - k : k; };
  double y[n];
  Each<0, n>([&](auto k) { y[k] = x[place(k)]; });
  Each<0, n>([&](auto k) {
    y[k] /= L[k * stride + k];
    Each<k + 1, n>([&](auto i) { y[i] -= L[k * stride + i] * y[k]; });
  });
  Each<0, n>([&](auto left) {
    constexpr int k = n - 1 - left;
    Each<k + 1, n>([&](auto i) { y[k] -= L[k * stride + i] * y[i]; });
    y[k] /= L[k * stride + k];
  });
  Each<0, n>([&](auto k) { x[place(k)] = y[k]; });
}

// By size.
template <bool last_first>
constexpr bool (*kFactorTiny[])(const double*, std::ptrdiff_t, double*, std::ptrdiff_t) = {
    nullptr,
    FactorTiny<1, last_first>,
    FactorTiny<2, last_first>,
    FactorTiny<3, last_first>,
    FactorTiny<4, last_first>,
    FactorTiny<5, last_first>,
    FactorTiny<6, last_first>};
template <bool last_first>
constexpr void (*kSolveTiny[])(const double*, std::ptrdiff_t, double*) = {nullptr,
                                                                          SolveTiny<1, last_first>,
                                                                          SolveTiny<2, last_first>,
                                                                          SolveTiny<3, last_first>,
                                                                          SolveTiny<4, last_first>,
                                                                          SolveTiny<5, last_first>,
                                                                          SolveTiny<6, last_first>};
static_assert(std::size(kFactorTiny<true>) == kTiny + 1 && std::size(kSolveTiny<true>) == kTiny + 1);

// The same in place by columns padded to whole registers, each from those before it: of 24 rows in half the
// instructions.
bool FactorBlock(double* L, std::ptrdiff_t stride, int n) {
  using Lane = Eigen::Array4d;
  const auto lane = [](auto* at) {
    using Entry = std::remove_pointer_t<decltype(at)>;
    return Eigen::Map<std::conditional_t<std::is_const_v<Entry>, const Lane, Lane>, Eigen::Aligned32>(at);
  };
  alignas(32) std::array<double, static_cast<std::size_t>(kSmall) * kSmall> padded;
  std::array<const double*, kSmall> columns;  // those before j that have something in row j
  std::array<double, kSmall> factors;
  const int rows = (n + 3) / 4 * 4;
  for (int j = 0; j < n; ++j) {
    double* const column = padded.data() + j * kSmall;
    double* const to = L + j * stride;
    const int first = j / 4 * 4;
    lane(column + first).setZero();
    lane(column + rows - 4).setZero();
    for (int i = j; i < n; ++i) column[i] = to[i];
    std::size_t count = 0;
    for (int k = 0; k < j; ++k) {
      columns[count] = padded.data() + k * kSmall;
      factors[count] = columns[count][j];
      count += factors[count] != 0 ? 1 : 0;
    }
    int i = first;
    for (; i + 8 <= rows; i += 8) {
      Lane upper = lane(column + i), lower = lane(column + i + 4);
      for (std::size_t c = 0; c < count; ++c) {
        upper -= factors[c] * lane(columns[c] + i);
        lower -= factors[c] * lane(columns[c] + i + 4);
      }
      lane(column + i) = upper;
      lane(column + i + 4) = lower;
    }
    if (i < rows) {
      Lane last = lane(column + i);
      for (std::size_t c = 0; c < count; ++c) last -= factors[c] * lane(columns[c] + i);
      lane(column + i) = last;
    }
    if (!(column[j] > 0) || !std::isfinite(column[j])) return false;
    const double root = std::sqrt(column[j]), inverse = 1 / root;
    for (int l = first; l < rows; l += 4) lane(column + l) *= inverse;
    column[j] = root;
    for (int l = j; l < n; ++l) to[l] = column[l];
  }
  return true;
}

// L <- the lower triangle of A, or of A with rows and columns from the last to the first.
void CopyLower(const double* A, std::ptrdiff_t of_A, int n, bool last_first, double* __restrict L,
               std::ptrdiff_t of_L) {
  for (int j = 0; j < n; ++j) {
    double* __restrict to = L + j * of_L;
    if (last_first) {
      const double* row = A + (n - 1 - j);
      for (int i = j; i < n; ++i) to[i] = row[(n - 1 - i) * of_A];
    } else {
      for (int i = j; i < n; ++i) to[i] = A[i + j * of_A];
    }
  }
}

void SolveBlock(const double* L, std::ptrdiff_t stride, int n, double* __restrict x) {
  for (int k = 0; k < n; ++k) {
    const double* __restrict lk = L + k * stride;
    const double value = x[k] /= lk[k];
    if (value == 0) continue;
    for (int i = k + 1; i < n; ++i) x[i] -= lk[i] * value;
  }
  for (int k = n - 1; k >= 0; --k) {
    const double* lk = L + k * stride;
    double sum = x[k];
    for (int i = k + 1; i < n; ++i) sum -= lk[i] * x[i];
    x[k] = sum / lk[k];
  }
}

}  // namespace

bool Cholesky::Compute(const MatrixX& A) {
  if (blocks_.empty()) {
    L_ = A;
    ok_ = L_.size() == 0 || CholeskyInPlace(L_);
    return ok_;
  }
  L_.resize(A.rows(), A.cols());
  ok_ = true;
  for (const DiagonalBlock& b : blocks_) {
    if (b.size == 0) continue;
    const double* from = &A(b.begin, b.begin);
    auto L = L_.block(b.begin, b.begin, b.size, b.size);
    if (b.size <= kTiny) {
      const auto factor = last_first_ ? kFactorTiny<true>[b.size] : kFactorTiny<false>[b.size];
      ok_ = factor(from, A.outerStride(), L.data(), L.outerStride()) && ok_;
      continue;
    }
    CopyLower(from, A.outerStride(), b.size, last_first_, L.data(), L.outerStride());
    if (b.size <= kSmall)
      ok_ = FactorBlock(L.data(), L.outerStride(), b.size) && ok_;
    else
      ok_ = CholeskyInPlace(L) && ok_;
  }
  return ok_;
}

void SolveWithLowerInPlace(const Eigen::Ref<const MatrixX>& L, Eigen::Ref<VectorX> x) {
  L.triangularView<Eigen::Lower>().solveInPlace(x);
  L.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void Cholesky::SolveInPlace(VectorX& x) const {
  if (L_.size() == 0) return;
  for (const DiagonalBlock& b : blocks_) {
    if (b.size == 0) continue;
    const auto L = L_.block(b.begin, b.begin, b.size, b.size);
    if (b.size <= kTiny) {
      const auto solve = last_first_ ? kSolveTiny<true>[b.size] : kSolveTiny<false>[b.size];
      solve(L.data(), L.outerStride(), x.data() + b.begin);
      continue;
    }
    const auto reverse = [&] {
      for (double *front = x.data() + b.begin, *back = front + b.size - 1; front < back; ++front, --back)
        std::swap(*front, *back);
    };
    if (last_first_) reverse();
    if (b.size <= kSmall)
      SolveBlock(L.data(), L.outerStride(), b.size, x.data() + b.begin);
    else
      SolveWithLowerInPlace(L, x.segment(b.begin, b.size));
    if (last_first_) reverse();
  }
  if (!blocks_.empty()) return;
  L_.triangularView<Eigen::Lower>().solveInPlace(x);
  L_.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void Cholesky::SolveInPlace(MatrixX& x) const {
  if (L_.size() == 0 || x.cols() == 0) return;
  for (const DiagonalBlock& b : blocks_) {
    const auto L = L_.block(b.begin, b.begin, b.size, b.size).triangularView<Eigen::Lower>();
    auto rows = x.middleRows(b.begin, b.size);
    if (last_first_) rows.colwise().reverseInPlace();
    L.solveInPlace(rows);
    L.transpose().solveInPlace(rows);
    if (last_first_) rows.colwise().reverseInPlace();
  }
  if (!blocks_.empty()) return;
  L_.triangularView<Eigen::Lower>().solveInPlace(x);
  L_.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void Cholesky::SolveLowerInPlace(MatrixX& x) const {
  if (L_.size() > 0 && x.cols() > 0) L_.triangularView<Eigen::Lower>().solveInPlace(x);
}

Vector6 SolvePositive(const Matrix6& A, const Vector6& b) { return A.llt().solve(b); }

Matrix6 InverseRoot(const Matrix6& A) {
  const Eigen::LLT<Matrix6> factor(A);
  if (factor.info() != Eigen::Success) return Matrix6::Constant(std::numeric_limits<double>::quiet_NaN());
  Matrix6 Y = Matrix6::Identity();
  factor.matrixL().solveInPlace(Y);
  return Y;
}

void SymmetricFactor::Compute(const MatrixX& A) {
  const Eigen::LDLT<MatrixX> ldlt(A);
  LD_ = ldlt.matrixLDLT();
  swaps_ = ldlt.transpositionsP().indices();
}

MatrixX SymmetricFactor::Solve(const MatrixX& B) const {
  if (LD_.size() == 0 || B.cols() == 0) return B;
  const Eigen::Transpositions<Eigen::Dynamic> P(swaps_);
  MatrixX x = P * B;
  LD_.triangularView<Eigen::UnitLower>().solveInPlace(x);
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    // As in Eigen: a pivot of zero stands for a direction without load.
    const double d = LD_(i, i);
    if (std::abs(d) > std::numeric_limits<double>::min())
      x.row(i) /= d;
    else
      x.row(i).setZero();
  }
  LD_.triangularView<Eigen::UnitLower>().transpose().solveInPlace(x);
  return P.transpose() * x;
}

MatrixX SolveSymmetric(const MatrixX& A, const MatrixX& B) { return SymmetricFactor(A).Solve(B); }

}  // namespace fork1s
