#include "contact_law.hpp"
#include "mechanism/restitution.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s::internal {

void SetLaw(const CollisionGeom& a, const CollisionGeom& b, ContactPoint& out) {
  const CollisionGeom& first = b.priority > a.priority ? b : a;
  const CollisionGeom& second = a.priority > b.priority ? a : b;
  if (!first.frictionless || !second.frictionless) out.friction = std::max(first.friction, second.friction);
  const int moments = std::max(first.moments, second.moments);
  if (moments > 0) out.torsion = std::max(first.torsion, second.torsion);
  if (moments > 1) out.rolling = std::max(first.rolling, second.rolling);
  out.adhesion_gap = a.gap + b.gap;
  out.adhesion = a.priority == b.priority ? a.adhesion + b.adhesion : first.adhesion;
  if (first.restitution > 0 || second.restitution > 0)
    out.restitution =
        RestitutionOf(0.5 * (DampingRatioOf(first.restitution) + DampingRatioOf(second.restitution)));
}

void SetLaw(const ContactPairDef& pair, ContactPoint& out) {
  out.friction = pair.friction;
  out.friction_scale = pair.friction_scale;
  out.torsion = pair.torsion;
  out.rolling = pair.rolling;
  out.restitution = pair.restitution;
  out.adhesion_gap = pair.gap;
  out.adhesion = pair.adhesion;
}

const char* ProblemOf(const ContactPairDef& pair) {
  const auto usable = [](double coefficient) { return coefficient >= 0 && std::isfinite(coefficient); };
  if (!usable(pair.friction) || !usable(pair.torsion) || !usable(pair.rolling))
    return "friction must be finite and not negative";
  if (!((pair.friction_scale.array() >= 0).all() && pair.friction_scale.allFinite()))
    return "friction by direction must be finite and not negative";
  if (!usable(pair.adhesion)) return "adhesion must be finite and not negative";
  if (!(pair.restitution >= 0 && pair.restitution <= 1)) return "restitution must be 0 to 1";
  if (!(pair.gap >= 0 && std::isfinite(pair.gap))) return "gap must be finite and not negative";
  return std::isfinite(pair.margin) ? nullptr : "margin must be finite";
}

}  // namespace fork1s::internal
