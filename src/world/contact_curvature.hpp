// Curvature of two surfaces where they touch, and how far a contact migrates by it when one rolls on the other.
#pragma once

#include <fork1s/world/world.hpp>

namespace fork1s {

/// Curvatures [1/m] of both surfaces at a contact, on the tangents of its frame (rows 1 and 2), convex
/// positive. Edges and corners have radii of a millionth of `size` [m], the radius of the smaller shape
/// (World::PairSize), and so has every point of a mesh or height field, whose curvature between facets is not known.
struct PairCurvature {
  Eigen::Matrix2d a = Eigen::Matrix2d::Zero(), b = Eigen::Matrix2d::Zero();
};
PairCurvature ComputeCurvature(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                               const RigidTransform& X_WB, const ContactPoint& point, double size);

/// (κ_a + κ_b)⁻¹ [m], and the projector on directions in which flat lies on flat, where that inverse is zero.
struct CurvatureInverse {
  Eigen::Matrix2d inverse = Eigen::Matrix2d::Zero(), flat = Eigen::Matrix2d::Identity();
};
CurvatureInverse Invert(const PairCurvature& curvature);

/// (κ_a + κ_b)⁻¹ [m] on the tangent plane of a contact, world axes, zero along the normal: when b turns against a by
/// φ, the point moves along both surfaces by this times φ x n. Zero in directions in which flat lies on flat, where
/// further contacts hold the turn. docs/method.md, (6.2).
Matrix3 ComputeInverseCurvature(const GeometryDef& a, const RigidTransform& X_WA, const GeometryDef& b,
                                const RigidTransform& X_WB, const ContactPoint& point, double size);
/// At the present poses.
Matrix3 ComputeInverseCurvature(const World& world, const ContactPoint& point);

}  // namespace fork1s
