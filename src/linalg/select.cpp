#include "linalg/select.hpp"

namespace fork1s {

MatrixX RowsAndColumns(const MatrixView& A, const std::vector<int>& rows, const std::vector<int>& columns) {
  MatrixX out(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k)
    for (std::size_t i = 0; i < rows.size(); ++i)
      out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = A(rows[i], columns[k]);
  return out;
}

MatrixX Columns(const MatrixView& A, const std::vector<int>& at) {
  MatrixX out(A.rows(), static_cast<Eigen::Index>(at.size()));
  for (std::size_t k = 0; k < at.size(); ++k) out.col(static_cast<Eigen::Index>(k)) = A.col(at[k]);
  return out;
}

MatrixX Rows(const MatrixView& A, const std::vector<int>& at) {
  MatrixX out(static_cast<Eigen::Index>(at.size()), A.cols());
  for (Eigen::Index k = 0; k < A.cols(); ++k)
    for (std::size_t i = 0; i < at.size(); ++i) out(static_cast<Eigen::Index>(i), k) = A(at[i], k);
  return out;
}

VectorX Entries(const VectorView& v, const std::vector<int>& at) {
  VectorX out(static_cast<Eigen::Index>(at.size()));
  for (std::size_t i = 0; i < at.size(); ++i) out(static_cast<Eigen::Index>(i)) = v(at[i]);
  return out;
}

VectorX Spread(const VectorView& v, const std::vector<int>& at, int n) {
  VectorX out = VectorX::Zero(n);
  for (std::size_t i = 0; i < at.size(); ++i) out(at[i]) = v(static_cast<Eigen::Index>(i));
  return out;
}

}  // namespace fork1s
