#include <fork1s/collision/collision_world.hpp>

#include <algorithm>
#include <cmath>

#include "collision_model.hpp"
#include "contact_law.hpp"
#include "pair_routines.hpp"
#include "pair_search.hpp"

// MuJoCo as a detector only: its model has one free body per moving collision body, of which we write the
// poses. Where few pairs may touch, all have a name (model_text.cpp): mj_collision goes through them, reads
// the poses of bodies and geoms and leaves d->contact. Where there are more, PairSearch shares them out among
// threads, and asks MuJoCo pair by pair.
namespace fork1s {
namespace {

void WritePose(mjtNum* xpos, mjtNum* xmat, int id, const RigidTransform& X) {
  Eigen::Map<Vector3>(xpos + 3 * id) = X.translation();
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(xmat + 9 * id) = X.rotation();
}
void WriteGeomPose(mjData* data, int id, const RigidTransform& X_WM) {
  WritePose(data->geom_xpos, data->geom_xmat, id, X_WM);
}
// Centres of mass are at the bodies' origins (model_text.cpp).
void WriteBodyPose(mjData* data, int id, const RigidTransform& X_WB) {
  WritePose(data->xpos, data->xmat, id, X_WB);
  WritePose(data->xipos, data->ximat, id, X_WB);
  const Quaternion q = X_WB.quaternion();
  Eigen::Map<Eigen::Vector4d>(data->xquat + 4 * id) << q.w(), q.x(), q.y(), q.z();
}

}  // namespace

struct CollisionWorld::Detail {
  struct PosedGeom {
    int id = -1;          // MuJoCo's geom
    RigidTransform X_BM;  // frame of MuJoCo's geom in the body; a mesh's sits at its centre of volume
  };

  internal::ModelPointer model;
  internal::DataPointer data;
  std::vector<internal::CollisionGeom> geoms;  // by MuJoCo's geom id
  std::vector<PosedGeom> posed;                // geoms of moving bodies, body by body
  std::vector<int> first_posed;                // body -> first in `posed`; one more at the end
  std::vector<bool> moves;
  std::vector<int> body_id;                   // MuJoCo's body, -1 without geometry
  std::vector<std::pair<int, int>> excluded;  // sorted, smaller index first
  std::unique_ptr<internal::PairSearch> search;  // of many pairs
  double margin = 0;
  bool may_touch = false;  // anything may

