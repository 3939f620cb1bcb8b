#include <fork1s/collision/collision_world.hpp>

#include <algorithm>
#include <cmath>

#include "collision_model.hpp"
#include "contact_law.hpp"
#include "pair_routines.hpp"
#include "pair_search.hpp"

// MuJoCo as a detector only: its model has one free body per moving collision body, and of their geoms we write the
// poses. PairSearch finds the pairs that are near and asks MuJoCo pair by pair.
namespace fork1s {
struct CollisionWorld::Detail {
  struct PosedGeom {
    int id = -1;          // MuJoCo's geom
    RigidTransform X_BM;  // frame of MuJoCo's geom in the body; a mesh's sits at its centre of volume
  };

  std::shared_ptr<const mjModel> model;
  internal::GeomPoses poses;
  std::vector<internal::CollisionGeom> geoms;  // by MuJoCo's geom id
  std::vector<PosedGeom> posed;                // geoms of moving bodies, body by body
  std::vector<int> first_posed;                // body -> first in `posed`; one more at the end
  std::vector<bool> moves;
  std::vector<std::pair<int, int>> excluded;  // sorted, smaller index first
  std::vector<ContactPairDef> contact_pairs;
  std::unique_ptr<internal::PairSearch> search;
  CollisionMargins for_all;  // of SetMargin
  bool may_touch = false;    // anything may

  // Whether `act` is true of the bodies of any two geoms that may touch; asks no more once it was.
  template <class Act>
  bool AnyPair(const Act& act) const {
    const mjModel* m = model.get();
    const auto bodies = [&](int geom_a, int geom_b, bool named) {
      const int a = geoms[static_cast<std::size_t>(geom_a)].body,
                b = geoms[static_cast<std::size_t>(geom_b)].body;
      const bool one_moves = moves[static_cast<std::size_t>(a)] || moves[static_cast<std::size_t>(b)];
      return a != b && one_moves && (named || !IsExcluded(a, b)) && act(a, b);
    };
    // Either every pair has a name or none has: model_text.cpp.
    for (int k = 0; k < m->npair; ++k)
      if (bodies(m->pair_geom1[k], m->pair_geom2[k], true)) return true;
    for (int g = 0; g < m->ngeom; ++g)
      for (int h = g + 1; h < m->ngeom; ++h) {
        const bool named = internal::ExplicitPair(geoms[static_cast<std::size_t>(g)].pairs,
                                                  geoms[static_cast<std::size_t>(h)].pairs) >= 0;
        if ((named || (m->geom_contype[g] & m->geom_conaffinity[h]) ||
             (m->geom_contype[h] & m->geom_conaffinity[g])) &&
            bodies(g, h, named))
          return true;
      }
    return false;
  }
  bool IsExcluded(int a, int b) const {
    return std::binary_search(excluded.begin(), excluded.end(), std::pair<int, int>(std::minmax(a, b)));
  }
};

CollisionWorld::CollisionWorld() = default;
CollisionWorld::~CollisionWorld() = default;
CollisionWorld::CollisionWorld(CollisionWorld&&) noexcept = default;
CollisionWorld& CollisionWorld::operator=(CollisionWorld&&) noexcept = default;

Expected<CollisionWorld> CollisionWorld::Create(const std::vector<CollisionBodyDef>& bodies,
                                                const std::vector<std::pair<int, int>>& excluded,
                                                const CollisionOptions& options,
                                                const std::vector<ContactPairDef>& contact_pairs) {
  if (!(options.margin >= 0 && std::isfinite(options.margin))) {
    return Fail(ErrorCode::kUsage, "collision margin", "the margin must not be negative");
  }
  for (const ContactPairDef& pair : contact_pairs)
    if (const char* problem = internal::ProblemOf(pair))
      return Fail(ErrorCode::kModel, "contact pair " + pair.name, problem);
  for (const CollisionBodyDef& body : bodies)
    for (std::size_t g = 0; g < body.geometries.size(); ++g)
      for (int pair : body.geometries[g].pairs)
        if (pair < 0 || pair >= static_cast<int>(contact_pairs.size()))
          return Fail(ErrorCode::kModel, internal::Place(body, static_cast<int>(g)),
                      "it names a contact pair that the scene does not have");
  Expected<internal::ModelText> text = internal::WriteModelText(bodies, excluded, options);
  if (!text) return tl::make_unexpected(text.error());
  Expected<std::shared_ptr<const mjModel>> compiled =
      internal::CompileShared(*text, bodies, options.multi_point);
  if (!compiled) return tl::make_unexpected(compiled.error());

  CollisionWorld world;
  world.detail_ = std::make_unique<Detail>();
  Detail& detail = *world.detail_;
  detail.model = std::move(*compiled);
  const mjModel* m = detail.model.get();
  detail.poses = internal::GeomPoses(m->ngeom);

  for (const auto& [a, b] : excluded) detail.excluded.emplace_back(std::minmax(a, b));
  std::sort(detail.excluded.begin(), detail.excluded.end());
  detail.contact_pairs = contact_pairs;

  detail.geoms.resize(static_cast<std::size_t>(m->ngeom));
  std::vector<std::vector<Detail::PosedGeom>> by_body(bodies.size());
  for (std::size_t k = 0; k < text->geoms.size(); ++k) {
    internal::CollisionGeom& geom = text->geoms[k];
    geom.reach = std::max(0.0, geom.margin);
    for (int pair : geom.pairs)
      geom.reach = std::max(geom.reach, contact_pairs[static_cast<std::size_t>(pair)].margin);
    const int id = mj_name2id(m, mjOBJ_GEOM, internal::Text("g", k).c_str());
    if (id < 0) return Fail(ErrorCode::kModel, "collision model", "MuJoCo lost a geometry");
    RigidTransform X_BM = geom.X_BG;
    if (geom.mesh >= 0) {
      const double* q = m->geom_quat + 4 * id;
      X_BM = RigidTransform(Quaternion(q[0], q[1], q[2], q[3]), Eigen::Map<Vector3>(m->geom_pos + 3 * id));
    }
    geom.surface_velocity = AdjointApply(X_BM.inverse() * geom.X_BG, geom.surface_velocity);
    detail.geoms[static_cast<std::size_t>(id)] = geom;
    if (bodies[static_cast<std::size_t>(geom.body)].moves) {
      by_body[static_cast<std::size_t>(geom.body)].push_back({id, X_BM});
    } else {
      detail.poses.Set(id, X_BM);
    }
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    detail.moves.push_back(bodies[b].moves);
    detail.first_posed.push_back(static_cast<int>(detail.posed.size()));
    detail.posed.insert(detail.posed.end(), by_body[b].begin(), by_body[b].end());
  }
  detail.first_posed.push_back(static_cast<int>(detail.posed.size()));
  detail.may_touch = detail.AnyPair([](int, int) { return true; });
  detail.search = std::make_unique<internal::PairSearch>(detail.model, detail.poses, detail.geoms,
                                                         detail.moves, detail.excluded, detail.contact_pairs);
  world.SetMargin(options.margin);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].moves) world.SetPose(static_cast<int>(b), bodies[b].X_WB);
  }
  return world;
}

