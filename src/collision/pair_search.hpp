// Contacts of shapes, side by side where they are many: which of them are near each other, then each near
// pair by itself. Few pairs have names in the model (model_text.cpp) and are gone through one after the
// other.
//
// MuJoCo's mj_collision does the same on one thread, goes through the list of excluded pairs once a pair, and
// sorts bodies along an axis even where all pairs are named, which costs more than to look at each. Its
// routines for two shapes are taken as they stand in its table (pair_routines.hpp). They read poses and take
// scratch from the mjData that they are given, and switch options of the mjModel. So each thread that
// searches borrows a PairScratch: an mjData that has nothing but the poses at hand and memory, and a copy of
// the model's struct.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <memory>
#include <vector>

#include "collision_model.hpp"
#include "parallel/scratch_pool.hpp"
#include "sweep.hpp"

namespace fork1s::internal {

/// World poses of a model's geoms, as mjData lays them out.
struct GeomPoses {
  std::vector<double> position;  // 3 a geom, m
  std::vector<double> rotation;  // 9 a geom, row-major

  GeomPoses() = default;
  explicit GeomPoses(mjtSize count)
      : position(3 * static_cast<std::size_t>(count)), rotation(9 * static_cast<std::size_t>(count)) {}
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  Eigen::Map<const Vector3> p(int geom) const {
    return Eigen::Map<const Vector3>(position.data() + 3 * geom);
  }
  Eigen::Map<const RowMajor> R(int geom) const {
    return Eigen::Map<const RowMajor>(rotation.data() + 9 * geom);
  }
  void Set(int geom, const RigidTransform& X_WM) {
    Eigen::Map<Vector3>(position.data() + 3 * geom) = X_WM.translation();
    Eigen::Map<RowMajor>(rotation.data() + 9 * geom) = X_WM.rotation();
  }
};

struct PairScratch;

class PairSearch {
 public:
  /// All of these must outlive the search. `geoms`: by MuJoCo's geom id; `moves` by collision body;
  /// `excluded`: pairs of collision bodies, sorted, the smaller first. `contact_pairs`: CollisionGeom::pairs
  /// refers to them. Poses of what never moves stand in
  /// `poses`.
  PairSearch(std::shared_ptr<const mjModel> model, const GeomPoses& poses,
             const std::vector<CollisionGeom>& geoms, const std::vector<bool>& moves,
             const std::vector<std::pair<int, int>>& excluded,
             const std::vector<ContactPairDef>& contact_pairs);
  ~PairSearch();
  PairSearch(const PairSearch&) = delete;
  PairSearch& operator=(const PairSearch&) = delete;

  /// The pose of a geom has changed. Different geoms may be set at a time.
  void Moved(int geom);
  /// Adds to `contacts`, which are none yet, as CollisionWorld::Detect. Pairs come in the order of their
  /// bodies, then of their geoms, whatever the number of threads. false: there were more contacts than a
  /// detector is asked for, or MuJoCo failed.
  bool Detect(const CollisionMargins& margins, std::vector<ContactPoint>& contacts);

 private:
  friend struct PairScratch;
  // Two geoms in the order of MuJoCo's table, and their bodies, the smaller first.
  struct Pair {
    int body_a, body_b, geom_a, geom_b;
    bool operator<(const Pair& o) const;
  };
  AxisBox BoxOf(int geom) const;
  const ContactPairDef* PairOf(int a, int b) const;
  double MarginOf(int a, int b, const ContactPairDef* pair) const;
  Vector3 SurfaceVelocity(int geom, const ContactPoint& at) const;
  bool IsNear(int a, int b, double distance) const;
  bool MayTouch(int a, int b, const CollisionMargins& margins) const;
  bool DetectNamed(const CollisionMargins& margins, std::vector<ContactPoint>& contacts);
  void AddPair(int a, int b, const CollisionMargins& margins, std::vector<Pair>& pairs) const;
  bool DetectNear(const CollisionMargins& margins, std::vector<ContactPoint>& contacts);
  void FindPairs(const CollisionMargins& margins);
  void SortIn();
  void Collide(const Pair& pair, const CollisionMargins& margins, PairScratch& scratch,
               std::vector<ContactPoint>& contacts) const;
  void Borrow(int count);

  const std::shared_ptr<const mjModel> shared_model_;
  const mjModel& model_;
  const GeomPoses& poses_;
  const std::vector<CollisionGeom>& geoms_;
  const std::vector<std::pair<int, int>>& excluded_;
  const std::vector<ContactPairDef>& contact_pairs_;
  std::vector<Pair> named_;          // all there are, in the model's order; none: any may touch
  std::vector<int> item_of_;         // geom -> place in movers_, -1
  std::vector<int> movers_, still_;  // geoms with an extent
  std::vector<int> planes_;          // geoms
  std::vector<AxisBox> boxes_;       // of movers_
  Sweep sweep_;
  std::vector<ScratchPool<PairScratch>::Lease> borrowed_;  // within Detect
  std::vector<Pair> pairs_;                                // by body_a, sorted in each
  std::vector<int> first_pair_;                            // by MuJoCo's body; one more at the end
  std::size_t most_contacts_;
};

}  // namespace fork1s::internal
