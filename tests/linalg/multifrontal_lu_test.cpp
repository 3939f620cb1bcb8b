// LU of random block structures against Eigen's dense LU.
#include <gtest/gtest.h>

#include <fork1s/linalg/multifrontal_lu.hpp>
#include <random>
#include <utility>
#include <vector>

#include "linalg/solve.hpp"
#include "random_matrix.hpp"

namespace fork1s {
namespace {

using testing::RandomMatrix;

struct BlockMatrix {
  std::vector<int> sizes, first;
  std::vector<std::pair<int, int>> couplings;
  MatrixX A;
};

// Random sizes and places. `dominance` times the identity is added to the diagonal blocks.
BlockMatrix RandomBlocks(int blocks, double density, double dominance, std::mt19937& engine) {
  BlockMatrix out;
  int rows = 0;
  for (int i = 0; i < blocks; ++i) {
    out.first.push_back(rows);
    out.sizes.push_back(1 + static_cast<int>(engine() % 6));
    rows += out.sizes.back();
  }
  out.A = MatrixX::Zero(rows, rows);
  std::uniform_real_distribution<double> chance(0, 1);
  for (int i = 0; i < blocks; ++i)
    for (int j = 0; j < blocks; ++j) {
      if (i != j && chance(engine) > density) continue;
      out.couplings.emplace_back(i, j);
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      auto block = out.A.block(out.first[a], out.first[b], out.sizes[a], out.sizes[b]);
      block = RandomMatrix(out.sizes[a], out.sizes[b], engine);
      if (i == j) block.diagonal().array() += dominance;
    }
  return out;
}

bool Factor(const BlockMatrix& from, MultifrontalLu& lu) {
  lu.ClearFill();
  for (const auto& [i, j] : from.couplings) {
    const MultifrontalLu::Place place = lu.PlaceOf(i, j);
    const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
    for (int c = 0; c < from.sizes[b]; ++c)
      for (int r = 0; r < from.sizes[a]; ++r)
        lu.values()[place.begin + static_cast<std::size_t>(c * place.stride + r)] =
            from.A(from.first[a] + r, from.first[b] + c);
  }
  return lu.Factor();
}

TEST(MultifrontalLu, SolvesAsDenseLuDoes) {
  std::mt19937 engine(11);
  for (const double density : {0.0, 0.05, 0.15, 0.4, 1.0})
    for (const int blocks : {1, 2, 5, 12, 20})
      for (int trial = 0; trial < 6; ++trial) {
        // Diagonally dominant by rows or nearly so, so that the condition number is small.
        const BlockMatrix from = RandomBlocks(blocks, density, 8 * (1 + blocks * density), engine);
        MultifrontalLu lu(from.sizes, from.couplings);
        const Eigen::Index n = from.A.rows();
        for (int again = 0; again < 2; ++again) {  // what a factor overwrites does not remain in the next
          ASSERT_TRUE(Factor(from, lu));
          const VectorX b = RandomMatrix(static_cast<int>(n), 1, engine);
          VectorX x = b, y = b;
          lu.Solve(x.data());
          lu.SolveTransposed(y.data());
          const VectorX x_dense = SolveSquare(from.A, b), y_dense = SolveSquare(from.A.transpose(), b);
          EXPECT_LT((x - x_dense).norm(), 1e-13 * x_dense.norm()) << blocks << " " << density;
          EXPECT_LT((y - y_dense).norm(), 1e-13 * y_dense.norm()) << blocks << " " << density;
          for (const int columns : {1, 4, 11, 24, 47, 60}) {  // strips of every width
            RowMatrixX X = RandomMatrix(static_cast<int>(n), columns, engine);
            const MatrixX X_dense = SolveSquare(from.A, X);
            lu.SolveRows(columns, X.data());
            EXPECT_LT((X - X_dense).norm(), 1e-13 * X_dense.norm()) << blocks << " " << columns;
          }
        }
      }
}

// Without a dominant diagonal rows are interchanged within fronts.
TEST(MultifrontalLu, InterchangesRowsWithinAFront) {
  std::mt19937 engine(12);
  for (int trial = 0; trial < 40; ++trial) {
    BlockMatrix from = RandomBlocks(9, 0.2, 0, engine);
    for (std::size_t i = 0; i < from.sizes.size(); ++i) {  // a dominant antidiagonal in each diagonal block
      const int f = from.sizes[i];
      for (int k = 0; k < f; ++k) from.A(from.first[i] + k, from.first[i] + f - 1 - k) += 20;
    }
    MultifrontalLu lu(from.sizes, from.couplings);
    ASSERT_TRUE(Factor(from, lu));
    const auto n = static_cast<int>(from.A.rows());
    const VectorX b = RandomMatrix(n, 1, engine);
    VectorX x = b, y = b;
    lu.Solve(x.data());
    lu.SolveTransposed(y.data());
    EXPECT_LT((from.A * x - b).norm(), 1e-12 * b.norm());
    EXPECT_LT((from.A.transpose() * y - b).norm(), 1e-12 * b.norm());
    RowMatrixX X = RandomMatrix(n, 13, engine);
    const MatrixX right = X;
    lu.SolveRows(13, X.data());
    EXPECT_LT((from.A * X - right).norm(), 1e-12 * right.norm());
  }
}

TEST(MultifrontalLu, SingularOrNotFiniteIsRefused) {
  std::mt19937 engine(13);
  BlockMatrix from = RandomBlocks(6, 0.3, 10, engine);
  MultifrontalLu lu(from.sizes, from.couplings);
  ASSERT_TRUE(Factor(from, lu));
  const MatrixX A = from.A;
  from.A.setZero();
  EXPECT_FALSE(Factor(from, lu));
  from.A.setConstant(std::nan(""));
  EXPECT_FALSE(Factor(from, lu));
  from.A = A;
  EXPECT_TRUE(Factor(from, lu));
}

}  // namespace
}  // namespace fork1s
