// Which piece of Coulomb's law a point is on, by (w, λ) (pieces.cpp).
#pragma once

#include <algorithm>
#include <cmath>

#include "compliant_rows.hpp"

namespace fork1s::internal {

/// y = λ − ρ (w + R λ) of one point, and |λ − Π(y)|².
struct PointReading {
  double y_n = 0;
  Vector2 y = Vector2::Zero();
  double size = 0, bound = 0;  // |y|, and what friction allows of it
  double rho_t = 0;
  double gap2 = 0;

  bool IsOpen() const { return !(y_n > 0); }
};

inline double NormalOf(const PointRows& point, double w_n, double impulse_n) {
  const double R = point.law.R_n;
  return impulse_n - (w_n + R * impulse_n) / (point.inverse_mass + R);
}

/// `y_n` of NormalOf is above 0.
inline PointReading ReadClosed(const PointRows& point, double y_n, const Vector3& w, const Vector3& impulse) {
  PointReading out;
  const double R_t = point.law.R_t;
  out.y_n = y_n;
  out.rho_t = 1 / (point.inverse_mass + R_t);
  out.y = impulse.tail<2>() - out.rho_t * (w.tail<2>() + R_t * impulse.tail<2>());
  out.size = out.y.norm();
  out.bound = point.law.friction * y_n;
  const double off = impulse[0] - y_n;
  out.gap2 = off * off +
             (impulse.tail<2>() - (out.size > out.bound ? out.bound / out.size : 1) * out.y).squaredNorm();
  return out;
}

inline PointReading ReadPoint(const PointRows& point, const Vector3& w, const Vector3& impulse) {
  const double y_n = NormalOf(point, w[0], impulse[0]);
  if (y_n > 0) return ReadClosed(point, y_n, w, impulse);
  PointReading out;
  out.gap2 = impulse.squaredNorm();
  return out;
}

/// D of the piece that is sticking.
inline void SetSticking(const PointRows& point, Matrix3& D) {
  D.setZero();
  D(0, 0) = 1 / point.law.R_n;
  D(1, 1) = D(2, 2) = 1 / point.law.R_t;
}

/// D of the piece that slides as y does.
inline void SetSliding(const PointRows& point, const PointReading& read, Matrix3& D) {
  const Vector2 e = read.y / read.size;
  const double beta = std::min(1.0, read.bound / read.size),
               kappa = beta * read.rho_t / (1 - beta * (1 - read.rho_t * point.law.R_t));
  D.setZero();
  D(0, 0) = 1 / point.law.R_n;
  D.block<2, 1>(1, 0) = point.law.friction / point.law.R_n * e;
  D.bottomRightCorner<2, 2>() = kappa * (Eigen::Matrix2d::Identity() - e * e.transpose());
}

}  // namespace fork1s::internal