void CollisionWorld::SetPose(int body, const RigidTransform& X_WB) {
  Detail& detail = *detail_;
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(detail.moves.size()), body);
  const std::size_t b = static_cast<std::size_t>(body);
  FORK1S_REQUIRE(detail.moves[b], body);
  for (int k = detail.first_posed[b]; k < detail.first_posed[b + 1]; ++k) {
    const Detail::PosedGeom& geom = detail.posed[static_cast<std::size_t>(k)];
    detail.poses.Set(geom.id, X_WB * geom.X_BM);
    detail.search->Moved(geom.id);
  }
}

void CollisionWorld::SetMargin(double margin) {
  FORK1S_REQUIRE(margin >= 0 && std::isfinite(margin), margin);
  detail_->for_all.most = margin;
}

bool CollisionWorld::Detect(std::vector<ContactPoint>& contacts) {
  return Detect(detail_->for_all, contacts);
}

bool CollisionWorld::Detect(const CollisionMargins& margins, std::vector<ContactPoint>& contacts) {
  Detail& detail = *detail_;
  FORK1S_REQUIRE(margins.most >= 0 && std::isfinite(margins.most), margins.most);
  const std::size_t count = margins.reach.empty() ? 0 : detail.moves.size();
  for (const std::size_t size : {margins.reach.size(), margins.reach_within.size(), margins.group.size()})
    FORK1S_REQUIRE(size == count, size, "entries for", count, "bodies");
  contacts.clear();
  if (!detail.may_touch) return true;
  return detail.search->Detect(margins, contacts);
}

std::vector<std::pair<int, int>> CollisionWorld::PairsThatMayTouch() const {
  const Detail& detail = *detail_;
  std::vector<std::pair<int, int>> pairs;
  detail.AnyPair([&](int a, int b) {
    pairs.emplace_back(std::minmax(a, b));
    return false;
  });
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace fork1s
