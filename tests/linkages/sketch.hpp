// A linkage as an engineer draws it: bodies in place and pairs between them, no tree and no closures yet.
//
// Which pairs become joints of the spanning tree and which become closures is chosen when the sketch is
// assembled, so that one linkage can be written down in many ways that must all answer alike.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s::linkages {

enum class PairKind { kHinge, kSlide, kBall, kCylindrical, kUniversal, kPlanar, kWeld, kBushing };

/// Freedoms that a pair leaves, turning and sliding; a bushing leaves all and is only springs.
struct PairFreedoms {
  int turns, slides;
};
constexpr PairFreedoms FreedomsOf(PairKind kind) {
  switch (kind) {
    case PairKind::kHinge:
      return {1, 0};
    case PairKind::kSlide:
      return {0, 1};
    case PairKind::kBall:
      return {3, 0};
    case PairKind::kCylindrical:
      return {1, 1};
    case PairKind::kUniversal:
      return {2, 0};
    case PairKind::kPlanar:
      return {1, 2};
    case PairKind::kWeld:
      return {0, 0};
    case PairKind::kBushing:
      return {3, 3};
  }
  return {0, 0};
}

/// Joins bodies a and b at a frame whose z axis is the pair's axis (hinge, slide, cylinder) or normal
/// (plane); a universal joint turns about its x and y.
struct Pair {
  int a = 0, b = 0;
  PairKind kind = PairKind::kHinge;
  Vector3 point = Vector3::Zero();  // m
  Matrix3 frame = Matrix3::Identity();
  double k_turn = 0;             // N·m/rad on every turning freedom
  double k_slide = 0;            // N/m on every sliding one
  unsigned bushing = 0;          // directions in which a bushing has springs, bit i for row i
  bool in_tree = false;          // must be a joint, since a tendon or coupling names its coordinate
  std::vector<double> armature;  // empty, or one value
};

/// Σ coefficient q over pairs of one freedom.
struct TendonTerm {
  int pair;
  double coefficient;
};
struct Tendon {
  std::vector<TendonTerm> terms;
  double stiffness;
};
/// q_a = slope q_b + bend q_b².
struct GearPair {
  int a, b;
  double slope, bend;
};

struct Sketch {
  std::string family;
  std::vector<RigidTransform> X;  // poses of the bodies in the sketch; body 0 is the base, and R its frame
  std::vector<SpatialInertia> inertia;
  std::vector<Pair> pairs;
  std::vector<Tendon> tendons;
  std::vector<GearPair> gears;
  std::vector<int> interfaces;
  RigidTransform X_WS;  // the sketch in the world
  double size = 1;      // m, of the linkage without its distance from R

  int AddBody(const RigidTransform& X_SB, const SpatialInertia& I);
  Pair& AddPair(int a, int b, PairKind kind, const Vector3& point, const Matrix3& frame);
};

/// A frame whose z axis is `axis`.
Matrix3 FrameAlong(const Vector3& axis);

/// Every length times `factor`; turning stiffness and masses stay, sliding stiffness follows.
Sketch Scaled(Sketch sketch, double factor);
/// The base's frame, and with it R, put elsewhere; bodies stay where they are in the world.
Sketch WithRoot(Sketch sketch, const RigidTransform& X_SR);
/// All in another place of the world.
Sketch Moved(Sketch sketch, const RigidTransform& X_WS);

/// How a sketch is written down.
struct Writing {
  unsigned seed = 0;           // spanning tree, order of bodies and joints
  bool other_names = false;    // bodies and joints called otherwise
  bool keep_order = false;     // tree from the pairs in their order, bodies in theirs where that can be
  bool sprung_joints = false;  // pairs with springs become joints before others do
};

/// The definition: body i is named "b<i>", pair k "p<k>" whatever the order.
MechanismDef Write(const Sketch& sketch, const Writing& writing = {});

/// A mechanism with its interface bodies in the order of the sketch.
struct Written {
  std::shared_ptr<const Mechanism> mechanism;
  std::vector<BodyIndex> interfaces;
};
Written Build(const Sketch& sketch, const Writing& writing = {});

}  // namespace fork1s::linkages
