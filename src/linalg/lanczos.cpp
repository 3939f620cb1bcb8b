#include "linalg/spectrum.hpp"

#include <algorithm>

#include <Spectra/SymEigsSolver.h>

namespace fork1s {
namespace {

struct Operator {
  using Scalar = double;
  const std::function<void(const double*, double*)>& apply;
  Eigen::Index size;

  Eigen::Index rows() const { return size; }
  Eigen::Index cols() const { return size; }
  void perform_op(const double* x, double* y) const { apply(x, y); }
};

}  // namespace

bool LargestEigenpairs(const std::function<void(const double* x, double* y)>& apply, int n, int count,
                       VectorX& values, MatrixX& vectors) {
  Operator op{apply, n};
  Spectra::SymEigsSolver<Operator> solver(op, count, std::min(n, std::max(2 * count + 8, 20)));
  solver.init();
  // The wanted end of the spectrum is well separated (1/ω² falls with the fourth power on chains), so
  // rounding-level convergence takes few restarts.
  if (solver.compute(Spectra::SortRule::LargestAlge, 1000, 1e-14) != count) return false;
  values = solver.eigenvalues();
  vectors = solver.eigenvectors();
  return true;
}

}  // namespace fork1s
