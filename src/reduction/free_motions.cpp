#include "free_motions.hpp"

#include <algorithm>
#include <limits>

#include "linalg/cholesky.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "world_axes.hpp"

namespace fork1s {
namespace internal {

FreeMotions FreeMotionsOf(const MatrixX& moved) { return {RangeBasis(moved)}; }

namespace {

MatrixX TimesOnDisplacements(MatrixX m, double factor) {
  for (Eigen::Index i = 3; i < m.rows(); i += 6) m.middleRows(i, 3) *= factor;
  return m;
}

}  // namespace

MatrixX InLengths(const MatrixX& displacements, double length) {
  return TimesOnDisplacements(displacements, 1 / length);
}
MatrixX FromLengths(const MatrixX& displacements, double length) {
  return TimesOnDisplacements(displacements, length);
}

InterfaceCompliance Assemble(const Mechanism& mechanism, const MatrixX& root, const FreeMotions& free,
                             const MatrixX& motions) {
  const double L = mechanism.length_scale();
  const MatrixX R = WorldAxes(mechanism, static_cast<std::size_t>(root.rows()) / 6);
  const MatrixX left = R * FromLengths(free.Without(root), L);
  InterfaceCompliance out;
  out.C = TimesTransposed(left, left);
  out.free = Times(R, FromLengths(free.basis, L));
  out.rank = ComputeNullSpace(free.Without(motions)).rank.value;
  return out;
}

MatrixX WithoutFree(const Mechanism& mechanism, const MatrixX& C, const FreeMotions& free) {
  const MatrixX R = WorldAxes(mechanism, static_cast<std::size_t>(C.rows()) / 6);
  if (free.basis.cols() == 0) return Times(R, TimesTransposed(C, R));
  const double L = mechanism.length_scale();
  const MatrixX once = Times(R, FromLengths(free.Without(InLengths(C, L)), L));
  return Times(R, FromLengths(free.Without(InLengths(once.transpose(), L)), L));
}

}  // namespace internal

double ComplianceDifference(const InterfaceCompliance& a, const InterfaceCompliance& b, double length) {
  if (a.rank != b.rank || a.free.cols() != b.free.cols() || a.C.rows() != b.C.rows())
    return std::numeric_limits<double>::infinity();
  if (a.C.size() == 0) return 0;
  const auto scaled = [&](const MatrixX& C) {
    return internal::InLengths(internal::InLengths(C, length).transpose(), length);
  };
  const MatrixX A = scaled(a.C), B = scaled(b.C);
  const double size = std::max(A.cwiseAbs().maxCoeff(), B.cwiseAbs().maxCoeff());
  // Where loops hold the bodies still, what is left is rounding.
  return a.rank == 0 ? 0 : (A - B).cwiseAbs().maxCoeff() / size;
}

MatrixX StiffnessFromCompliance(const InterfaceCompliance& compliance, double length) {
  const Eigen::Index n = compliance.C.rows();
  if (n == 0 || compliance.rank < n) return {};
  const MatrixX scaled = internal::InLengths(internal::InLengths(compliance.C, length).transpose(), length);
  const MatrixX K = SolveSymmetric(scaled, MatrixX::Identity(n, n));
  const MatrixX unscaled = internal::InLengths(internal::InLengths(K, length).transpose(), length);
  return 0.5 * (unscaled + unscaled.transpose());
}

}  // namespace fork1s
