#include "elastic_basis.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/QR>
#include <Eigen/SVD>

namespace fork1s::internal {
namespace {

// Closures that hold exactly at the reference leave rounding of about 1e-12 in rows that depend on others,
// while independent rows of real mechanisms stay above 1e-4.
constexpr double kRankTolerance = 1e-9;
// Singular values of the root of K: a ratio of 1e-10 is a stiffness ratio of 1e-20, beyond any two springs of
// one mechanism, and well above rounding.
constexpr double kSpringTolerance = 1e-10;

}  // namespace

VectorX CoordinateScale(const Mechanism& mechanism) {
  VectorX scale(mechanism.num_coordinates());
  for (int i = 0; i < scale.size(); ++i)
    scale(i) = mechanism.screws().col(i).head<3>().norm() > 1e-9 ? 1.0 : mechanism.length_scale();
  return scale;
}

MatrixX ElasticBasis::DenseFree(int n) const {
  if (!diagonal) return N;
  MatrixX dense = MatrixX::Zero(n, num_free());
  for (int i = 0; i < num_free(); ++i) dense(unsprung[static_cast<std::size_t>(i)], i) = 1;
  return dense;
}

MatrixX ElasticBasis::DenseElastic(int n) const {
  if (!diagonal) return V;
  MatrixX dense = MatrixX::Zero(n, num_elastic());
  for (int i = 0; i < num_elastic(); ++i) dense(sprung[static_cast<std::size_t>(i)], i) = inverse_root(i);
  return dense;
}

VectorX ElasticBasis::ApplyV(const VectorX& y, int n) const {
  if (!diagonal) return V * y;
  VectorX q = VectorX::Zero(n);
  for (int i = 0; i < num_elastic(); ++i) q(sprung[static_cast<std::size_t>(i)]) = inverse_root(i) * y(i);
  return q;
}

VectorX ElasticBasis::ApplyVTransposed(const VectorX& g) const {
  if (!diagonal) return V.transpose() * g;
  VectorX y(num_elastic());
  for (int i = 0; i < num_elastic(); ++i) y(i) = inverse_root(i) * g(sprung[static_cast<std::size_t>(i)]);
  return y;
}

MatrixX ElasticBasis::TimesV(const MatrixX& B) const {
  if (!diagonal) return B * V;
  MatrixX out(B.rows(), num_elastic());
  for (int i = 0; i < num_elastic(); ++i)
    out.col(i) = inverse_root(i) * B.col(sprung[static_cast<std::size_t>(i)]);
  return out;
}

ElasticBasis ComputeElasticBasis(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const int n = mechanism.num_coordinates();
  ElasticBasis basis;
  if (mechanism.is_tree() && mechanism.has_diagonal_stiffness()) {
    basis.diagonal = true;
    for (int i = 0; i < n; ++i) (mechanism.stiffness()(i) > 0 ? basis.sprung : basis.unsprung).push_back(i);
    basis.inverse_root.resize(basis.num_elastic());
    for (int i = 0; i < basis.num_elastic(); ++i)
      basis.inverse_root(i) = 1 / std::sqrt(mechanism.stiffness()(basis.sprung[static_cast<std::size_t>(i)]));
    return basis;
  }

  const VectorX scale = CoordinateScale(mechanism);
  MatrixX Z_scaled = MatrixX::Identity(n, n);
  if (mechanism.num_constraints() > 0) {
    MatrixX A;
    ClosureJacobian(mechanism, kinematics, q, A);
    // Rows in lengths are made comparable with rows in radians.
    int row = 0;
    for (const ClosureDef& closure : mechanism.closures())
      for (int i = 0; i < 6; ++i)
        if (closure.rigid(i)) A.row(row++) *= i < 3 ? 1.0 : 1 / mechanism.length_scale();
    const MatrixX A_scaled_T = (A * scale.asDiagonal()).transpose();
    Eigen::ColPivHouseholderQR<MatrixX> qr(A_scaled_T);
    qr.setThreshold(kRankTolerance);
    const int rank = static_cast<int>(qr.rank());
    for (int i = 0; i < rank; ++i)
      basis.independent_rows.push_back(static_cast<int>(qr.colsPermutation().indices()(i)));
    std::sort(basis.independent_rows.begin(), basis.independent_rows.end());
    MatrixX full = qr.householderQ() * MatrixX::Identity(n, n);
    Z_scaled = full.rightCols(n - rank);
  }
  basis.Z = scale.asDiagonal() * Z_scaled;
  const MatrixX G = StiffnessRoot(mechanism, kinematics) * basis.Z;
  const int nz = static_cast<int>(basis.Z.cols());
  if (G.rows() == 0 || G.isZero(0)) {
    basis.N = basis.Z;
    basis.V.resize(n, 0);
    return basis;
  }
  Eigen::BDCSVD<MatrixX> svd(G, Eigen::ComputeFullV);
  const VectorX& sigma = svd.singularValues();
  int elastic = 0;
  while (elastic < sigma.size() && sigma(elastic) > kSpringTolerance * sigma(0)) ++elastic;
  basis.V = basis.Z * svd.matrixV().leftCols(elastic) * sigma.head(elastic).cwiseInverse().asDiagonal();
  basis.N = basis.Z * svd.matrixV().rightCols(nz - elastic);
  return basis;
}

MatrixX ScaledInterfaceJacobian(const Mechanism& mechanism, const Kinematics& kinematics,
                                const std::vector<BodyIndex>& bodies, double length) {
  MatrixX J(6 * static_cast<Eigen::Index>(bodies.size()), mechanism.num_coordinates());
  for (std::size_t e = 0; e < bodies.size(); ++e) {
    auto rows = J.middleRows(6 * static_cast<Eigen::Index>(e), 6);
    rows = BodyJacobian(mechanism, kinematics, bodies[e]);
    rows.bottomRows(3) -= Skew(kinematics.X_RB[bodies[e].u()].translation()) * rows.topRows(3);
    rows.topRows(3) *= length;
  }
  return J;
}

MatrixX HiddenDirections(const MatrixX& J_N) {
  const int f = static_cast<int>(J_N.cols());
  if (f == 0) return MatrixX(0, 0);
  if (J_N.rows() == 0 || J_N.isZero(0)) return MatrixX::Identity(f, f);
  Eigen::JacobiSVD<MatrixX, Eigen::FullPivHouseholderQRPreconditioner> svd(J_N, Eigen::ComputeFullV);
  int seen = 0;
  while (seen < svd.singularValues().size() && svd.singularValues()(seen) > 1e-8 * svd.singularValues()(0))
    ++seen;
  return svd.matrixV().rightCols(f - seen);
}

}  // namespace fork1s::internal
