// Several contact points where two convex shapes rest on each other, of the faces that look at each other.
#pragma once

#include <array>
#include <fork1s/base/types.hpp>
#include <optional>

namespace fork1s::internal {

/// The part of a convex shape's surface that looks along a direction: a corner, the line of a round side or the corners
/// of a flat face one after another, in the world.
struct SupportFace {
  static constexpr int kMost = 32;
  std::array<Vector3, kMost> corners;
  int count = 0;
  Vector3 to_axis = Vector3::Zero();  // m: from a line to the axis of its round side; of an edge zero

  void Add(const Vector3& corner) { corners[static_cast<std::size_t>(count++)] = corner; }
  const Vector3& operator[](int i) const { return corners[static_cast<std::size_t>(i)]; }
};

struct PatchPoint {
  Vector3 point = Vector3::Zero();   // midway between the surfaces
  double gap = 0;                    // along the normal, m
  Vector3 normal = Vector3::Zero();  // unit, from a to b
};

/// What may hold two shapes apart: the corners of the overlap of two faces, seen along the normal, and the ends of that of
/// two lines.
class ContactPatch {
 public:
  /// `normal`: unit, from a to b.
  explicit ContactPatch(const Vector3& normal) : normal_(normal) {}
  /// The deepest point as a search found it. On a flat face that may be any point: a corner as deep counts
  /// instead.
  void SetDeepest(const Vector3& point, double gap) { deepest_ = {point, gap, normal_}; }
  void Add(const Vector3& point, double gap) { Add({point, gap, normal_}); }
  /// Adds the corners of the overlap that are nearer than `margin`, and of two lines that are nearly parallel, or of a line
  /// and the edge of a face that it rests on, where they begin and end to lie beside each other.
  void AddOverlap(const SupportFace& a, const SupportFace& b, double margin);
  /// Keeps the deepest point, and of more than eight those farthest along eight directions; returns how many.
  /// Which these are does not hang on gaps that differ by little: points that changed from step to step would
  /// shake what rests on them.
  int ChooseSupport();
  const PatchPoint& operator[](int i) const { return points_[static_cast<std::size_t>(i)]; }

 private:
  static constexpr int kMost = 2 * SupportFace::kMost + 1, kSupport = 16;

  void Add(const PatchPoint& point);
  void AddAlongLines(const SupportFace& a, const SupportFace& b, double margin);
  void MergeEquals();
  void SelectOutermost();

  Vector3 normal_;
  std::optional<PatchPoint> deepest_;
  std::array<PatchPoint, kMost> points_;
  int count_ = 0;
};

}  // namespace fork1s::internal
