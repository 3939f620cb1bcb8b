// Coulomb friction of a compliant point as a projection.
//
//     Π_n(y) = max(0, y_n),   Π_t(y) = y_t min(1, µ Π_n/|y_t|)
// maps y onto the section of the friction cone at the normal impulse Π_n. It is not the orthogonal projection
// onto the cone: friction does not change the normal impulse (P. Alart and A. Curnier, CMAME 92, 1991). The
// impulse at the relative velocity w is
//     λ = Π(-w_n/R_n, λ₀_t - w_t/R_t)
// with the compliances R_n, R_t and the tangential impulse λ₀_t of the step before (docs/method.md, (6.0)).
//
// With the coefficients µ a_1, µ a_2 along the tangents the section is an ellipse:
//     Π_t(y) = y_t min(1, µ Π_n/|z|),   z_k = y_k/a_k
// is the orthogonal projection onto it where the metric is diag(1/a²), that is where R_k and ρ_k are as 1/a_k² and
// a_k². Slip then has the direction of maximum dissipation.
#pragma once

#include <cmath>
#include <fork1s/base/types.hpp>

namespace fork1s::reference {

enum class ContactMode { kOpen, kSticking, kSliding };

struct FrictionProjection {
  Vector3 impulse = Vector3::Zero();     // Π(y)
  Matrix3 derivative = Matrix3::Zero();  // ∂Π/∂y
  ContactMode mode = ContactMode::kOpen;
};

inline FrictionProjection ProjectOntoFrictionCone(const Vector3& y, double friction,
                                                  const Vector2& shares = Vector2::Ones()) {
  FrictionProjection out;
  if (!(y[0] > 0)) return out;
  out.impulse[0] = y[0];
  out.derivative(0, 0) = 1;
  const Vector2 z = y.tail<2>().cwiseQuotient(shares);
  const double bound = friction * y[0], size = z.norm();
  if (size <= bound) {
    out.mode = ContactMode::kSticking;
    out.impulse.tail<2>() = y.tail<2>();
    out.derivative.bottomRightCorner<2, 2>().setIdentity();
    return out;
  }
  out.mode = ContactMode::kSliding;
  const Vector2 direction = z / size;
  out.impulse.tail<2>() = bound * shares.cwiseProduct(direction);
  out.derivative.bottomLeftCorner<2, 1>() = friction * shares.cwiseProduct(direction);
  out.derivative(1, 1) = bound / size * direction[1] * direction[1];
  out.derivative(2, 2) = bound / size * direction[0] * direction[0];
  out.derivative(1, 2) = -bound / size * direction[0] * direction[1] * shares[0] / shares[1];
  out.derivative(2, 1) = -bound / size * direction[0] * direction[1] * shares[1] / shares[0];
  return out;
}

/// The impulse λ at the relative velocity w; `derivative` is ∂λ/∂w.
inline FrictionProjection EvaluateFrictionLaw(const Vector3& w, const Vector3& compliance,
                                              const Vector2& previous_tangential, double friction) {
  Vector3 y = -w.cwiseQuotient(compliance);
  y.tail<2>() += previous_tangential;
  FrictionProjection out = ProjectOntoFrictionCone(y, friction);
  for (int k = 0; k < 3; ++k) out.derivative.col(k) /= -compliance[k];
  return out;
}

}  // namespace fork1s::reference
