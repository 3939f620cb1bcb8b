// Bases by elimination, against what decides and decomposes everything.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "linalg/elimination.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "random_matrix.hpp"

namespace fork1s {
namespace {

using testing::RandomMatrix;

double Most(const MatrixX& A) { return A.size() == 0 ? 0 : A.cwiseAbs().maxCoeff(); }

TEST(Elimination, SolvesWhatClearRowsLeave) {
  std::mt19937 engine(11);
  int clear = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const int m = trial % 7, n = m + 1 + trial % 5;
    MatrixX A = RandomMatrix(m, n, engine), Z;
    if (trial % 3 == 0)  // loops depend on few coordinates
      A = (RandomMatrix(m, n, engine).array() > 0.2).select(A, 0.0);
    if (!EliminatedNullSpace(A, Z)) continue;
    ++clear;
    ASSERT_EQ(Z.cols(), n - m);
    EXPECT_LT(Most(Times(A, Z)), 1e-13 * std::max(1.0, Most(Z)));
    const MatrixX unseen = ComputeNullSpace(A).unseen;
    ASSERT_EQ(unseen.cols(), n - m);
    EXPECT_LT(Most(Z - Times(unseen, TransposedTimes(unseen, Z))), 1e-12 * Most(Z));
  }
  EXPECT_GT(clear, 40);
}

TEST(Elimination, LeavesWhatIsNotClear) {
  std::mt19937 engine(12);
  for (const double apart : {0.0, 1e-14, 1e-9, 1e-6, 1e-5}) {
    MatrixX A = RandomMatrix(5, 9, engine), Z;
    A.row(3) = A.row(0) - 0.5 * A.row(4) + apart * A.row(3);
    EXPECT_FALSE(EliminatedNullSpace(A, Z)) << apart;
  }
  MatrixX square = RandomMatrix(4, 4, engine), Z;
  EXPECT_FALSE(EliminatedNullSpace(square, Z));
}

TEST(Elimination, RootsMakeColumnsOrthonormalInTwoPasses) {
  std::mt19937 engine(13);
  for (const double scale : {1.0, 1e3, 1e5}) {
    const MatrixX A = RandomMatrix(12, 7, engine);
    MatrixX B = A;
    for (int k = 0; k < 7; ++k) B.col(k) *= std::pow(scale, k / 6.0);
    MatrixX Z = MatrixX::Identity(7, 7);
    EXPECT_GT(DivideByRoot(B, Z), 0.1);
    EXPECT_LT(DivideByRoot(Times(B, Z), Z), 1e-3);
    const MatrixX orthonormal = Times(B, Z);
    EXPECT_LT(Most(TransposedTimes(orthonormal, orthonormal) - MatrixX::Identity(7, 7)), 1e-13);
  }
  MatrixX singular = RandomMatrix(6, 3, engine), Z = MatrixX::Identity(3, 3);
  singular.col(2).setZero();
  EXPECT_FALSE(std::isfinite(DivideByRoot(singular, Z)));
  EXPECT_EQ(Z, MatrixX::Identity(3, 3));
}

TEST(Elimination, DifferenceOfSquares) {
  std::mt19937 engine(14);
  for (const int n : {1, 2, 7, 30}) {
    const MatrixX A = RandomMatrix(n, 5, engine), B = RandomMatrix(n, 3, engine);
    EXPECT_LT(Most(DifferenceOfSquares(A, B) - (TimesTransposed(A, A) - TimesTransposed(B, B))), 1e-14 * 20);
  }
}

}  // namespace
}  // namespace fork1s
