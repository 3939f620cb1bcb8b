#include "loaded_mechanism.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/solve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s::internal {

LoadedMechanism::LoadedMechanism(const Mechanism& mechanism, const VectorX& q0,
                                 const std::vector<DeadLoad>& loads, const StaticsOptions& options)
    : mechanism_(mechanism),
      loads_(loads),
      options_(options),
      kinematics_(mechanism),
      F_(6, mechanism.num_bodies()) {
  Pose(q0);
  unit_ = ComputeCoordinateScaling(mechanism, kinematics_);
  const SpringRows springs = ScaledSpringRows(mechanism, kinematics_, q0, unit_);
  double far = 0;
  for (const RigidTransform& X : kinematics_.X_RB) far = std::max(far, X.translation().norm());
  const double stiffest = springs.weight.size() > 0 ? springs.weight.cwiseAbs2().maxCoeff() : 0;
  rounding_ = 8 * std::numeric_limits<double>::epsilon() * (1 + far / mechanism.length_scale()) * stiffest;
}

VectorX LoadedMechanism::LoadForce(double share) {
  F_.setZero();
  AddGravityWrenches(mechanism_, kinematics_, share * options_.gravity_R, F_);
  for (const DeadLoad& load : loads_) {
    const Vector3 f = share * load.force_R, p = kinematics_.X_RB[load.body.u()] * load.point_B;
    F_.col(load.body.value()).head<3>() += share * load.moment_R + p.cross(f);
    F_.col(load.body.value()).tail<3>() += f;
  }
  VectorX tau = VectorX::Zero(mechanism_.num_coordinates());
  AccumulateGeneralizedForce(mechanism_, kinematics_.S, F_, tau);
  return tau;
}

VectorX LoadedMechanism::Residual(const VectorX& q, const VectorX& lambda, double share) {
  Pose(q);
  VectorX g;
  SpringForce(mechanism_, kinematics_, q, g);
  if (options_.controls.size() > 0) AddControlForce(mechanism_, kinematics_, options_.controls, g);
  g += LoadForce(share);
  if (lambda.size() > 0) {
    ClosureJacobian(mechanism_, kinematics_, q, A_);
    g += TransposedTimes(A_, lambda);
  }
  for (const int i : options_.locked) g(i) = 0;
  return g;
}

double LoadedMechanism::Scale(const VectorX& q, double share) {
  Pose(q);
  VectorX g;
  SpringForce(mechanism_, kinematics_, q, g);
  return std::max({Size(g), Size(LoadForce(share)), 1e-300});
}

VectorX LoadedMechanism::Reactions(const VectorX& q, double share) {
  const VectorX g = Residual(q, VectorX(), share);
  if (mechanism_.num_constraints() == 0) return {};
  VectorX row;
  MatrixX A = ScaledClosureRows(mechanism_, kinematics_, q, unit_, &row);
  for (const int i : options_.locked) A.col(i).setZero();
  const MatrixX seen = ComputeNullSpace(A).seen;
  const VectorX g_x = unit_.coordinate.cwiseProduct(g);
  return -row.cwiseProduct(
      VectorX(LeastNormSolve(Times(A, seen).transpose(), TransposedTimes(seen, g_x), kRankThreshold)));
}

MatrixX LoadedMechanism::Tangent(const VectorX& q, const VectorX& lambda, double share) {
  const auto n = q.size();
  MatrixX K(n, n);
  VectorX x = q;
  constexpr double kStep = 1e-5;  // in one unit
  for (Eigen::Index i = 0; i < n; ++i) {
    const double step = kStep * unit_.coordinate(i);
    x(i) = q(i) + step;
    const VectorX above = Residual(x, lambda, share);
    x(i) = q(i) - step;
    K.col(i) = (above - Residual(x, lambda, share)) / (2 * step);
    x(i) = q(i);
  }
  for (const int i : options_.locked) {
    K.row(i).setZero();
    K.col(i).setZero();
    K(i, i) = -1;  // beside a residual of 0: it does not move
  }
  Pose(q);
  return K;
}

double SingularStiffness(const VectorX& eigenvalues, double scale) {
  constexpr double kSingular = 1e-9;  // central differences of the forces resolve 1e-11 of them
  return kSingular * std::max(eigenvalues.cwiseAbs().maxCoeff(), scale);
}

}  // namespace fork1s::internal
