#include <fork1s/reduction/compliance.hpp>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "elastic_basis.hpp"
#include "world_axes.hpp"

namespace fork1s {

Expected<MatrixX> DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                  const std::vector<BodyIndex>& bodies) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  MatrixX J = internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0);
  const MatrixX moved = J * basis.DenseFree(mechanism.num_coordinates());
  if (moved.size() > 0 && moved.cwiseAbs().maxCoeff() > 1e-9)
    return Fail(
        ErrorCode::kUnderdetermined, fmt::format("mechanism '{}'", mechanism.name()),
        "has a spring-free motion that moves an interface body, so that its compliance does not exist");
  J = internal::WorldAxes(mechanism, bodies.size()) * J;
  const MatrixX J_V = basis.TimesV(J);
  return MatrixX(J_V * J_V.transpose());
}

namespace {

VectorX ScaledEigenvalues(const MatrixX& C, double length, MatrixX* scaled_out = nullptr) {
  VectorX scale(C.rows());
  for (Eigen::Index i = 0; i < C.rows(); ++i) scale(i) = i % 6 < 3 ? length : 1.0;
  const MatrixX scaled = scale.asDiagonal() * C * scale.asDiagonal();
  if (scaled_out) *scaled_out = scaled;
  return Eigen::SelfAdjointEigenSolver<MatrixX>(scaled, Eigen::EigenvaluesOnly).eigenvalues();
}

// The square of the relative singular value below which the interface is taken not to move.
constexpr double kCompliant = 1e-12;

}  // namespace

int ComplianceRank(const MatrixX& C, double length) {
  if (C.size() == 0) return 0;
  const VectorX eigenvalues = ScaledEigenvalues(C, length);
  return static_cast<int>((eigenvalues.array() > kCompliant * eigenvalues.maxCoeff()).count());
}

MatrixX StiffnessFromCompliance(const MatrixX& C, double length) {
  if (C.size() == 0) return {};
  if (ComplianceRank(C, length) < C.rows()) return {};
  VectorX scale(C.rows());
  for (Eigen::Index i = 0; i < C.rows(); ++i) scale(i) = i % 6 < 3 ? length : 1.0;
  const MatrixX scaled = scale.asDiagonal() * C * scale.asDiagonal();
  const MatrixX K = scaled.ldlt().solve(MatrixX::Identity(C.rows(), C.rows()));
  const MatrixX unscaled = scale.asDiagonal() * K * scale.asDiagonal();
  return 0.5 * (unscaled + unscaled.transpose());
}

}  // namespace fork1s
