#include <fork1s/collision/ray_world.hpp>

#include <algorithm>
#include <cmath>

#include "collision_model.hpp"

// As collision_world.cpp: a model of MuJoCo's with a free body per moving body, of which mj_ray reads the
// poses of shapes.
namespace fork1s {
namespace {

void WriteShapePose(mjData* data, int id, const RigidTransform& X_WM) {
  Eigen::Map<Vector3>(data->geom_xpos + 3 * id) = X_WM.translation();
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(data->geom_xmat + 9 * id) = X_WM.rotation();
}

}  // namespace

struct RayWorld::Detail {
  struct Seen {
    int body = -1, geometry = -1;
    RigidTransform X_BM;  // frame of MuJoCo's geom in the body; still bodies: in the world
  };
  internal::ModelPointer model;
  internal::DataPointer data;
  std::vector<Seen> shapes;  // by MuJoCo's geom id
  std::vector<std::vector<int>> of_body;
  std::vector<bool> moves;
};

RayWorld::RayWorld() = default;
RayWorld::~RayWorld() = default;
RayWorld::RayWorld(RayWorld&&) noexcept = default;
RayWorld& RayWorld::operator=(RayWorld&&) noexcept = default;

Expected<RayWorld> RayWorld::Create(std::vector<CollisionBodyDef> bodies) {
  for (CollisionBodyDef& body : bodies) {
    auto& shapes = body.geometries;
    if (std::none_of(shapes.begin(), shapes.end(), [](const GeometryDef& g) { return g.Collides(); }))
      for (GeometryDef& g : shapes) g.contype = 1;
  }
  Expected<internal::ModelText> text = internal::WriteModelText(bodies, {}, {});
  if (!text) return tl::make_unexpected(text.error());
  Expected<internal::ModelPointer> compiled = internal::CompileModel(*text, bodies);
  if (!compiled) return tl::make_unexpected(compiled.error());
  RayWorld world;
  world.detail_ = std::make_unique<Detail>();
  Detail& detail = *world.detail_;
  detail.model = std::move(*compiled);
  mjModel* m = detail.model.get();
  detail.data.reset(mj_makeData(m));
  if (!detail.data) return Fail(ErrorCode::kModel, "rays", "not enough memory");
  mj_kinematics(m, detail.data.get());
  detail.shapes.resize(static_cast<std::size_t>(m->ngeom));
  detail.of_body.resize(bodies.size());
  for (const CollisionBodyDef& body : bodies) detail.moves.push_back(body.moves);
  for (std::size_t k = 0; k < text->geoms.size(); ++k) {
    const internal::CollisionGeom& geom = text->geoms[k];
    const int id = mj_name2id(m, mjOBJ_GEOM, internal::Text("g", k).c_str());
    if (id < 0) return Fail(ErrorCode::kModel, "rays", "MuJoCo lost a geometry");
    RigidTransform X_BM = geom.X_BG;
    if (geom.mesh >= 0) {  // a mesh's frame sits at its centre of volume
      const double* q = m->geom_quat + 4 * id;
      X_BM = RigidTransform(Quaternion(q[0], q[1], q[2], q[3]), Eigen::Map<Vector3>(m->geom_pos + 3 * id));
    }
    detail.shapes[static_cast<std::size_t>(id)] = {geom.body, geom.geometry, X_BM};
    detail.of_body[static_cast<std::size_t>(geom.body)].push_back(id);
    if (!bodies[static_cast<std::size_t>(geom.body)].moves) WriteShapePose(detail.data.get(), id, X_BM);
  }
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (bodies[b].moves) world.SetPose(static_cast<int>(b), bodies[b].X_WB);
  return world;
}

void RayWorld::SetPose(int body, const RigidTransform& X_WB) {
  Detail& detail = *detail_;
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(detail.moves.size()), body);
  const auto b = static_cast<std::size_t>(body);
  FORK1S_REQUIRE(detail.moves[b], body);
  for (const int id : detail.of_body[b])
    WriteShapePose(detail.data.get(), id, X_WB * detail.shapes[static_cast<std::size_t>(id)].X_BM);
}

std::optional<RayHit> RayWorld::Cast(const Vector3& origin, const Vector3& direction, double reach, int body,
                                     std::span<const int> unseen) {
  const double length = direction.norm();
  FORK1S_REQUIRE(origin.allFinite() && std::isfinite(length), "from", origin.transpose(), "along",
                 direction.transpose(), "; give finite numbers");
  FORK1S_REQUIRE(length > 0, "a ray of no direction; give a vector that is not 0");
  FORK1S_REQUIRE(reach >= 0, "a reach of", reach, "m; give 0 or more");
  const Vector3 along = direction / length;
  // All shapes are of group 0; those that the ray goes through are of group 1 meanwhile.
  constexpr mjtByte kSeen[mjNGROUP] = {1};
  FORK1S_REQUIRE(unseen.empty() || (body >= 0 && body < static_cast<int>(detail_->of_body.size())), body);
  const auto set_group = [&](int group) {
    if (unseen.empty()) return;
    for (const int shape : detail_->of_body[static_cast<std::size_t>(body)])
      if (std::find(unseen.begin(), unseen.end(),
                    detail_->shapes[static_cast<std::size_t>(shape)].geometry) != unseen.end())
        detail_->model->geom_group[shape] = group;
  };
  RayHit hit;
  int id = -1;
  set_group(1);
  hit.distance = mj_ray(detail_->model.get(), detail_->data.get(), origin.data(), along.data(), kSeen, 1, -1,
                        &id, hit.normal.data());
  set_group(0);
  if (id < 0 || hit.distance < 0 || hit.distance > reach) return std::nullopt;
  const Detail::Seen& shape = detail_->shapes[static_cast<std::size_t>(id)];
  hit.body = shape.body;
  hit.geometry = shape.geometry;
  hit.point = origin + hit.distance * along;
  if (hit.normal.dot(along) > 0) hit.normal = -hit.normal;
  return hit;
}

}  // namespace fork1s
