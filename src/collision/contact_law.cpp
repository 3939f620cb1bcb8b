#include "contact_law.hpp"

#include <algorithm>
#include <fork1s/mechanism/restitution.hpp>

namespace fork1s::internal {

void SetLaw(const CollisionGeom& a, const CollisionGeom& b, ContactPoint& out) {
  const CollisionGeom& first = b.priority > a.priority ? b : a;
  const CollisionGeom& second = a.priority > b.priority ? a : b;
  if (!first.frictionless || !second.frictionless) out.friction = std::max(first.friction, second.friction);
  const int moments = std::max(first.moments, second.moments);
  if (moments > 0) out.torsion = std::max(first.torsion, second.torsion);
  if (moments > 1) out.rolling = std::max(first.rolling, second.rolling);
  if (first.restitution > 0 || second.restitution > 0)
    out.restitution =
        RestitutionOf(0.5 * (DampingRatioOf(first.restitution) + DampingRatioOf(second.restitution)));
}

}  // namespace fork1s::internal
