#include "certified_gap.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace fork1s::benchmarks {
namespace {

struct Direction {
  Vector3 n, m;  // unit; b(-n) - a(n)
};

struct Patch {
  std::array<Direction, 3> corner;  // counter-clockwise seen from outside
  double upper = 0;
};

// The point of a triangle nearest to the origin; rounding only makes the bound from it a little worse.
Vector3 NearestToOrigin(const Vector3& a, const Vector3& b, const Vector3& c) {
  const auto on_edge = [](const Vector3& p, const Vector3& q) -> Vector3 {
    const Vector3 d = q - p;
    const double length = d.squaredNorm();
    return length > 0 ? Vector3(p + std::clamp(-p.dot(d) / length, 0.0, 1.0) * d) : p;
  };
  Vector3 best = on_edge(a, b);
  for (const Vector3& p : {on_edge(b, c), on_edge(c, a)})
    if (p.squaredNorm() < best.squaredNorm()) best = p;
  const Vector3 n = (b - a).cross(c - a);
  const double area = n.squaredNorm();
  if (area > 0) {
    const double u = n.dot(b.cross(c)) / area, v = n.dot(c.cross(a)) / area, w = 1 - u - v;
    if (u >= 0 && v >= 0 && w >= 0) return u * a + v * b + w * c;
  }
  return best;
}

// The largest n . m of the unit vectors n in a patch.
double LargestProduct(const Patch& patch, const Vector3& m) {
  const auto& c = patch.corner;
  bool inside = true;
  double largest = -1e300;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3 &p = c[i].n, &q = c[(i + 1) % 3].n;
    const Vector3 across = p.cross(q);
    inside = inside && across.dot(m) >= 0;
    largest = std::max(largest, p.dot(m));
    // Along the arc from p to q the largest is at the projection of m, if that lies on the arc.
    if (across.cross(p).dot(m) > 0 && q.cross(across).dot(m) > 0)
      largest = std::max(largest, (m - across * (across.dot(m) / across.squaredNorm())).norm());
  }
  return inside ? m.norm() : largest;
}

void SetUpper(Patch& patch) {
  const auto& c = patch.corner;
  patch.upper = LargestProduct(patch, NearestToOrigin(c[0].m, c[1].m, c[2].m));
  for (const Direction& d : c) patch.upper = std::min(patch.upper, LargestProduct(patch, d.m));
}

bool LessUpper(const Patch& a, const Patch& b) { return a.upper < b.upper; }

}  // namespace

Vector3 ConvexBody::Farthest(const Vector3& n_W) const {
  const Vector3 n = X.rotation().transpose() * n_W;
  Vector3 p = Vector3::Zero();
  switch (core) {
    case Core::kPoints: {
      double most = -1e300;
      for (const Vector3& v : points)
        if (const double along = v.dot(n); along > most) {
          most = along;
          p = v;
        }
      break;
    }
    case Core::kEllipsoid: {
      const Vector3 scaled = size.cwiseProduct(n);
      p = size.cwiseProduct(scaled) / scaled.norm();
      break;
    }
    case Core::kCylinder: {
      const double flat = std::hypot(n.x(), n.y());
      if (flat > 0) p.head<2>() = size.x() / flat * n.head<2>();
      p.z() = n.z() >= 0 ? size.y() : -size.y();
      break;
    }
  }
  return X * p;
}

ConvexBody MakeConvexBody(const Shape& shape) {
  ConvexBody body;
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    body.points = {Vector3::Zero()};
    body.radius = sphere->radius;
  } else if (const auto* capsule = std::get_if<Capsule>(&shape)) {
    body.points = {Vector3(0, 0, -capsule->half_length), Vector3(0, 0, capsule->half_length)};
    body.radius = capsule->radius;
  } else if (const auto* ellipsoid = std::get_if<Ellipsoid>(&shape)) {
    body.core = ConvexBody::Core::kEllipsoid;
    body.size = ellipsoid->radii;
  } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    body.core = ConvexBody::Core::kCylinder;
    body.size = Vector3(cylinder->radius, cylinder->half_length, 0);
  } else if (const auto* box = std::get_if<Box>(&shape)) {
    for (int k = 0; k < 8; ++k)
      body.points.push_back(box->half.cwiseProduct(Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1)));
  } else if (const auto* mesh = std::get_if<MeshShape>(&shape)) {
    for (const auto& v : mesh->mesh->vertices) body.points.push_back(v.cast<double>());
  }
  return body;
}

double GapAlong(const ConvexBody& a, const ConvexBody& b, const Vector3& n) {
  return n.dot(b.Farthest(-n) - a.Farthest(n)) - a.radius - b.radius;
}

CertifiedGap Certify(const ConvexBody& a, const ConvexBody& b, const CertifyOptions& options) {
  CertifiedGap best;
  double lower = -1e300;
  int count = 0;
  const double radii = a.radius + b.radius;
  const auto look = [&](const Vector3& along) {
    Direction d;
    d.n = along.normalized();
    d.m = b.Farthest(-d.n) - a.Farthest(d.n);
    ++count;
    if (const double s = d.n.dot(d.m); s > lower) {
      lower = s;
      best.normal = d.n;
    }
    return d;
  };

  // Eight octants, turned so that no face of a shape lies along their edges.
  std::vector<Patch> heap;
  const Matrix3 turn = ExpRotation(Vector3(0.31, -0.47, 0.83));
  std::array<Direction, 6> axes;
  for (std::size_t i = 0; i < 6; ++i)
    axes[i] = look((i < 3 ? 1.0 : -1.0) * turn.col(static_cast<Eigen::Index>(i % 3)));
  for (std::size_t k = 0; k < 8; ++k) {
    const Direction &x = axes[k & 1 ? 3 : 0], &y = axes[k & 2 ? 4 : 1], &z = axes[k & 4 ? 5 : 2];
    const bool odd = ((k & 1) + (k >> 1 & 1) + (k >> 2 & 1)) % 2 == 1;
    Patch patch{odd ? std::array{x, z, y} : std::array{x, y, z}};
    SetUpper(patch);
    heap.push_back(patch);
  }
  std::make_heap(heap.begin(), heap.end(), LessUpper);
  while (heap.front().upper - lower > options.tolerance && count < options.most &&
         lower - radii <= options.enough) {
    std::pop_heap(heap.begin(), heap.end(), LessUpper);
    const Patch whole = heap.back();
    heap.pop_back();
    std::size_t longest = 0;
    for (std::size_t i = 1; i < 3; ++i) {
      const auto edge = [&](std::size_t e) {
        return (whole.corner[e].n - whole.corner[(e + 1) % 3].n).squaredNorm();
      };
      if (edge(i) > edge(longest)) longest = i;
    }
    const std::size_t next = (longest + 1) % 3;
    const Direction middle = look(whole.corner[longest].n + whole.corner[next].n);
    for (const std::size_t replaced : {longest, next}) {
      Patch half = whole;
      half.corner[replaced] = middle;
      SetUpper(half);
      half.upper = std::min(half.upper, whole.upper);
      if (half.upper <= lower) continue;
      heap.push_back(half);
      std::push_heap(heap.begin(), heap.end(), LessUpper);
    }
    if (heap.empty()) break;
  }
  best.gap = lower - radii;
  best.open = heap.empty() ? 0 : std::max(0.0, heap.front().upper - lower);
  return best;
}

}  // namespace fork1s::benchmarks