  // Whether `act` is true of the bodies of any two geoms that may touch; asks no more once it was.
  template <class Act>
  bool AnyPair(const Act& act) const {
    const mjModel* m = model.get();
    const auto bodies = [&](int geom_a, int geom_b) {
      const int a = geoms[static_cast<std::size_t>(geom_a)].body,
                b = geoms[static_cast<std::size_t>(geom_b)].body;
      const bool one_moves = moves[static_cast<std::size_t>(a)] || moves[static_cast<std::size_t>(b)];
      return a != b && one_moves && !IsExcluded(a, b) && act(a, b);
    };
    // Either every pair has a name or none has: model_text.cpp.
    for (int k = 0; k < m->npair; ++k)
      if (bodies(m->pair_geom1[k], m->pair_geom2[k])) return true;
    for (int g = 0; g < m->ngeom; ++g)
      for (int h = g + 1; h < m->ngeom; ++h)
        if (((m->geom_contype[g] & m->geom_conaffinity[h]) ||
             (m->geom_contype[h] & m->geom_conaffinity[g])) &&
            bodies(g, h))
          return true;
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
                                                const CollisionOptions& options) {
  if (!(options.margin >= 0 && std::isfinite(options.margin))) {
    return Fail(ErrorCode::kUsage, "collision margin", "the margin must not be negative");
  }
  Expected<internal::ModelText> text = internal::WriteModelText(bodies, excluded, options);
  if (!text) return tl::make_unexpected(text.error());
  Expected<internal::ModelPointer> compiled = internal::CompileModel(*text, bodies);
  if (!compiled) return tl::make_unexpected(compiled.error());

  CollisionWorld world;
  world.detail_ = std::make_unique<Detail>();
  Detail& detail = *world.detail_;
  detail.model = std::move(*compiled);
  mjModel* m = detail.model.get();
  internal::SetPairOptions(*m, options.multi_point);
  detail.data.reset(mj_makeData(m));
  if (!detail.data) return Fail(ErrorCode::kModel, "collision model", "not enough memory");
  mj_kinematics(m, detail.data.get());  // of what never moves
  // A full contact buffer is reported by Detect; with a count that is not zero MuJoCo does not print it too.
  detail.data->warning[mjWARN_CONTACTFULL].number = 1;

  for (const auto& [a, b] : excluded) detail.excluded.emplace_back(std::minmax(a, b));
  std::sort(detail.excluded.begin(), detail.excluded.end());

  detail.geoms.resize(static_cast<std::size_t>(m->ngeom));
  std::vector<std::vector<Detail::PosedGeom>> by_body(bodies.size());
  for (std::size_t k = 0; k < text->geoms.size(); ++k) {
    const internal::CollisionGeom& geom = text->geoms[k];
    const int id = mj_name2id(m, mjOBJ_GEOM, internal::Text("g", k).c_str());
    if (id < 0) return Fail(ErrorCode::kModel, "collision model", "MuJoCo lost a geometry");
    detail.geoms[static_cast<std::size_t>(id)] = geom;
    RigidTransform X_BM = geom.X_BG;
    if (geom.mesh >= 0) {
      const double* q = m->geom_quat + 4 * id;
      X_BM = RigidTransform(Quaternion(q[0], q[1], q[2], q[3]), Eigen::Map<Vector3>(m->geom_pos + 3 * id));
    }
    if (bodies[static_cast<std::size_t>(geom.body)].moves) {
      by_body[static_cast<std::size_t>(geom.body)].push_back({id, X_BM});
    } else {
      WriteGeomPose(detail.data.get(), id, X_BM);
    }
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    detail.moves.push_back(bodies[b].moves);
    detail.body_id.push_back(mj_name2id(m, mjOBJ_BODY, internal::Text("b", b).c_str()));
    detail.first_posed.push_back(static_cast<int>(detail.posed.size()));
    detail.posed.insert(detail.posed.end(), by_body[b].begin(), by_body[b].end());
  }
  detail.first_posed.push_back(static_cast<int>(detail.posed.size()));
  detail.may_touch = detail.AnyPair([](int, int) { return true; });
  if (m->npair == 0)
    detail.search =
        std::make_unique<internal::PairSearch>(*m, *detail.data, detail.geoms, detail.moves, detail.excluded);
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
  if (detail.body_id[b] >= 0 && !detail.search) WriteBodyPose(detail.data.get(), detail.body_id[b], X_WB);
  for (int k = detail.first_posed[b]; k < detail.first_posed[b + 1]; ++k) {
    const Detail::PosedGeom& geom = detail.posed[static_cast<std::size_t>(k)];
    WriteGeomPose(detail.data.get(), geom.id, X_WB * geom.X_BM);
    if (detail.search) detail.search->Moved(geom.id);
  }
}

void CollisionWorld::SetMargin(double margin) {
  FORK1S_REQUIRE(margin >= 0 && std::isfinite(margin), margin);
  detail_->margin = margin;
  if (detail_->search) return;
  mjModel* model = detail_->model.get();
  // The margins of two geoms are added.
  std::fill_n(model->geom_margin, model->ngeom, 0.5 * margin);
  std::fill_n(model->body_margin, model->nbody, 0.5 * margin);
  std::fill_n(model->pair_margin, model->npair, margin);
}

bool CollisionWorld::Detect(std::vector<ContactPoint>& contacts) {
  Detail& detail = *detail_;
  contacts.clear();
  if (!detail.may_touch) return true;
  if (detail.search) return detail.search->Detect(detail.margin, contacts);
  mjData* d = detail.data.get();
  const int warnings = d->warning[mjWARN_CONTACTFULL].number;
  d->pstack = 0;  // an error that was thrown through MuJoCo leaves its scratch in use
  try {
    mj_collision(detail.model.get(), d);
  } catch (...) {
    return false;
  }
  for (int k = 0; k < d->ncon; ++k) {
    const mjContact& in = d->contact[k];
    if (in.exclude != 0) continue;
    const internal::CollisionGeom& a = detail.geoms[static_cast<std::size_t>(in.geom1)];
    const internal::CollisionGeom& b = detail.geoms[static_cast<std::size_t>(in.geom2)];
    if (!detail.excluded.empty() && detail.IsExcluded(a.body, b.body)) continue;
    if (!(in.dist < in.includemargin)) continue;
    ContactPoint& out = contacts.emplace_back();
    out.body_a = a.body;
    out.body_b = b.body;
    out.geometry_a = a.geometry;
    out.geometry_b = b.geometry;
    out.point = Eigen::Map<const Vector3>(in.pos);
    out.frame = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(in.frame);
    out.gap = in.dist;
    internal::SetLaw(a, b, out);
  }
  return d->warning[mjWARN_CONTACTFULL].number == warnings;
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
