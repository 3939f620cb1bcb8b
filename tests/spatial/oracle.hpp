// Truth for SE(3): the matrix exponential and logarithm of Eigen's unsupported/MatrixFunctions in long
// double, and the samples at which every law is tried.
#pragma once

#include <cmath>
#include <fork1s/spatial/rigid_transform.hpp>
#include <numbers>
#include <random>
#include <vector>

#include <unsupported/Eigen/MatrixFunctions>

namespace fork1s::spatial_test {

constexpr double kPi = std::numbers::pi;

/// Double rounding (1.1e-16) times a few dozen operations leaves some 1e-14; ten times that is the room given
/// to a law. Lengths scale it.
constexpr double kTolerance = 1e-13;

using Real = long double;
template <int n>
using MatrixL = Eigen::Matrix<Real, n, n>;

/// [x] = [[ω]x v; 0 0], the 4x4 matrix of a twist.
inline MatrixL<4> Hat(const Vector6& x) {
  MatrixL<4> m = MatrixL<4>::Zero();
  m.topLeftCorner<3, 3>() = Skew(x.head<3>()).cast<Real>();
  m.topRightCorner<3, 1>() = x.tail<3>().cast<Real>();
  return m;
}

inline MatrixL<4> Homogeneous(const RigidTransform& X) {
  MatrixL<4> m = MatrixL<4>::Identity();
  m.topLeftCorner<3, 3>() = X.rotation().cast<Real>();
  m.topRightCorner<3, 1>() = X.translation().cast<Real>();
  return m;
}

inline MatrixL<4> ExpOracle(const Vector6& x) { return Hat(x).exp(); }

/// ad(x) from its definition [[x], [y]] on the 4x4 matrices, column by column.
inline MatrixL<6> SmallAdjointOracle(const Vector6& x) {
  MatrixL<6> ad;
  for (int i = 0; i < 6; ++i) {
    const MatrixL<4> X = Hat(x), Y = Hat(Vector6::Unit(i));
    const MatrixL<4> Z = X * Y - Y * X;
    ad.col(i) << Z(2, 1), Z(0, 2), Z(1, 0), Z(0, 3), Z(1, 3), Z(2, 3);
  }
  return ad;
}

/// Σ A^k/(k+1)!, the upper right block of exp([A I; 0 0]).
template <int n>
MatrixL<n> DexpOracle(const MatrixL<n>& A) {
  MatrixL<2 * n> block = MatrixL<2 * n>::Zero();
  block.template topLeftCorner<n, n>() = A;
  block.template topRightCorner<n, n>().setIdentity();
  const MatrixL<2 * n> e = block.exp();
  return e.template topRightCorner<n, n>();
}

inline double Difference(const auto& a, const auto& b) {
  return static_cast<double>((a.template cast<Real>() - b.template cast<Real>()).cwiseAbs().maxCoeff());
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
  }
  Vector3 InBox(double half) { return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)}; }
  Vector3 Direction() {
    for (;;) {
      const Vector3 v = InBox(1);
      if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
    }
  }

 private:
  std::mt19937 engine_;
};

/// Angles at which formulas change or lose digits.
inline std::vector<double> HardAngles() {
  std::vector<double> angles = {0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-6, 1e-3, 0.05, 1, 2, 3};
  for (double s : {0.2, 0.5})  // where series give way to closed forms
    for (double d : {-1e-3, -1e-9, 0.0, 1e-9, 1e-3}) angles.push_back(s + d);
  for (double d : {1e-3, 1e-6, 1e-8}) angles.push_back(kPi - d);
  return angles;
}

/// Twists with every hard angle about coordinate axes and random ones, then random twists; angles up to
/// `largest` [rad], translations of 0, 1e-6, 1 and 10 m.
inline std::vector<Vector6> Samples(double largest = kPi - 1e-8) {
  Random random(20240613);
  std::vector<Vector6> samples;
  auto add = [&](double angle, const Vector3& axis, double length) {
    Vector6 x;
    x << angle * axis, length * random.Direction();
    samples.push_back(x);
  };
  std::vector<double> angles = HardAngles();
  for (double angle : {kPi, kPi + 1e-8, 3.5, 4.5, 5.5, 6.0})
    if (angle <= largest) angles.push_back(angle);
  for (double angle : angles)
    for (double length : {0.0, 1e-6, 1.0, 10.0}) {
      add(angle, Vector3::UnitX(), length);
      add(angle, -Vector3::UnitZ(), length);
      for (int i = 0; i < 3; ++i) add(angle, random.Direction(), length);
    }
  for (int i = 0; i < 200; ++i) add(random.Uniform(0, largest), random.Direction(), random.Uniform(0, 10));
  return samples;
}

inline double Scale(const Vector6& x) { return 1 + x.tail<3>().norm(); }

}  // namespace fork1s::spatial_test
