// Which contact of the last step a contact is.
//
// A contact is the one of the last step that lies at the same place of either body: a corner of one keeps its
// place there however far it slides on the other, the place beside its axle where it rolls, and where neither
// keeps its place it is the nearest one. Of all such pairs the nearest first, whatever order the detector
// found them in.
#pragma once

#include <array>
#include <fork1s/world/world_state.hpp>
#include <tuple>
#include <vector>

#include "collision_body_shapes.hpp"

namespace fork1s {

/// What touches what.
inline auto Shapes(const ContactPoint& p) {
  return std::tuple(p.body_a, p.body_b, p.geometry_a, p.geometry_b);
}

class ContactMatcher {
 public:
  /// Room for that many contacts.
  void Reserve(std::size_t contacts);

  /// match[i] <- the contact of `previous` that points[i] is, or -1. `poses` [collision bodies] are those at which
  /// the points were found, `previous_poses` those of the contacts before. Points between the same two shapes
  /// follow each other in `points`.
  void Match(const CollisionBodyShapes& shapes, const std::vector<ContactPoint>& points,
             const std::vector<RigidTransform>& poses, const std::vector<ContactRecord>& previous,
             const std::vector<RigidTransform>& previous_poses, std::vector<int>& match);

 private:
  // Arguments of Match.
  struct Input {
    const CollisionBodyShapes& shapes;
    const std::vector<ContactPoint>& points;
    const std::vector<RigidTransform>& poses;
    const std::vector<ContactRecord>& previous;
    const std::vector<RigidTransform>& previous_poses;

    const ContactPoint& Previous(int k) const { return previous[static_cast<std::size_t>(k)].point; }
  };
  // Points from `begin` to before `end`, all between the same two shapes.
  struct Patch {
    std::size_t begin = 0, end = 0;
  };
  // Of previous contacts, by what touches what.
  struct Range {
    const int *first = nullptr, *last = nullptr;
  };
  // Where patches are matched, several side by side.
  struct Scratch {
    std::vector<std::tuple<double, int, int>> candidates;  // m², contact, previous contact
    std::vector<std::array<Vector3, 4>>
        places;  // of points on body a and b: in their axes, and in the world's
    Scratch();
  };
  static constexpr std::size_t kMostBenches = 64;

  void SortPrevious(const Input& in);
  void FindPatches(const std::vector<ContactPoint>& points);
  void MatchPatch(const Input& in, const Patch& patch, Scratch& scratch, std::vector<int>& match);
  static void AddCandidates(const Input& in, const Patch& patch, const Range& previous, Scratch& scratch);

  std::vector<char> used_;  // of previous
  std::vector<int> order_;  // of previous, by what touches what
  std::vector<Patch> patches_;
  std::vector<Scratch> scratches_;
};

}  // namespace fork1s
