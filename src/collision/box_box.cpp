#include "box_box.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "box_features.hpp"

// In the frame of a, R and p the pose of b. Along a unit vector n the boxes are apart by
//     s(n) = |n . p| - sum_i |n_i| half_a_i - sum_i |(R' n)_i| half_b_i.
// In penetration the depth is -max s over the normals of faces and the products of edges, 15 in all. Apart,
// these only bound the distance: it is between a corner of one and the nearest point of the other, or between
// two edges.
namespace fork1s::internal {
namespace {

struct NearestPoints {
  double squared = 1e300;
  Vector3 on_a, on_b;  // in the frame of a

  void Try(const Vector3& a, const Vector3& b) {
    if (const double d = (b - a).squaredNorm(); d < squared) {
      squared = d;
      on_a = a;
      on_b = b;
    }
  }
};

struct Edge {
  Vector3 corner = Vector3::Zero();
  int axis = 0;
};

// The inside of two edges where they pass each other, along an axis of a and along v; their ends belong to
// corners.
void TryEdges(const Vector3& middle_a, int axis, double half_a, const Vector3& middle_b, const Vector3& v,
              double half_b, NearestPoints& nearest) {
  const Vector3 w = middle_b - middle_a;
  const double uv = v[axis], uw = w[axis], vw = v.dot(w), sine = 1 - uv * uv;
  if (sine < 1e-14) return;  // parallel: corners are as near
  const double s = (uw - uv * vw) / sine, t = (uv * uw - vw) / sine;
  if (std::abs(s) > half_a || std::abs(t) > half_b) return;
  nearest.Try(middle_a + s * Vector3::Unit(axis), middle_b + t * v);
}

}  // namespace

bool BoxBox(const Vector3& half_a, const RigidTransform& X_A, const Vector3& half_b,
            const RigidTransform& X_B, double margin, Deepest& deepest) {
  const Matrix3 R_WA = X_A.rotation(), R = R_WA.transpose() * X_B.rotation();
  const Vector3 p = R_WA.transpose() * (X_B.translation() - X_A.translation());

  enum class From { kFaceOfA, kFaceOfB, kEdges } from = From::kFaceOfA;
  double most = -1e300;
  Vector3 normal = Vector3::UnitZ();
  Edge edge_a, edge_b;
  const auto try_normal = [&](const Vector3& n) {
    const double along = n.dot(p);
    const double s = std::abs(along) - n.cwiseAbs().dot(half_a) - (R.transpose() * n).cwiseAbs().dot(half_b);
    // Equals do not take over, so that a face does not lose its contact to its own edges.
    if (!(s > most + 1e-12)) return false;
    most = s;
    normal = along < 0 ? Vector3(-n) : n;
    return true;
  };
  for (int i = 0; i < 3; ++i) try_normal(Vector3::Unit(i));
  for (int k = 0; k < 3; ++k)
    if (try_normal(R.col(k))) from = From::kFaceOfB;
  if (most >= margin) return false;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      const Vector3 n = Vector3::Unit(i).cross(R.col(k));
      const double length = n.norm();
      // Parallel edges: the normals of faces are as good.
      if (length < 1e-7 || !try_normal(n / length)) continue;
      from = From::kEdges;
      edge_a = {DeepestCorner(half_a, normal), i};
      edge_b = {DeepestCorner(half_b, -(R.transpose() * normal)), k};
    }
  if (most >= margin) return false;

  if (most > 0) {
    NearestPoints nearest;
    for (int k = 0; k < 8; ++k) {
      const Vector3 of_a = Corner(half_a, k), of_b = p + R * Corner(half_b, k);
      nearest.Try(of_b.cwiseMin(half_a).cwiseMax(-half_a), of_b);
      const Vector3 in_b = R.transpose() * (of_a - p);
      nearest.Try(of_a, p + R * in_b.cwiseMin(half_b).cwiseMax(-half_b));
    }
    // As near as the best of the 15 is as near as can be: a corner over a face, most of the time.
    if (std::sqrt(nearest.squared) > most + 1e-12) {
      std::array<Vector3, 12> middle_b;
      for (int k = 0; k < 12; ++k)
        middle_b[static_cast<std::size_t>(k)] = p + R * EdgeMiddle(half_b, k / 4, k % 4);
      for (int i = 0; i < 12; ++i) {
        const Vector3 middle_a = EdgeMiddle(half_a, i / 4, i % 4);
        for (int k = 0; k < 12; ++k)
          TryEdges(middle_a, i / 4, half_a[i / 4], middle_b[static_cast<std::size_t>(k)], R.col(k / 4),
                   half_b[k / 4], nearest);
      }
    }
    deepest.gap = std::sqrt(nearest.squared);
    if (deepest.gap >= margin) return false;
    // Where one of the 15 is the normal, it says so more exactly than the difference of two near points.
    if (deepest.gap - most > 1e-9 * deepest.gap) normal = (nearest.on_b - nearest.on_a) / deepest.gap;
    deepest.point = 0.5 * (nearest.on_a + nearest.on_b);
  } else {
    deepest.gap = most;
    const Vector3 on_a = DeepestCorner(half_a, normal);
    const Vector3 on_b = p + R * DeepestCorner(half_b, -(R.transpose() * normal));
    if (from == From::kFaceOfA) {
      deepest.point = on_b - 0.5 * most * normal;
    } else if (from == From::kFaceOfB) {
      deepest.point = on_a + 0.5 * most * normal;
    } else {
      const Vector3 u = Vector3::Unit(edge_a.axis), v = R.col(edge_b.axis), a = edge_a.corner,
                    w = p + R * edge_b.corner - a;
      const double uv = u.dot(v), sine = 1 - uv * uv;
      const double s = (u.dot(w) - uv * v.dot(w)) / sine, t = (uv * u.dot(w) - v.dot(w)) / sine;
      deepest.point = a + 0.5 * (s * u + w + t * v);
    }
  }
  deepest.normal = R_WA * normal;
  deepest.point = X_A * deepest.point;
  return true;
}

}  // namespace fork1s::internal
