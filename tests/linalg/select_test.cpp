// Rows, columns and entries picked by their numbers.
#include <gtest/gtest.h>

#include "linalg/select.hpp"

namespace fork1s {
namespace {

TEST(Select, TakesWhatIsNamedInThatOrder) {
  MatrixX A(3, 4);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 4; ++k) A(i, k) = 10 * i + k;
  const MatrixX columns = Columns(A, {3, 0});
  EXPECT_EQ(columns.col(0), A.col(3));
  EXPECT_EQ(columns.col(1), A.col(0));
  const MatrixX rows = Rows(A.rightCols(2), {2, 2});
  EXPECT_EQ(rows.row(0), A.row(2).tail(2));
  EXPECT_EQ(rows.row(1), rows.row(0));
  EXPECT_EQ(RowsAndColumns(A, {2, 1}, {1, 3}), Rows(Columns(A, {1, 3}), {2, 1}));
  EXPECT_EQ(Columns(A, {}).cols(), 0);
  EXPECT_EQ(Columns(A, {}).rows(), 3);
}

TEST(Select, SpreadUndoesEntries) {
  const VectorX v = VectorX::LinSpaced(5, 1, 5);
  const std::vector<int> at{4, 1};
  const VectorX picked = Entries(v, at), spread = Spread(picked, at, 5);
  EXPECT_EQ(picked, Eigen::Vector2d(5, 2));
  EXPECT_EQ(spread.sum(), 7);
  EXPECT_EQ(Entries(spread, at), picked);
}

}  // namespace
}  // namespace fork1s
