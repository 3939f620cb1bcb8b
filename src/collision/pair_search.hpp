// Contacts of shapes, side by side where they are many: which of them are near each other, then each near pair by
// itself. Few pairs have names in the model (model_text.cpp) and are gone through one after the other.
//
// MuJoCo's mj_collision does the same on one thread, goes through the list of excluded pairs once a pair, and sorts
// bodies along an axis even where all pairs are named, which costs more than to look at each.
// Its routines for two shapes are taken as they stand in its table (pair_routines.hpp). They ask the model
// and the data they are given for poses and for scratch; so every thread gets copies of both, which share all
// arrays but the scratch.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <memory>
#include <vector>

#include "collision_model.hpp"
#include "sweep.hpp"

namespace fork1s::internal {

class PairSearch {
 public:
  /// All of these must outlive the search. `geoms`: by MuJoCo's geom id; `moves` by collision body;
  /// `excluded`: pairs of collision bodies, sorted, the smaller first. Poses of what never moves stand in
  /// `data`.
  PairSearch(const mjModel& model, const mjData& data, const std::vector<CollisionGeom>& geoms,
             const std::vector<bool>& moves, const std::vector<std::pair<int, int>>& excluded);
  ~PairSearch();
  PairSearch(const PairSearch&) = delete;
  PairSearch& operator=(const PairSearch&) = delete;

  /// The pose of a geom in the data has changed. Different geoms may be set at a time.
  void Moved(int geom);
  /// Adds to `contacts`, which are none yet, as CollisionWorld::Detect. Pairs come in the order of their
  /// bodies, then of their geoms, whatever the number of threads. false: there were more contacts than a
  /// detector is asked for, or MuJoCo failed.
  bool Detect(double margin, std::vector<ContactPoint>& contacts);

 private:
  // Two geoms in the order of MuJoCo's table, and their bodies, the smaller first.
  struct Pair {
    int body_a, body_b, geom_a, geom_b;
    bool operator<(const Pair& o) const;
  };
  struct Bench;

  bool IsNear(int a, int b, double margin) const;
  bool MayTouch(int a, int b, double margin) const;
  bool DetectNamed(double margin, std::vector<ContactPoint>& contacts);
  void AddPair(int a, int b, double margin, std::vector<Pair>& pairs) const;
  void FindPairs(double margin);
  void SortIn();
  void Collide(const Pair& pair, double margin, Bench& bench, std::vector<ContactPoint>& contacts) const;
  void NeedBenches(int count);
  Bench& BenchAt(int k);

  const mjModel& model_;
  const mjData& data_;
  const std::vector<CollisionGeom>& geoms_;
  const std::vector<std::pair<int, int>>& excluded_;
  std::vector<Pair> named_;          // all there are, in the model's order; none: any may touch
  std::vector<int> item_of_;         // geom -> place in movers_, -1
  std::vector<int> movers_, still_;  // geoms with an extent
  std::vector<int> planes_;          // geoms
  std::vector<AxisBox> boxes_;       // of movers_
  Sweep sweep_;
  std::vector<std::unique_ptr<Bench>> benches_;
  std::vector<Pair> pairs_;      // by body_a, sorted in each
  std::vector<int> first_pair_;  // by MuJoCo's body; one more at the end
  std::size_t most_contacts_;
};

}  // namespace fork1s::internal
