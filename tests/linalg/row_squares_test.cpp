#include <gtest/gtest.h>

#include "linalg/row_squares.hpp"
#include "random_matrix.hpp"

namespace fork1s {
namespace {

// Every width from one column to more than two tiles of twelve, anywhere in the matrix; what stands outside is not
// touched.
TEST(RowSquares, AreTheProductOfTheMatrices) {
  std::mt19937 engine(1);
  for (int size = 1; size <= 30; ++size)
    for (int begin = 0; begin <= 5; begin += 5) {
      SCOPED_TRACE(size);
      const int r = begin + size + 2;
      const RowMatrixX Q = testing::RandomMatrix(9, r, engine);
      const WeightedRows of{begin, size, {8, 0, 3, 4}, {2, 0.5, 1, 3}};
      const MatrixX before = testing::RandomMatrix(r, r, engine);
      MatrixX A = before;
      AddRowSquares(Q, of, 0.25, A);
      MatrixX expected = before;
      for (std::size_t i = 0; i < of.rows.size(); ++i)
        for (int k = begin; k < begin + size; ++k)
          for (int l = k; l < begin + size; ++l)
            expected(l, k) += 0.25 * of.weights[i] * Q(of.rows[i], l) * Q(of.rows[i], k);
      EXPECT_LT((A - expected).cwiseAbs().maxCoeff(), 1e-14);
      EXPECT_EQ(MatrixX(A.triangularView<Eigen::StrictlyUpper>()),
                MatrixX(before.triangularView<Eigen::StrictlyUpper>()));
    }
}

}  // namespace
}  // namespace fork1s
