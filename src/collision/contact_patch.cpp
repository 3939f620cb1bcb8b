#include "contact_patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace fork1s::internal {
namespace {

constexpr double kSame = 1e-6;   // m: points that near carry what one of them carries
constexpr double kExact = 1e-8;  // m: the detector's gaps are no better where shapes are stored as floats

// Room for a face that every edge of another may give one more corner.
struct Polygon {
  std::array<Vector3, 2 * SupportFace::kMost> corners;
  int count = 0;
  void Add(const Vector3& p) {
    if (count < static_cast<int>(corners.size())) corners[static_cast<std::size_t>(count++)] = p;
  }
  const Vector3& operator[](int i) const { return corners[static_cast<std::size_t>(i)]; }
};

// Twice the area vector.
Vector3 Area(const SupportFace& face) {
  Vector3 sum = Vector3::Zero();
  for (int i = 1; i + 1 < face.count; ++i) sum += (face[i] - face[0]).cross(face[i + 1] - face[0]);
  return sum;
}

// Cuts away what lies on the negative side of a plane through `origin`.
void Clip(const Vector3& origin, const Vector3& inward, bool closed, Polygon& polygon) {
  const double tolerance = 1e-9 * inward.norm();  // m: faces of one size share their edges
  std::array<double, 2 * SupportFace::kMost> heights;
  bool cuts = false;
  for (int i = 0; i < polygon.count; ++i) {
    heights[static_cast<std::size_t>(i)] = inward.dot(polygon[i] - origin);
    cuts = cuts || !(heights[static_cast<std::size_t>(i)] >= -tolerance);
  }
  if (!cuts) return;
  Polygon kept;
  for (int i = 0; i < polygon.count; ++i) {
    const Vector3& p = polygon[i];
    const double here = heights[static_cast<std::size_t>(i)];
    if (here >= -tolerance) kept.Add(p);
    if (!closed && i + 1 == polygon.count) break;
    const int next = i + 1 == polygon.count ? 0 : i + 1;
    const Vector3& q = polygon[next];
    const double there = heights[static_cast<std::size_t>(next)];
    if ((here < -tolerance && there > tolerance) || (here > tolerance && there < -tolerance))
      kept.Add(p + here / (here - there) * (q - p));
  }
  std::copy_n(kept.corners.begin(), kept.count, polygon.corners.begin());
  polygon.count = kept.count;
}

}  // namespace

void ContactPatch::Add(const PatchPoint& point) {
  if (count_ < kMost) points_[static_cast<std::size_t>(count_++)] = point;
}

void ContactPatch::AddOverlap(const SupportFace& a, const SupportFace& b, double margin) {
  if (a.count < 2 || b.count < 2) return;
  // `base` has a plane, onto which `other` is seen along the normal.
  const bool a_is_base = a.count > 2;
  const SupportFace &base = a_is_base ? a : b, &other = a_is_base ? b : a;
  const Vector3 up = a_is_base ? normal_ : Vector3(-normal_);
  const auto add = [&](const Vector3& on_other, double height) {
    // No two points are nearer along the normal; but where MuJoCo made one face of several that are nearly
    // level, a plane through its corners sticks out.
    if (deepest_) height = std::max(height, deepest_->gap);
    if (height < margin) Add({on_other - 0.5 * height * up, height});
  };
  Polygon overlap;
  for (int i = 0; i < other.count; ++i) overlap.Add(other[i]);

  if (base.count == 2) {  // two edges: they carry together where they are parallel
    const Vector3 along = base[1] - base[0], of_other = other[1] - other[0];
    constexpr double kParallel = 0.01;  // rad: over 0.1 m, round sides of 30 mm part by 0.02 mm
    if (along.cross(of_other).norm() > kParallel * along.norm() * of_other.norm()) return;
    const Vector3 flat = along - along.dot(up) * up;
    if (flat.squaredNorm() < 0.01 * along.squaredNorm()) return;  // seen end on
    Clip(base[0], flat, false, overlap);
    Clip(base[1], -flat, false, overlap);
    for (int i = 0; i < overlap.count; ++i) {
      const double s = flat.dot(overlap[i] - base[0]) / flat.squaredNorm();
      add(overlap[i], up.dot(overlap[i] - base[0] - s * along));
    }
    return;
  }
  Vector3 area = Area(base);
  const double size = area.norm();
  if (!(std::abs(area.dot(up)) > 0.1 * size)) return;  // seen from its side
  const double turn = area.dot(up) > 0 ? 1 : -1;
  for (int i = 0; i < base.count && overlap.count > 0; ++i) {
    const Vector3& from = base[i];
    Clip(from, turn * up.cross(base[(i + 1) % base.count] - from), other.count > 2, overlap);
  }
  for (int i = 0; i < overlap.count; ++i) add(overlap[i], area.dot(overlap[i] - base[0]) / area.dot(up));
}

int ContactPatch::ChooseSupport() {
  double lowest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < count_; ++i) lowest = std::min(lowest, points_[static_cast<std::size_t>(i)].gap);
  int first = 0;
  while (first + 1 < count_ && points_[static_cast<std::size_t>(first)].gap > lowest + kExact) ++first;
  if (deepest_ && (count_ == 0 || points_[static_cast<std::size_t>(first)].gap > deepest_->gap + kExact)) {
    if (count_ == kMost) --count_;
    first = count_;
    Add(*deepest_);
  }
  if (count_ == 0) return 0;
  int chosen = 0;
  const auto take = [&](int i) {
    std::swap(points_[static_cast<std::size_t>(chosen)], points_[static_cast<std::size_t>(i)]);
    ++chosen;
  };
  take(first);

  // The one of the rest that most of something has more than `least` of.
  const auto take_most = [&](double least, const auto& measure) {
    int best = -1;
    for (int i = chosen; i < count_; ++i)
      if (const double value = measure(points_[static_cast<std::size_t>(i)].point); value > least) {
        best = i;
        least = value * (1 + 1e-9) + 1e-15;  // equals: the first
      }
    if (best >= 0) take(best);
    return best >= 0;
  };
  const auto across = [&](const Vector3& v) -> Vector3 { return v - v.dot(normal_) * normal_; };
  const Vector3 p = points_[0].point;
  if (!take_most(kSame, [&](const Vector3& q) { return across(q - p).norm(); })) return chosen;
  const Vector3 q = points_[1].point, side = normal_.cross(q - p).normalized();
  if (!take_most(kSame, [&](const Vector3& r) { return std::abs(side.dot(r - p)); })) {
    // All on one line, of which the deepest may be in the middle: its other end.
    const Vector3 back = (p - q).normalized();
    take_most(kSame, [&](const Vector3& r) { return back.dot(r - p); });
    return chosen;
  }
  // What lies outside of the triangle, by the area that it adds.
  Vector3 r = points_[2].point, s = q;
  if (side.dot(r - p) < 0) std::swap(r, s);
  const std::array<Vector3, 3> corner{p, s, r};  // counter-clockwise about the normal
  const double width = across(q - p).norm();
  take_most(kSame * width, [&](const Vector3& t) {
    double most = 0;
    for (std::size_t i = 0; i < 3; ++i)
      most = std::max(most, -normal_.dot((corner[(i + 1) % 3] - corner[i]).cross(t - corner[i])));
    return most;
  });
  return chosen;
}

}  // namespace fork1s::internal
