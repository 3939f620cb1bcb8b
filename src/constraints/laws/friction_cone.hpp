// Unilateral contact with Coulomb friction.
//
//     Π_n(y) = max(0, y_n),   Π_t(y) = y_t min(1, s/|y_t|),   s = µ Π_n(y)
// maps y onto the section of the friction cone at its own normal impulse: friction does not change that impulse
// (P. Alart and A. Curnier, CMAME 92, 1991). With a frozen bound s = µ n (Tresca) Π is the gradient of a convex
// function in the metric R.
//
// Components: normal, tangent 1, tangent 2 of the contact frame. Friction with two coefficients µ a_1, µ a_2 has
// an ellipse for its section. In tangents scaled by a, velocities a_k w_k and impulses λ_k/a_k, it is this disc,
// the slip has the direction of maximum dissipation, and the compliance is R_t/a_k² (as MuJoCo's, Computation,
// "Contact"). The rows of a point have such tangents (prepare_rows.cpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <fork1s/base/types.hpp>

#include "law.hpp"

namespace fork1s::internal {

enum class ContactMode { kOpen, kSticking, kSliding };

struct FrictionCone {
  using Impulse = Vector3;
  using Jacobian = Matrix3;

  double R_n = 0, R_t = 0;    // m/s per N·s
  double coefficient = 0;     // µ
  double share = 1;           // of µ that counts
  double frozen_normal = -1;  // N·s: impulse that the bound is taken from; below 0: Π_n(y)
  double dilatancy = 0;       // share δ of µ by which slip opens the contact; 1: associated, convex

  /// y, and the friction bound s at it.
  struct Trial {
    double normal = 0;
    Vector2 tangent = Vector2::Zero();
    double size = 0, bound = 0;  // |y_t|, s
    double rho_t = 0;            // ρ of the tangents
    bool IsOpen() const { return !(normal > 0); }
    bool Slides() const { return size > bound; }
    /// |y_t| over its bound; at y = −w/R what would hold the point: above 1 it slides.
    double Utilization() const { return bound > 0 ? size / bound : 0; }
  };

  /// The normal impulse that bounds follow.
  double BoundingNormal(double normal) const {
    return frozen_normal >= 0 ? frozen_normal : std::max(normal, 0.0);
  }
  bool IsFrozen() const { return frozen_normal >= 0; }
  /// s [N·s]
  double Bound(double normal) const { return share * coefficient * normal; }

  Trial At(double normal, const Vector2& tangent, double rho_t) const {
    return {normal, tangent, tangent.norm(), Bound(BoundingNormal(normal)), rho_t};
  }
  /// y = −w/R.
  Trial AtVelocity(const Vector3& w) const { return At(-w[0] / R_n, w.tail<2>() / -R_t, 1 / R_t); }
  /// y_n of the natural map.
  double TrialNormal(double impulse_n, double w_n, double inverse_mass) const {
    return impulse_n - (w_n + R_n * impulse_n) / (inverse_mass + R_n);
  }
  /// y of the natural map, its normal as above.
  Trial NaturalTrial(double normal, const Vector3& impulse, const Vector3& w, double inverse_mass) const {
    const double rho_t = NaturalMapScale(inverse_mass, R_t);
    return At(normal, impulse.tail<2>() - rho_t * (w.tail<2>() + R_t * impulse.tail<2>()), rho_t);
  }

