#include "contact_patch.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fork1s::internal {
namespace {

constexpr double kSame = 1e-6;  // m: points that near carry what one of them carries
// m: a corner between kept ones bears nothing that they do not while it is deeper by less. What rests presses in by
// ContactMaterial::depth, ten times that, at most; so it tilts by that over its size, and between two of eight points of
// a rim the rim is deeper by less than a twentieth of depth.
constexpr double kAsDeep = 1e-6;
// rad: no angle of a regular polygon, of which two corners would be as far
constexpr double kFirstDirection = 0.1234;

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

void ContactPatch::MergeEquals() {
  int kept = 0;
  for (int i = 0; i < count_; ++i) {
    const PatchPoint& p = points_[static_cast<std::size_t>(i)];
    if (std::none_of(points_.begin(), points_.begin() + kept,
                     [&](const PatchPoint& q) { return (q.point - p.point).squaredNorm() < kSame * kSame; }))
      points_[static_cast<std::size_t>(kept++)] = p;
  }
  count_ = kept;
}

void ContactPatch::SelectOutermost() {
  std::array<bool, kMost> extreme{};
  // Of normals that differ by little, axes that do.
  const Vector3 x = normal_.cross(std::abs(normal_.x()) < 0.8 ? Vector3::UnitX() : Vector3::UnitY())
                        .normalized(),
                y = normal_.cross(x);
  const auto end = points_.begin() + count_;
  for (int k = 0; k < kSupport; ++k) {
    const double angle = kFirstDirection + k * 2 * std::numbers::pi / kSupport;
    const Vector3 along = std::cos(angle) * x + std::sin(angle) * y;
    const auto farthest = std::max_element(
        points_.begin(), end,
        [&](const PatchPoint& p, const PatchPoint& q) { return along.dot(p.point) < along.dot(q.point); });
    extreme[static_cast<std::size_t>(farthest - points_.begin())] = true;
  }
  int kept = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i)
    if (extreme[i]) points_[static_cast<std::size_t>(kept++)] = points_[i];
  count_ = kept;
}

int ContactPatch::ChooseSupport() {
  MergeEquals();
  for (int i = 0; i < count_; ++i)
    if (const PatchPoint& p = points_[static_cast<std::size_t>(i)]; !deepest_ || p.gap < deepest_->gap)
      deepest_ = p;
  if (count_ > kSupport) SelectOutermost();
  const auto is_as_deep = [&](const PatchPoint& p) { return p.gap < deepest_->gap + kAsDeep; };
  if (deepest_ && std::none_of(points_.begin(), points_.begin() + count_, is_as_deep)) Add(*deepest_);
  return count_;
}

}  // namespace fork1s::internal
