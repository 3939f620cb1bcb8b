// Linear equations without symmetry, square or not.
#pragma once

#include <fork1s/base/types.hpp>
#include <memory>
#include <vector>

#include <Eigen/SparseCore>

namespace fork1s {

/// A⁻¹ B by LU with row pivoting; not finite where A is singular.
MatrixX SolveSquare(const MatrixX& A, const MatrixX& B);

/// re + i im. Kept apart, since a compiler makes every product and sum of complex matrices again.
struct ComplexMatrix {
  MatrixX re, im;
};
/// A⁻¹ B, as real equations of twice the size.
ComplexMatrix SolveComplex(const ComplexMatrix& A, const ComplexMatrix& B);

/// P A = L U with row pivoting. Holds its storage: computing and solving for a size it had before do not
/// allocate.
class LuFactor {
 public:
  LuFactor();
  ~LuFactor();
  LuFactor(const LuFactor& other);
  LuFactor& operator=(const LuFactor& other);
  LuFactor(LuFactor&&) noexcept;
  LuFactor& operator=(LuFactor&&) noexcept;
  void Compute(const MatrixX& A);
  /// x <- A⁻¹ x
  void SolveInPlace(VectorX& x) const;
  void SolveInPlace(MatrixX& x) const;

 private:
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

/// Of all X that bring A X nearest to B the smallest. Pivots of the QR decomposition below `threshold` of the
/// largest count as zero: kRankThreshold for matrices in one unit.
MatrixX LeastNormSolve(const MatrixX& A, const MatrixX& B, double threshold);

/// LU of a sparse matrix. With one pattern after another the fill-reducing order is found once.
class SparseLu {
 public:
  SparseLu();
  ~SparseLu();
  SparseLu(SparseLu&&) noexcept;
  SparseLu& operator=(SparseLu&&) noexcept;
  /// False where A is singular. `same_pattern`: entries stand where those of the last call stood.
  bool Compute(const Eigen::SparseMatrix<double>& A, bool same_pattern);
  MatrixX Solve(const MatrixX& B) const;

 private:
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
