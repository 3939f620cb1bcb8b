// Derivatives by differences, for the mechanism tests.
#pragma once

#include <fork1s/mechanism/builder.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <random_mechanism.hpp>

namespace fork1s::mechanism_test {

using testing::BuildOrThrow;
using testing::JointVelocityMap;
using testing::RandomCoordinates;
using testing::RandomMechanism;
using testing::RandomMechanismDef;
using testing::RandomMechanismOptions;
using testing::RandomSource;

/// Fourth-order differences with h = 1e-3: they truncate at h⁴/30 f⁗' ~ 1e-13 and round at 1e-16/h ~ 1e-13,
/// each times the size of f and of its derivatives, which chains of eight bodies with slides let grow to some
/// 100.
constexpr double kDifference = 1e-10;

/// df(q)/dq_i for every i; f returns a matrix, entry(i) receives the derivative.
template <class F, class Entry>
void Differentiate(const VectorX& q, F f, Entry entry) {
  const double h = 1e-3;
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    auto at = [&](double t) {
      VectorX p = q;
      p(i) += t;
      return MatrixX(f(p));
    };
    entry(i, MatrixX((8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)));
  }
}

inline Kinematics At(const Mechanism& m, const VectorX& q) {
  Kinematics k(m);
  ComputeKinematics(m, q, k);
  return k;
}

inline MatrixX PoseMatrix(const RigidTransform& X) {
  MatrixX P = MatrixX::Identity(4, 4);
  P.topLeftCorner<3, 3>() = X.rotation();
  P.topRightCorner<3, 1>() = X.translation();
  return P;
}

/// Every kind of joint, closure, coupling and spring at once.
inline RandomMechanismOptions Everything() {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  options.springy_closures = 2;
  options.couplings = 2;
  options.coupling_terms = 2;
  options.springs = 3;
  options.bent_springs = true;
  options.controls = 3;
  options.rest = true;
  return options;
}

constexpr unsigned kSeeds = 40;

}  // namespace fork1s::mechanism_test
