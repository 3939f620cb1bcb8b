// Factors and solvers against products, and no allocation where a step uses them.
#include <gtest/gtest.h>
#include <allocation_counter.hpp>

#include <cmath>
#include <random>
#include <string>

#include "linalg/cholesky.hpp"
#include "linalg/in_place.hpp"
#include "linalg/solve.hpp"
#include "linalg/spectrum.hpp"
#include "random_matrix.hpp"

namespace fork1s {
namespace {

using testing::RandomMatrix;

MatrixX Positive(Eigen::Index n, std::mt19937& engine) {
  const MatrixX B = RandomMatrix(n, n, engine);
  return B * B.transpose() + 0.1 * MatrixX::Identity(n, n);
}

// Condition numbers of these matrices stay below 1e4.
constexpr double kRounding = 1e-11;

TEST(InverseRoot, SquaresToTheInverse) {
  std::mt19937 engine(2);
  const Matrix6 A = Positive(6, engine);
  const Matrix6 Y = InverseRoot(A);
  EXPECT_LT((Y.transpose() * Y * A - Matrix6::Identity()).norm(), kRounding);
  EXPECT_TRUE(InverseRoot(Matrix6(-A)).hasNaN());
}

TEST(PositivePart, KeepsPositiveEigenvaluesAlone) {
  std::mt19937 engine(3);
  const Matrix3 A = Positive(3, engine);
  EXPECT_LT((PositivePart(A) - A).norm(), kRounding);
  EXPECT_LT(PositivePart(Matrix3(-A)).norm(), kRounding);
  const Vector3 v = Vector3(1, 2, -2) / 3;  // of one eigenvalue
  EXPECT_LT(
      (PositivePart(2 * v * v.transpose() - 5 * Vector3(2, 1, 2) / 3 * Vector3(2, 1, 2).transpose() / 3) -
       2 * v * v.transpose())
          .norm(),
      kRounding);
}

TEST(Cholesky, SolvesWithoutAllocating) {
  std::mt19937 engine(1);
  for (const Eigen::Index n : {1, 2, 7, 40}) {
    const MatrixX A = Positive(n, engine);
    Cholesky factor;
    ASSERT_TRUE(factor.Compute(A));
    const VectorX b = RandomMatrix(n, 1, engine);
    VectorX x = b;
    MatrixX X = b;
    const long before = testing::allocations.load();
    ASSERT_TRUE(factor.Compute(A));
    factor.SolveInPlace(x);
    EXPECT_EQ(testing::allocations.load(), before);
    factor.SolveInPlace(X);
    EXPECT_LT((A * x - b).norm(), kRounding * b.norm());
    EXPECT_LT((X - x).norm(), kRounding * x.norm());
  }
  Cholesky factor;
  EXPECT_FALSE(factor.Compute(-MatrixX::Identity(3, 3)));
  EXPECT_FALSE(factor.ok());
  EXPECT_TRUE(factor.Compute(MatrixX(0, 0)));
}

// Blocks go by three ways, tiny, of padded registers, and Eigen's: every size on either side of where they meet, full
// and as legs on a base. Nothing above the diagonal is read, nor what stands beside the block.
TEST(Cholesky, BlocksOfAnySize) {
  std::mt19937 engine(6);
  for (int n = 1; n <= 41; ++n)
    for (const bool legs : {false, true})
      for (const bool last_first : {false, true}) {
        SCOPED_TRACE(std::to_string(n) + (legs ? ", legs" : ", full") + (last_first ? ", last first" : ""));
        MatrixX own = Positive(n, engine);
        if (legs)
          for (int i = 6; i < n; ++i)
            for (int j = 6; j < n; ++j)
              if (i / 3 != j / 3) own(i, j) = 0;
        own.diagonal().array() += legs ? own.cwiseAbs().rowwise().sum().maxCoeff() : 0;
        MatrixX A = MatrixX::Constant(n + 2, n + 2, std::nan(""));
        A.diagonal().setOnes();
        A.block(1, 1, n, n).triangularView<Eigen::Lower>() = own;
        Cholesky factor;
        factor.Divide({{0, 1}, {1, n}, {n + 1, 1}}, last_first);
        ASSERT_TRUE(factor.Compute(A));
        const VectorX b = RandomMatrix(n + 2, 1, engine);
        VectorX x = b;
        factor.SolveInPlace(x);
        EXPECT_LT((own * x.segment(1, n) - b.segment(1, n)).norm(), kRounding * b.norm());
        A(1 + n / 2, 1 + n / 2) = -1;
        EXPECT_FALSE(factor.Compute(A));
        A(1 + n / 2, 1 + n / 2) = std::nan("");
        EXPECT_FALSE(factor.Compute(A));
      }
}

TEST(Cholesky, ReadsNothingBetweenItsBlocks) {
  std::mt19937 engine(5);
  const std::vector<DiagonalBlock> blocks{{0, 3}, {3, 1}, {4, 6}, {10, 40}};  // small ones and one of Eigen's
  MatrixX A = MatrixX::Constant(50, 50, std::nan("")), whole = MatrixX::Zero(50, 50);
  for (const DiagonalBlock& b : blocks)
    A.block(b.begin, b.begin, b.size, b.size) = whole.block(b.begin, b.begin, b.size, b.size) =
        Positive(b.size, engine);
  const VectorX b = RandomMatrix(50, 1, engine);
  for (const bool last_first : {false, true}) {
    Cholesky factor;
    factor.Divide(blocks, last_first);
    ASSERT_TRUE(factor.Compute(A));
    VectorX x = b;
    const long before = testing::allocations.load();
    ASSERT_TRUE(factor.Compute(A));
    factor.SolveInPlace(x);
    EXPECT_EQ(testing::allocations.load(), before);
    EXPECT_LT((whole * x - b).norm(), kRounding * b.norm());
    MatrixX X = b;
    factor.SolveInPlace(X);
    EXPECT_LT((X - x).norm(), kRounding * x.norm());
  }
  Cholesky factor;
  factor.Divide(blocks);
  A(3, 3) = -1;
  EXPECT_FALSE(factor.Compute(A));
}

// A base couples its legs, which are independent of each other: from the last to the first nothing else fills
// in.
TEST(Cholesky, LegsStayApartFromTheLastToTheFirst) {
  std::mt19937 engine(7);
  MatrixX A = Positive(6 + 4 * 3, engine);
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      if (i != j) A.block<3, 3>(6 + 3 * i, 6 + 3 * j).setZero();
  A.diagonal().array() += 20;
  Cholesky factor;
  factor.Divide({{0, 18}}, true);
  ASSERT_TRUE(factor.Compute(A));
  // Legs come first there, the base last.
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < i; ++j) {
      if (i / 3 != j / 3) {
        EXPECT_EQ(factor.L()(i, j), 0) << i << " " << j;
      }
    }
  MatrixX L = factor.L().triangularView<Eigen::Lower>();
  EXPECT_LT((L * L.transpose() - MatrixX(A.reverse())).norm(), kRounding * A.norm());
}

TEST(InPlace, LuSolvesForwardTransposedAndByRows) {
  std::mt19937 engine(6);
  for (const int n : {1, 2, 3, 4, 5, 8, 17, 48}) {
    MatrixX A = RandomMatrix(n, n, engine);
    if (n > 4) A.topRightCorner(n / 2, n - n / 2).setZero();  // columns that a pivot leaves as they are
    MatrixX LU = A;
    std::vector<int> pivots(static_cast<std::size_t>(n));
    ASSERT_TRUE(FactorLu(LU.data(), n, pivots.data()));
    const VectorX b = RandomMatrix(n, 1, engine);
    // Condition numbers of random matrices of this size stay below 1e5.
    VectorX x = b;
    SolveWithLu(LU.data(), n, pivots.data(), x.data());
    EXPECT_LT((A * x - b).norm(), 1e-10 * b.norm()) << n;
    VectorX y = b;
    SolveTransposedWithLu(LU.data(), n, pivots.data(), y.data());
    EXPECT_LT((A.transpose() * y - b).norm(), 1e-10 * b.norm()) << n;
    for (const int columns : {8, 13, 22, 29}) {  // taken by sixteens, twelves, eights, fours and ones
      RowMatrixX rows = RandomMatrix(n, columns, engine);
      const MatrixX right = rows;
      SolveRowsWithLu(LU.data(), n, pivots.data(), columns, rows.data());
      EXPECT_LT((A * rows - right).norm(), 1e-10 * right.norm()) << n << " " << columns;
    }
  }
  for (const int n : {1, 3, 6, 11}) {
    const MatrixX L = RandomMatrix(n, n, engine) + 3 * MatrixX::Identity(n, n);
    MatrixX Y = RandomMatrix(n + 2, 7, engine), right = Y;  // a four and three, not without gaps
    Y.topRows(n / 2).leftCols(4).setZero();
    right = Y;
    SolveLower(L.data(), n, n, Y.data(), 7, n + 2);
    const MatrixX lower = L.triangularView<Eigen::Lower>();
    EXPECT_LT((lower * Y.topRows(n) - right.topRows(n)).norm(), 1e-10 * right.norm()) << n;
    EXPECT_EQ(Y.bottomRows(2), right.bottomRows(2));
    EXPECT_TRUE(Y.topRows(n / 2).leftCols(4).isZero(0));
  }
  MatrixX singular = MatrixX::Zero(3, 3);
  int pivots[3];
  EXPECT_FALSE(FactorLu(singular.data(), 3, pivots));
  MatrixX nan = MatrixX::Constant(3, 3, std::nan(""));
  EXPECT_FALSE(FactorLu(nan.data(), 3, pivots));
}

TEST(InPlace, CholeskyOfEverySizeByItsLowerTriangle) {
  std::mt19937 engine(7);
  for (int n = 1; n <= 22; ++n) {
    const MatrixX A = Positive(n, engine);
    const VectorX x = RandomMatrix(n, 1, engine);
    MatrixX lower = A;
    lower.triangularView<Eigen::StrictlyUpper>().setConstant(std::nan(""));
    MatrixX factor = lower;
    VectorX found = A * x;
    ASSERT_TRUE(FactorCholesky(factor.data(), n)) << n;
    SolveWithCholesky(factor.data(), n, found.data());
    EXPECT_LT((found - x).norm(), kRounding * x.norm()) << n;
    for (int k = 0; k < n; ++k)
      for (const double pivot : {-1.0, std::nan("")}) {
        factor = lower;
        factor(k, k) = pivot;
        EXPECT_FALSE(FactorCholesky(factor.data(), n)) << n << ", pivot " << k;
      }
  }
}

TEST(Cholesky, SixBySix) {
  std::mt19937 engine(2);
  const Matrix6 A = Positive(6, engine);
  const Vector6 b = RandomMatrix(6, 1, engine);
  EXPECT_LT((A * SolvePositive(A, b) - b).norm(), kRounding);
}

TEST(Solve, SymmetricIndefiniteSquareAndComplex) {
  std::mt19937 engine(3);
  for (int trial = 0; trial < 20; ++trial) {
    const MatrixX B = RandomMatrix(9, 9, engine), A = B + B.transpose() + 4 * MatrixX::Identity(9, 9),
                  R = RandomMatrix(9, 3, engine);
    EXPECT_LT((A * SolveSymmetric(A, R) - R).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_LT((A * SolveSquare(A, R) - R).cwiseAbs().maxCoeff(), 1e-8);
    const ComplexMatrix x = SolveComplex({A, B}, {R, 2 * R});
    EXPECT_LT((A * x.re - B * x.im - R).cwiseAbs().maxCoeff(), 1e-8);
    EXPECT_LT((A * x.im + B * x.re - 2 * R).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(Solve, LeastNorm) {
  // x + y = 2 twice: of all solutions (1, 1), of all answers the nearest.
  MatrixX A(2, 2), b(2, 1);
  A << 1, 1, 1, 1;
  b << 1, 3;
  const MatrixX x = LeastNormSolve(A, b, 1e-6);
  EXPECT_NEAR(x(0), 1, 1e-14);
  EXPECT_NEAR(x(1), 1, 1e-14);
  EXPECT_EQ(LeastNormSolve(MatrixX(0, 3), MatrixX(0, 1), 1e-6), MatrixX(MatrixX::Zero(3, 1)));
}

TEST(Solve, SparseOfOnePatternAfterAnother) {
  SparseLu lu;
  for (const double value : {2.0, 5.0}) {
    Eigen::SparseMatrix<double> A(2, 2);
    A.insert(0, 0) = value;
    A.insert(0, 1) = 1;
    A.insert(1, 0) = 1;
    A.insert(1, 1) = 0.0;
    A.makeCompressed();
    ASSERT_TRUE(lu.Compute(A, value > 2));
    EXPECT_LT((MatrixX(A) * lu.Solve(MatrixX::Identity(2, 2)) - MatrixX::Identity(2, 2)).norm(), 1e-14);
  }
}

TEST(Spectrum, ReproducesItsMatrix) {
  std::mt19937 engine(4);
  const MatrixX A = Positive(8, engine), M = Positive(8, engine);
  const SymmetricSpectrum s = SpectrumOf(A);
  EXPECT_LT((s.vectors * s.values.asDiagonal() * s.vectors.transpose() - A).norm(), 1e-12);
  EXPECT_LT((EigenvaluesOf(A) - s.values).norm(), 1e-12);
  // det(A - µ M) = 0 for every generalized eigenvalue: the least singular value vanishes.
  for (const double mu : EigenvaluesOf(A, M)) EXPECT_LT(SingularValues(A - mu * M).minCoeff(), 1e-9);
  EXPECT_LT((PrincipalValues(Matrix3(Vector3(3, 1, 2).asDiagonal())) - Vector3(1, 2, 3)).norm(), 1e-14);
  const MatrixX B = RandomMatrix(5, 5, engine);
  const GeneralSpectrum g = GeneralSpectrumOf(B);
  EXPECT_LT((B.cast<std::complex<double>>() * g.vectors - g.vectors * g.values.asDiagonal()).norm(), 1e-12);
}

TEST(Spectrum, LanczosFindsTheLargest) {
  const int n = 400;
  VectorX diagonal(n);
  for (int i = 0; i < n; ++i) diagonal(i) = 1 / std::pow(i + 1.0, 4);
  VectorX values;
  MatrixX vectors;
  ASSERT_TRUE(LargestEigenpairs(
      [&](const double* x, double* y) {
        for (int i = 0; i < n; ++i) y[i] = diagonal(i) * x[i];
      },
      n, 4, values, vectors));
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(values(i), diagonal(i), 1e-12);
}

}  // namespace
}  // namespace fork1s
