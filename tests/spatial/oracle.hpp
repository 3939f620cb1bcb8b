// Truth for SE(3): exponential, logarithm and inverse of matrices from their series and definitions in long double,
// which know nothing of rotations, and the samples at which every law is tried.
#pragma once

#include <cmath>
#include <fork1s/spatial/rigid_transform.hpp>
#include <numbers>
#include <random>
#include <vector>

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

/// Σ A^k/k!, of A halved until the series is short and squared as often.
template <int n>
MatrixL<n> Exponential(MatrixL<n> A) {
  int halvings = 0;
  for (; A.cwiseAbs().maxCoeff() > Real(0.1); ++halvings) A *= Real(0.5);
  MatrixL<n> sum = MatrixL<n>::Identity(), term = sum;
  for (int k = 1; k <= 20; ++k) {  // |A| <= 0.1 n: the last term is below 1e-20
    term = (term * A / Real(k)).eval();
    sum += term;
  }
  for (; halvings > 0; --halvings) sum = (sum * sum).eval();
  return sum;
}

/// By Gauss and Jordan with pivots.
template <int n>
MatrixL<n> Inverse(MatrixL<n> A) {
  MatrixL<n> B = MatrixL<n>::Identity();
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(A(i, k)) > std::abs(A(pivot, k))) pivot = i;
    A.row(k).swap(A.row(pivot));
    B.row(k).swap(B.row(pivot));
    const Real d = 1 / A(k, k);
    A.row(k) *= d;
    B.row(k) *= d;
    for (int i = 0; i < n; ++i) {
      if (i == k) continue;
      const Real f = A(i, k);
      A.row(i) -= f * A.row(k);
      B.row(i) -= f * B.row(k);
    }
  }
  return B;
}

/// The principal square root, by the coupled Newton iteration of Denman and Beavers.
template <int n>
MatrixL<n> SquareRoot(const MatrixL<n>& A) {
  MatrixL<n> Y = A, Z = MatrixL<n>::Identity();
  for (int i = 0; i < 80; ++i) {  // near a half turn the angle to the cut only doubles at first
    const MatrixL<n> y = Real(0.5) * (Y + Inverse<n>(Z)), z = Real(0.5) * (Z + Inverse<n>(Y));
    const bool still = (y - Y).cwiseAbs().maxCoeff() <= Real(1e-18) * Y.cwiseAbs().maxCoeff();
    Y = y;
    Z = z;
    if (still) break;
  }
  return Y;
}

/// The principal logarithm: 2^k log A^(1/2^k), log A = 2 Σ B^(2i+1)/(2i+1) with B = (A - I)(A + I)⁻¹.
template <int n>
MatrixL<n> Logarithm(MatrixL<n> A) {
  const MatrixL<n> I = MatrixL<n>::Identity();
  Real factor = 2;
  for (int k = 0; k < 40 && (A - I).cwiseAbs().maxCoeff() > Real(0.1); ++k) {
    A = SquareRoot<n>(A);
    factor *= 2;
  }
  const MatrixL<n> B = (A - I) * Inverse<n>(A + I), square = B * B;
  MatrixL<n> power = B, sum = B;
  for (int i = 1; i <= 16; ++i) {  // |B| <= 0.06 n at most
    power = (power * square).eval();
    sum += power / Real(2 * i + 1);
  }
  return factor * sum;
}

inline MatrixL<4> ExpOracle(const Vector6& x) { return Exponential<4>(Hat(x)); }

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
  const MatrixL<2 * n> e = Exponential<2 * n>(block);
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
