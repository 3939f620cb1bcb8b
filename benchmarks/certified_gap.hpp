// The signed distance of two convex shapes with a proof of it, by a method that no collision detector takes.
//
// Let a(n), b(-n) be the points of the two shapes that lie farthest along n and -n, and m(n) = b(-n) - a(n).
// The gap is
//     g = max over unit n of s(n),   s(n) = n . m(n) = min over all points (n . b - n . a):
// the distance where the shapes are apart, less than zero the depth of penetration. Every n bounds g from
// below. From above: s(n) <= n . m for every m = b - a, so over a patch of directions with the corners n1,
// n2, n3 no s exceeds max n . m of any mixture m of m(n1), m(n2), m(n3). Patches are halved, the one with the
// largest bound first, until the bounds meet. This finds the largest s anywhere, whether it is one of many
// or not, and needs no tolerance of an algorithm to be guessed: the two bounds are the proof.
#pragma once

#include <fork1s/geometry/shape.hpp>
#include <fork1s/spatial/rigid_transform.hpp>
#include <vector>

namespace fork1s::benchmarks {

/// A convex shape in the world: the hull of a core, and everything within `radius` of it.
struct ConvexBody {
  enum class Core { kPoints, kEllipsoid, kCylinder };
  Core core = Core::kPoints;
  std::vector<Vector3> points;     // own frame, m; the core is their hull
  Vector3 size = Vector3::Zero();  // radii of an ellipsoid; radius and half length of a cylinder
  double radius = 0;               // m
  RigidTransform X;                // frame in the world

  /// The point of the core farthest along n, world frame.
  Vector3 Farthest(const Vector3& n) const;
};

/// Spheres, capsules, cylinders, ellipsoids, boxes and meshes.
ConvexBody MakeConvexBody(const Shape& shape);

struct CertifiedGap {
  double gap = 0;                    // m, the lower bound
  double open = 0;                   // m, upper less lower bound
  Vector3 normal = Vector3::Zero();  // from a to b, with s(normal) = gap
};

struct CertifyOptions {
  double tolerance = 1e-10;  // m between the bounds
  double enough = 1e300;     // m: stop when the gap is known to be larger
  int most = 20000;          // directions
};

CertifiedGap Certify(const ConvexBody& a, const ConvexBody& b, const CertifyOptions& options = {});

/// s(n): what a unit normal proves about the gap.
double GapAlong(const ConvexBody& a, const ConvexBody& b, const Vector3& n);

}  // namespace fork1s::benchmarks
