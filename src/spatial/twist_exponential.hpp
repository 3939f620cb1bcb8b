// The exponential of one twist and its derivative, for many vectors.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

/// Coefficients of the exponential map at an angle θ [rad].
struct ExpCoefficients {
  double sinc;     // sin θ / θ
  double b;        // (1 - cos θ) / θ²
  double c;        // (θ - sin θ) / θ³
  double b_prime;  // (db/dθ) / θ
  double c_prime;  // (dc/dθ) / θ
};
ExpCoefficients EvaluateExpCoefficients(double theta_squared);

/// Exp(x) and Dexp(x) s of one twist x = [w; v] [rad, m]. With θ = |w| and W = [w]
///     Exp(x) = [R, J v],   R = 1 + sinc W + b W²,   J = 1 + b W + c W²,
///     Dexp(x) = [J 0; Q J],   Q = b [v] + c (W [v] + [v] W) + (w·v) (b' W + c' W²),
/// where W² = w wᵀ - θ² 1 and W [v] + [v] W = w vᵀ + v wᵀ - 2 (w·v) 1.
class TwistExponential {
 public:
  explicit TwistExponential(const Vector6& x) {
    const Vector3 w = x.head<3>(), v = x.tail<3>();
    const double t2 = w.squaredNorm(), wv = w.dot(v);
    const ExpCoefficients k = EvaluateExpCoefficients(t2);
    const Quad w4(w[0], w[1], w[2], 0), v4(v[0], v[1], v[2], 0);
    const Quad g = k.c * v4 + wv * k.c_prime * w4;
    SetSkew(1 - k.b * t2, k.sinc * w, R_);
    SetSkew(1 - k.c * t2, k.b * w, J_);
    SetSkew(-wv * (2 * k.c + k.c_prime * t2), k.b * v + wv * k.b_prime * w, Q_);
    for (int i = 0; i < 3; ++i) {
      R_[i] += k.b * w[i] * w4;
      J_[i] += k.c * w[i] * w4;
      Q_[i] += w[i] * g + k.c * v[i] * w4;
    }
    p_ = v[0] * J_[0] + v[1] * J_[1] + v[2] * J_[2];
  }

  /// X <- Exp(x)
  void SetTransform(RigidTransform& X) const {
    double* to = X.data();
    for (int i = 0; i < 3; ++i, to += 3)
      QuadAt(to) = R_[i];  // the fourth number is written over by the next column
    X.translation() = p_.head<3>();
  }
  /// Dexp(x) s = [angular; linear], the fourth number of each 0.
  void Apply(const double* s, Quad& angular, Quad& linear) const {
    angular = s[0] * J_[0] + s[1] * J_[1] + s[2] * J_[2];
    linear = (s[0] * Q_[0] + s[1] * Q_[1] + s[2] * Q_[2]) + (s[3] * J_[0] + s[4] * J_[1] + s[5] * J_[2]);
  }

 private:
  // Columns of d 1 + [u].
  static void SetSkew(double d, const Vector3& u, Quad* columns) {
    columns[0] = Quad(d, u[2], -u[1], 0);
    columns[1] = Quad(-u[2], d, u[0], 0);
    columns[2] = Quad(u[1], -u[0], d, 0);
  }

  Quad R_[3], J_[3], Q_[3], p_;
};

}  // namespace fork1s
