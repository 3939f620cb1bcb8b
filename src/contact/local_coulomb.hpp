// Coulomb's law at one contact, solved exactly while all other contacts stand still.
//
// With u = D λ + b (normal first) and the tangents turned so that the Schur complement
// S = D_tt − d dᵀ / D_nn is diagonal, the three cases are
//     separate   b_n ≥ 0                        λ = 0
//     stick      u = 0                          λ_i = −c_i / s_i,        c = b_t − d b_n / D_nn
//     slide      u_n = 0, u_t = −α λ_t          λ_i = −c_i / (s_i + α),  |λ_t| = µ λ_n
// always with λ_n = −(b_n + d·λ_t) / D_nn. Sliding is one equation in α > 0: outside the cone at α = 0 and
// inside it as α → ∞, so a bracketed Newton iteration cannot fail. It is solved for the ratio
// µ λ_n / |λ_t| = 1, which is linear in α for isotropic S, from the root of the sweep before.
#pragma once

#include <cmath>

namespace fork1s::internal {

struct LocalCoulomb {
  double nn = 0, n1 = 0, n2 = 0, t11 = 0, t12 = 0, t22 = 0;  // D, slightly regularised; [n, 1, 2]
  double nn_inverse = 0;
  double s1 = 0, s2 = 0, s1_inverse = 0, s2_inverse = 0;  // eigenvalues of S
  double friction = 0;
  double alpha = 0;  // |u_t| / |λ_t| where it slid last

  /// Replaces `impulse`, at which the contact velocity is `u`, by the solution.
  void Solve(const double* u, double* impulse) {
    const double l0 = impulse[0], l1 = impulse[1], l2 = impulse[2];
    const double b0 = u[0] - (nn * l0 + n1 * l1 + n2 * l2);
    if (b0 >= 0) {
      impulse[0] = impulse[1] = impulse[2] = 0;
      return;
    }
    if (friction == 0) {
      impulse[0] = -b0 * nn_inverse;
      impulse[1] = impulse[2] = 0;
      return;
    }
    const double c1 = u[1] - (n1 * l0 + t11 * l1 + t12 * l2) - n1 * b0 * nn_inverse;
    const double c2 = u[2] - (n2 * l0 + t12 * l1 + t22 * l2) - n2 * b0 * nn_inverse;
    double x1 = -c1 * s1_inverse, x2 = -c2 * s2_inverse;
    double x0 = -(b0 + n1 * x1 + n2 * x2) * nn_inverse;
    if (x0 < 0 || x1 * x1 + x2 * x2 > friction * friction * x0 * x0) Slide(b0, c1, c2, x0, x1, x2);
    impulse[0] = x0;
    impulse[1] = x1;
    impulse[2] = x2;
  }

 private:
  void Slide(double b0, double c1, double c2, double& x0, double& x1, double& x2) {
    constexpr int kMaxIterations = 60;
    // Of the ratio. The last step is kept for the next sweep, which starts with its square as error.
    constexpr double kTolerance = 1e-3;
    double low = 0, high = -1, t = 0;
    for (int i = 0; i < kMaxIterations; ++i) {
      const double g1 = 1 / (s1 + alpha), g2 = 1 / (s2 + alpha);
      x1 = -c1 * g1;
      x2 = -c2 * g2;
      x0 = -(b0 + n1 * x1 + n2 * x2) * nn_inverse;
      const double t_squared = x1 * x1 + x2 * x2;
      t = std::sqrt(t_squared);
      const double error = friction * x0 - t;  // t times (ratio − 1)
      if (error < 0) low = alpha;
      if (error > 0) high = alpha;
      const double dt = -(x1 * x1 * g1 + x2 * x2 * g2) / t;
      const double dx0 = (n1 * x1 * g1 + n2 * x2 * g2) * nn_inverse;
      const double slope = friction * (dx0 - x0 * dt / t);  // t times the derivative of the ratio
      double next = slope != 0 ? alpha - error / slope : -1;
      if (!(next > low) || (high >= 0 && next >= high)) {
        next = high >= 0 ? 0.5 * (low + high) : 2 * alpha + s1 + s2;
      }
      const bool done = next == alpha || std::abs(error) <= kTolerance * t;
      alpha = next;
      if (done) break;
    }
    // Whatever is left of the iteration's error goes into the direction: the law itself holds exactly.
    if (!(t > 0)) {
      x0 = -b0 * nn_inverse;
      x1 = x2 = 0;
      return;
    }
    const double e1 = x1 / t, e2 = x2 / t;
    const double effective = nn + friction * (n1 * e1 + n2 * e2);
    x0 = effective > 1e-9 * nn ? -b0 / effective : std::fmax(x0, 0.0);
    x1 = friction * x0 * e1;
    x2 = friction * x0 * e2;
  }
};

}  // namespace fork1s::internal