  ContactMode ModeOf(const Trial& y) const {
    if (y.IsOpen()) return ContactMode::kOpen;
    return y.Slides() ? ContactMode::kSliding : ContactMode::kSticking;
  }
  Vector3 Project(const Trial& y) const {
    const double share_left = y.Slides() ? y.bound / y.size : 1;
    return {std::max(y.normal, 0.0), share_left * y.tangent[0], share_left * y.tangent[1]};
  }
  /// D of the mode λ = −D w that y is on, closed or frozen; `slides`: as y_t does, though it may be within s.
  /// Sliding with e = y_t/|y_t|, β = min(1, s/|y_t|), κ = β ρ/(1 − β (1 − ρ R_t)):
  ///     λ_n = −w_n/R_n,   λ_t = µ λ_n e − κ (1 − e eᵀ) w_t
  void Linearize(const Trial& y, bool slides, Matrix3& D) const {
    D.setZero();
    if (!y.IsOpen()) D(0, 0) = 1 / R_n;
    if (!slides) {
      D(1, 1) = D(2, 2) = 1 / R_t;
      return;
    }
    const Vector2 e = y.tangent / y.size;
    const double beta = std::min(1.0, y.bound / y.size),
                 kappa = beta * y.rho_t / (1 - beta * (1 - y.rho_t * R_t));
    if (!IsFrozen()) D.block<2, 1>(1, 0) = share * coefficient / R_n * e;
    D.bottomRightCorner<2, 2>() = kappa * (Eigen::Matrix2d::Identity() - e * e.transpose());
  }
  /// −∂λ/∂w where y = −w/R.
  void Derivative(const Trial& y, Matrix3& D) const {
    if (y.IsOpen() && !(frozen_normal > 0))
      D.setZero();
    else
      Linearize(y, y.Slides(), D);
  }
  /// ∂λ_t/∂share where it slides.
  Vector2 ByShare(const Trial& y) const { return coefficient * y.normal / y.size * y.tangent; }
  /// Utilization at y = −w/R, from the tangents of w.
  double Utilization(const Vector2& w_t, double bound) const {
    return bound > 0 ? w_t.norm() / (R_t * bound) : 0;
  }
  /// Largest share of the way between two tangential impulses that stays within `bound`, or within |from| if that
  /// is more.
  static double ShareWithin(const Vector2& from, const Vector2& to, double bound) {
    const double limit2 = std::max(bound * bound, from.squaredNorm());
    if (to.squaredNorm() <= limit2) return 1;
    const Vector2 way = to - from;
    const double a = way.squaredNorm(), b = from.dot(way), c = from.squaredNorm() - limit2;
    return std::clamp((-b + std::sqrt(std::max(0.0, b * b - a * c))) / a, 0.0, 1.0);
  }

  /// With dilatancy δ: slip u = w_t + R_t λ_t opens the contact by δ µ |u|, so that
  ///     λ_n = (−w_n + δ µ |w_t|)/(R_n + δ µ² R_t),   λ_t = µ λ_n e,   e = −w_t/|w_t|
  ContactMode ProjectDilatant(const Vector3& w, Vector3& impulse, Matrix3* D) const {
    const double mu = share * coefficient, size = w.tail<2>().norm();
    if (D) D->setZero();
    if (size * R_n <= -mu * w[0] * R_t) {  // within
      impulse << -w[0] / R_n, w.tail<2>() / -R_t;
      if (D) D->diagonal() << 1 / R_n, 1 / R_t, 1 / R_t;
      return ContactMode::kSticking;
    }
    const double R = R_n + dilatancy * mu * mu * R_t, normal = (dilatancy * mu * size - w[0]) / R;
    impulse.setZero();
    if (!(normal > 0)) return ContactMode::kOpen;
    const Vector2 e = size > 0 ? Vector2(w.tail<2>() / -size) : Vector2(Vector2::Zero());
    impulse << normal, mu * normal * e;
    if (D) {
      const Vector3 borne(1, mu * e[0], mu * e[1]), felt(1, dilatancy * mu * e[0], dilatancy * mu * e[1]);
      *D = borne * felt.transpose() / R;
      if (size > 0)
        D->bottomRightCorner<2, 2>() +=
            mu * normal / size * (Eigen::Matrix2d::Identity() - e * e.transpose());
    }
    return ContactMode::kSliding;
  }

  Vector3 Project(const Vector3& y) const { return Project(At(y[0], y.tail<2>(), 1 / R_t)); }
  Matrix3 Derivative(const Vector3& y) const {
    Matrix3 D;
    Derivative(At(y[0], y.tail<2>(), 1 / R_t), D);
    return D * Vector3(R_n, R_t, R_t).asDiagonal();
  }
  Vector3 Violation(const Vector3& impulse, const Vector3& w) const {
    return impulse - Project(AtVelocity(w));
  }
  /// With the bound s fixed.
  double Energy(const Vector3& y) const {
    const Trial trial = At(y[0], y.tail<2>(), 1 / R_t);
    const double within = std::min(trial.size, trial.bound), normal = std::max(y[0], 0.0);
    return 0.5 * R_n * normal * normal + R_t * within * (trial.size - 0.5 * within);
  }
};
static_assert(ConstraintLaw<FrictionCone>);

}  // namespace fork1s::internal
