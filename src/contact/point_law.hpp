// Coulomb's law at one point whose material gives a little.
//
//     λ_n = max(0, −w_n/R_n),   y = −w_t/R_t,   λ_t = y min(1, s/|y|),   s = µ λ_n
// and D = −∂λ/∂w: open 0; sticking diag(1/R_n, 1/R_t, 1/R_t); sliding with e = y/|y| the column
// (1/R_n, µ e/R_n) and the tangential block s/(R_t |y|) (1 − e eᵀ). Where the bound s is frozen the first
// column has no tangential part, and the law is the gradient of a convex function.
#pragma once

#include <cmath>
#include <fork1s/base/types.hpp>

namespace fork1s::internal {

struct PointLaw {
  double R_n = 0, R_t = 0;  // velocity per impulse
  double friction = 0;
  double frozen_normal = -1;  // impulse that bounds are taken from; -1: λ_n
};

enum class PointState { kOpen, kSticking, kSliding };

/// λ for w, and D. `use`: |y| as a share of its bound, above 1 where it slides.
inline PointState Respond(const PointLaw& law, const Vector3& w, Vector3& impulse, Matrix3& D, double& use) {
  const bool frozen = law.frozen_normal >= 0;
  const double give = 1 / law.R_n, normal = -w[0] * give;
  const bool open = !(normal > 0);
  impulse.setZero();
  D.setZero();
  use = 0;
  if (open && !(law.frozen_normal > 0)) return PointState::kOpen;
  if (!open) {
    impulse[0] = normal;
    D(0, 0) = give;
  }
  const double bound = law.friction * (frozen ? law.frozen_normal : normal), give_t = 1 / law.R_t;
  const double y1 = -w[1] * give_t, y2 = -w[2] * give_t, size2 = y1 * y1 + y2 * y2;
  use = bound > 0 ? std::sqrt(size2) / bound : 0;
  if (size2 <= bound * bound) {
    impulse[1] = y1;
    impulse[2] = y2;
    D(1, 1) = D(2, 2) = give_t;
    return open ? PointState::kOpen : PointState::kSticking;
  }
  const double size = bound > 0 ? use * bound : std::sqrt(size2), e1 = y1 / size, e2 = y2 / size;
  impulse[1] = bound * e1;
  impulse[2] = bound * e2;
  const double across = bound * give_t / size;
  D(1, 1) = across * e2 * e2;
  D(1, 2) = D(2, 1) = -across * e1 * e2;
  D(2, 2) = across * e1 * e1;
  if (!frozen) {
    D(1, 0) = law.friction * e1 * give;
    D(2, 0) = law.friction * e2 * give;
  }
  return open ? PointState::kOpen : PointState::kSliding;
}

}  // namespace fork1s::internal
