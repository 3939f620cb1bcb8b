#include "contact_patch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace fork1s::internal {
namespace {

constexpr double kSame = 1e-6;  // m: points that near carry what one of them carries
// m: a corner between kept ones bears nothing that they do not while it is deeper by less. What rests presses in by
// ContactMaterial::depth, ten times that, at most; so it tilts by that over its size, and between two of eight points of
// a rim the rim is deeper by less than a twentieth of depth.
constexpr double kAsDeep = 1e-6;
constexpr double kOneNormal = 1e-8;  // rad: over 1 m a hundredth of kAsDeep
// rad: no angle of a regular polygon, of which two corners would be as far
constexpr double kFirstDirection = 0.1234;

// rad: where lines cross at more, the point that touches runs along them by less than ten times their height for each radian
constexpr double kNearlyParallel = 0.1;
constexpr double kSameSide = 0.95;  // cosine of normals: lines apart that far pass each other
constexpr double kNearEnd = 0.01;   // of a length: what is nearer to an end carries what the end carries
constexpr double kBesides = 1e-9;   // of a length: the ends of lines of one length lie beside each other

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

bool AreNearlyParallel(const Vector3& a, const Vector3& b) {
  return a.cross(b).norm() <= kNearlyParallel * a.norm() * b.norm();
}

// The edge of a face that is nearest to the middle of a line, of those that are nearly parallel to it.
std::optional<SupportFace> NearestEdge(const SupportFace& face, const SupportFace& line) {
  const Vector3 middle = 0.5 * (line[0] + line[1]);
  std::optional<SupportFace> nearest;
  double least = 0;
  for (int i = 0; i < face.count; ++i) {
    const Vector3 &from = face[i], &to = face[(i + 1) % face.count], along = to - from;
    if (!AreNearlyParallel(along, line[1] - line[0])) continue;
    const double distance = along.cross(middle - from).norm() / along.norm();
    if (nearest && !(distance < least)) continue;
    least = distance;
    nearest.emplace();
    nearest->Add(from);
    nearest->Add(to);
  }
  return nearest;
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
  if (base.count == 2) return AddAlongLines(a, b, margin);
  Vector3 area = Area(base);
  const double size = area.norm();
  if (!(std::abs(area.dot(up)) > 0.1 * size)) return;  // seen from its side
  const double turn = area.dot(up) > 0 ? 1 : -1;
  Polygon overlap;
  for (int i = 0; i < other.count; ++i) overlap.Add(other[i]);
  for (int i = 0; i < base.count && overlap.count > 0; ++i) {
    const Vector3& from = base[i];
    Clip(from, turn * up.cross(base[(i + 1) % base.count] - from), other.count > 2, overlap);
  }
  for (int i = 0; i < overlap.count; ++i) {
    // No two points are nearer along the normal; but where MuJoCo made one face of several that are nearly
    // level, a plane through its corners sticks out.
    const double nearest = deepest_ ? deepest_->gap : -std::numeric_limits<double>::infinity(),
                 height = std::max(area.dot(overlap[i] - base[0]) / area.dot(up), nearest);
    if (height < margin) Add(overlap[i] - 0.5 * height * up, height);
  }
  if (other.count > 2) return;
  if (const auto edge = NearestEdge(base, other))
    AddAlongLines(a_is_base ? *edge : a, a_is_base ? b : *edge, margin);
}

// Round sides and edges that are nearly parallel touch in one point, which runs along them where they tilt: for each radian
// by its height over their angle. Where they begin and end to lie beside each other, points bear along normals of their own.
void ContactPatch::AddAlongLines(const SupportFace& a, const SupportFace& b, double margin) {
  const Vector3 along_a = a[1] - a[0], along_b = b[1] - b[0], start_a = a[0] + a.to_axis,
                start_b = b[0] + b.to_axis;
  if (!AreNearlyParallel(along_a, along_b)) return;
  const double radius_a = a.to_axis.norm(), radii = radius_a + b.to_axis.norm(),
               near = kNearEnd * std::min(along_a.norm(), along_b.norm());
  const auto replace_near = [&](const PatchPoint& by) {
    const auto is_near = [&](const PatchPoint& p) {
      return (p.point - by.point).squaredNorm() < near * near;
    };
    count_ = static_cast<int>(std::remove_if(points_.begin(), points_.begin() + count_, is_near) -
                              points_.begin());
    // Where the deepest point is the end, it has the normal of a rim.
    Add(deepest_ && is_near(*deepest_) ? *deepest_ : by);
  };
  const auto add = [&](const Vector3& on_a, const Vector3& on_b) {
    const double distance = (on_b - on_a).norm();
    double gap = distance - radii;
    const Vector3 normal = (on_b - on_a) / distance, point = on_a + (radius_a + 0.5 * gap) * normal;
    if (!(normal.dot(normal_) > kSameSide && gap < margin)) return;
    if (deepest_) {
      // The flat end of a cylinder is nearer to its axis than its side.
      if (gap < deepest_->gap - kAsDeep) return;
      gap = std::max(gap, deepest_->gap);
    }
    replace_near({point, gap, normal});
  };
  // The end of an axis, and the point beside it of another. Lines of one length that cross in the middle end a little before
  // the planes across their ends.
  const double beyond = kBesides + along_a.norm() * along_b.norm() / std::abs(along_a.dot(along_b)) - 1;
  const auto beside = [beyond](const Vector3& end, const Vector3& along, const Vector3& start,
                               const Vector3& of_other) -> std::optional<Vector3> {
    const double share = along.dot(end - start) / along.dot(of_other);
    if (!(share > -beyond && share < 1 + beyond)) return {};
    return start + share * of_other;
  };
  for (const double side : {0.0, 1.0}) {
    const Vector3 end_a = start_a + side * along_a, end_b = start_b + side * along_b;
    if (const auto on_b = beside(end_a, along_a, start_b, along_b)) add(end_a, *on_b);
    if (const auto on_a = beside(end_b, along_b, start_a, along_a)) add(*on_a, end_b);
  }
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
  const auto is_as_deep = [&](const PatchPoint& p) {
    return p.gap < deepest_->gap + kAsDeep && (p.normal - normal_).squaredNorm() < kOneNormal * kOneNormal;
  };
  if (deepest_ && std::none_of(points_.begin(), points_.begin() + count_, is_as_deep)) Add(*deepest_);
  return count_;
}

}  // namespace fork1s::internal
