// Stiffness that a force meets at a point of a body.
#pragma once

#include <string>
#include <vector>

#include "reduction/tangent_stiffness.hpp"

namespace fork1s {

struct PointStiffness {
  InterfaceCompliance compliance;  ///< about the point, of one body
  std::vector<std::string> free;   ///< sentences (FreeMotion::Text) on motions that nothing resists there
  double length = 1;               ///< m, size of the mechanism

  /// Force per displacement [N/m] along a direction in world axes, all else free: 0 where such a motion moves
  /// the point along it, infinite where nothing elastic does.
  double Along(const Vector3& direction_W) const;
  /// 6 x 6; empty where a motion that nothing resists moves the body.
  MatrixX Compliance() const { return compliance.free.cols() > 0 ? MatrixX() : compliance.C; }
  /// Its inverse, empty where it has none.
  MatrixX Stiffness() const { return StiffnessFromCompliance(compliance, length); }
};

/// Of the springs alone at q, the base held, with coordinates locked (CoordinatesToLock).
PointStiffness ComputeSpringStiffness(const Mechanism& mechanism, const VectorX& q, const BodyPoint& point,
                                      const std::vector<int>& locked = {});

/// About the equilibrium q under load, the base held.
PointStiffness ComputePointStiffness(const Mechanism& mechanism, const VectorX& q,
                                     const TangentStiffness& tangent, const BodyPoint& point);

}  // namespace fork1s
