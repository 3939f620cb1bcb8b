#include "linalg/solve.hpp"

#include <Eigen/LU>
#include <Eigen/QR>

namespace fork1s {

MatrixX SolveSquare(const MatrixX& A, const MatrixX& B) {
  if (A.size() == 0) return MatrixX(0, B.cols());
  return Eigen::PartialPivLU<MatrixX>(A).solve(B);
}

ComplexMatrix SolveComplex(const ComplexMatrix& A, const ComplexMatrix& B) {
  const Eigen::Index n = A.re.rows(), columns = B.re.cols();
  MatrixX both(2 * n, 2 * n), right(2 * n, columns);
  both << A.re, -A.im, A.im, A.re;
  right << B.re, B.im;
  const MatrixX x = SolveSquare(both, right);
  return {x.topRows(n), x.bottomRows(n)};
}

struct LuFactor::Detail {
  // What PartialPivLU does not show: its row swaps.
  class LuWithSwaps : public Eigen::PartialPivLU<MatrixX> {
   public:
    const TranspositionType& swaps() const { return m_rowsTranspositions; }
  };
  LuWithSwaps lu;

  template <class Matrix>
  void SolveInPlace(Matrix& x) const {
    const MatrixX& LU = lu.matrixLU();
    if (LU.size() == 0) return;
    // Row swaps one by one: a product with the permutation would need a second x.
    const auto& swaps = lu.swaps().indices();
    for (Eigen::Index i = 0; i < swaps.size(); ++i)
      if (swaps(i) != i) x.row(i).swap(x.row(swaps(i)));
    LU.template triangularView<Eigen::UnitLower>().solveInPlace(x);
    LU.template triangularView<Eigen::Upper>().solveInPlace(x);
  }
};

LuFactor::LuFactor() : detail_(std::make_unique<Detail>()) {}
LuFactor::~LuFactor() = default;
LuFactor::LuFactor(const LuFactor& other) : detail_(std::make_unique<Detail>(*other.detail_)) {}
LuFactor& LuFactor::operator=(const LuFactor& other) {
  *detail_ = *other.detail_;
  return *this;
}
LuFactor::LuFactor(LuFactor&&) noexcept = default;
LuFactor& LuFactor::operator=(LuFactor&&) noexcept = default;

void LuFactor::Compute(const MatrixX& A) {
  if (A.size() > 0) detail_->lu.compute(A);
}

void LuFactor::SolveInPlace(VectorX& x) const { detail_->SolveInPlace(x); }
void LuFactor::SolveInPlace(MatrixX& x) const { detail_->SolveInPlace(x); }

MatrixX LeastNormSolve(const MatrixX& A, const MatrixX& B, double threshold) {
  if (A.size() == 0) return MatrixX::Zero(A.cols(), B.cols());
  Eigen::CompleteOrthogonalDecomposition<MatrixX> decomposition;
  decomposition.setThreshold(threshold);
  decomposition.compute(A);
  return decomposition.solve(B);
}

}  // namespace fork1s
