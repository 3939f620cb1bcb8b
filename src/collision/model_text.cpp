#include "model_text.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "pair_routines.hpp"

namespace fork1s::internal {
namespace {

std::string Numbers(std::initializer_list<double> values) {
  std::string text;
  for (double value : values) text += Text(text.empty() ? "" : " ", value);
  return text;
}

std::string PoseText(const RigidTransform& X) {
  const Quaternion q = X.quaternion();
  const Vector3& p = X.translation();
  return Text(" pos=\"", Numbers({p.x(), p.y(), p.z()}), "\" quat=\"", Numbers({q.w(), q.x(), q.y(), q.z()}),
              "\"");
}

template <class T>
int IndexIn(std::vector<std::shared_ptr<const T>>& list, const std::shared_ptr<const T>& item) {
  const auto found = std::find(list.begin(), list.end(), item);
  if (found != list.end()) return static_cast<int>(found - list.begin());
  list.push_back(item);
  return static_cast<int>(list.size()) - 1;
}

bool Positive(std::initializer_list<double> sizes) {
  return std::all_of(sizes.begin(), sizes.end(), [](double s) { return std::isfinite(s) && s > 0; });
}

/// True where the points lie in a plane, to single precision: they have no hull, and qhull would complain at
/// length on standard error.
bool IsFlat(const std::vector<Eigen::Vector3f>& points) {
  const Vector3 origin = points.front().cast<double>();
  Vector3 along = Vector3::Zero(), across = Vector3::Zero();
  double off = 0;
  for (const auto& p : points) {
    const Vector3 d = p.cast<double>() - origin;
    if (d.squaredNorm() > along.squaredNorm()) along = d;
  }
  const double size = along.norm();
  if (size > 0) along /= size;
  for (const auto& p : points) {
    const Vector3 c = along.cross(p.cast<double>() - origin);
    if (c.squaredNorm() > across.squaredNorm()) across = c;
  }
  const double width = across.norm();
  if (width > 0) across /= width;
  for (const auto& p : points) off = std::max(off, std::abs(across.dot(p.cast<double>() - origin)));
  return !(std::min(width, off) > 1e-6 * size);
}

/// type and size attributes of a shape; the message says what is wrong with it.
struct ShapeWriter {
  ModelText& model;
  CollisionGeom& geom;
  bool moves;
  std::string problem;

  std::string Sized(const char* type, std::initializer_list<double> sizes) {
    if (!Positive(sizes)) problem = Text("a ", type, " needs sizes above zero");
    return Text(" type=\"", type, "\" size=\"", Numbers(sizes), "\"");
  }
  std::string operator()(const Plane&) {
    if (moves) problem = "a plane cannot be part of a body that moves; use a box";
    return " type=\"plane\" size=\"0 0 1\"";  // contact treats every plane as infinite
  }
  std::string operator()(const Sphere& s) { return Sized("sphere", {s.radius}); }
  std::string operator()(const Capsule& s) {
    // A capsule without a middle part is a sphere, which MuJoCo wants to be told.
    if (s.half_length == 0) return Sized("sphere", {s.radius});
    return Sized("capsule", {s.radius, s.half_length});
  }
  std::string operator()(const Cylinder& s) { return Sized("cylinder", {s.radius, s.half_length}); }
  std::string operator()(const Ellipsoid& s) {
    return Sized("ellipsoid", {s.radii.x(), s.radii.y(), s.radii.z()});
  }
  std::string operator()(const Box& s) { return Sized("box", {s.half.x(), s.half.y(), s.half.z()}); }
  std::string operator()(const MeshShape& s) {
    if (!s.mesh) {
      problem = "the mesh is missing";
      return "";
    }
    const auto& vertices = s.mesh->vertices;
    const int count = static_cast<int>(vertices.size());
    if (count < 4)
      problem = "a mesh needs at least four vertices";
    else if (IsFlat(vertices))
      problem = "the mesh is flat; contact needs a solid, such as a thin box";
    for (const auto& v : vertices) {
      if (!v.allFinite()) problem = "the mesh has a vertex that is not finite";
    }
    for (const auto& t : s.mesh->triangles) {
      if (t.minCoeff() < 0 || t.maxCoeff() >= count)
        problem = "a triangle refers to a vertex that is missing";
    }
    geom.mesh = IndexIn(model.meshes, s.mesh);
    return Text(" type=\"mesh\" mesh=\"m", geom.mesh, "\"");
  }
  std::string operator()(const HeightField& s) {
    if (moves) problem = "a height field cannot be part of a body that moves; use a mesh";
    if (!s.grid) {
      problem = "the height field has no grid";
      return "";
    }
    const HeightGrid& grid = *s.grid;
    if (grid.rows < 2 || grid.columns < 2 ||
        grid.values.size() != static_cast<std::size_t>(grid.rows) * static_cast<std::size_t>(grid.columns)) {
      problem = "a height field needs at least 2 x 2 values and as many as rows times columns";
    } else if (!Positive({grid.half_x, grid.half_y}) || !std::isfinite(grid.max_height) ||
               grid.max_height < 0 || !std::isfinite(grid.base_depth) || grid.base_depth < 0) {
      problem = "a height field needs half sizes above zero and no negative heights";
    }
    for (float value : grid.values) {
      if (!std::isfinite(value) || value < 0 || value > 1) problem = "heights must be in [0, 1]";
    }
    geom.grid = IndexIn(model.grids, s.grid);
    return Text(" type=\"hfield\" hfield=\"h", geom.grid, "\"");
  }
};

std::string GridText(const HeightGrid& grid, int index) {
  // MuJoCo wants positive sizes: flat ground is a field whose values are written as zero, and some depth of
  // solid ground below z = 0 keeps the cells from being empty.
  const double height = grid.max_height > 0 ? grid.max_height : 1;
  const double depth = grid.base_depth > 0 ? grid.base_depth : 0.1 * std::max(grid.half_x, grid.half_y);
  return Text("<hfield name=\"h", index, "\" nrow=\"", grid.rows, "\" ncol=\"", grid.columns, "\" size=\"",
              Numbers({grid.half_x, grid.half_y, height, depth}), "\"/>\n");
}

// Few geometries: every pair that may touch, named. The detector then goes through them one by one, which
// costs less than its broad phase up to about 32 pairs.
std::string PairText(const ModelText& model, const std::vector<CollisionBodyDef>& bodies,
                     const std::vector<std::pair<int, int>>& excluded, const CollisionOptions& options) {
  constexpr int kMost = 32;
  std::string text;
  int count = 0;
  for (std::size_t i = 0; i < model.geoms.size(); ++i)
    for (std::size_t j = i + 1; j < model.geoms.size(); ++j) {
      const CollisionGeom &a = model.geoms[i], &b = model.geoms[j];
      const CollisionBodyDef &body_a = bodies[static_cast<std::size_t>(a.body)],
                             &body_b = bodies[static_cast<std::size_t>(b.body)];
      if (a.body == b.body || !(body_a.moves || body_b.moves)) continue;
      const GeometryDef &def_a = body_a.geometries[static_cast<std::size_t>(a.geometry)],
                        &def_b = body_b.geometries[static_cast<std::size_t>(b.geometry)];
      if (ExplicitPair(a.pairs, b.pairs) < 0) {
        if (!(def_a.contype & def_b.conaffinity) && !(def_b.contype & def_a.conaffinity)) continue;
        const auto same = [&](const std::pair<int, int>& pair) {
          return std::minmax(pair.first, pair.second) == std::minmax(a.body, b.body);
        };
        if (std::any_of(excluded.begin(), excluded.end(), same)) continue;
      }
      if (++count > kMost) return "";
      text += Text("<pair geom1=\"g", i, "\" geom2=\"g", j, "\" margin=\"", options.margin, "\"/>\n");
    }
  return text;
}

}  // namespace

int ExplicitPair(const std::vector<int>& pairs_a, const std::vector<int>& pairs_b) {
  for (int pair : pairs_a)
    if (std::find(pairs_b.begin(), pairs_b.end(), pair) != pairs_b.end()) return pair;
  return -1;
}

std::string Place(const CollisionBodyDef& body, int geometry) {
  const std::string& name = body.geometries[static_cast<std::size_t>(geometry)].name;
  return Text("body ", body.name, ", geometry ", name.empty() ? Text(geometry) : name);
}

Expected<ModelText> WriteModelText(const std::vector<CollisionBodyDef>& bodies,
                                   const std::vector<std::pair<int, int>>& excluded,
                                   const CollisionOptions& options) {
  ModelText model;
  std::vector<std::string> geom_text;  // without what filters pairs
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const CollisionBodyDef& body = bodies[b];
    if (!body.X_WB.IsFinite()) return Fail(ErrorCode::kModel, "body " + body.name, "its pose is not finite");
    for (std::size_t g = 0; g < body.geometries.size(); ++g) {
      const GeometryDef& def = body.geometries[g];
      if (!def.Collides()) continue;
      CollisionGeom geom;
      geom.body = static_cast<int>(b);
      geom.geometry = static_cast<int>(g);
      geom.X_BG = body.moves ? def.X_BG : body.X_WB * def.X_BG;
      geom.friction = def.friction;
      geom.priority = def.priority;
      geom.frictionless = def.frictionless;
      geom.torsion = def.torsion;
      geom.rolling = def.rolling;
      geom.restitution = def.restitution;
      geom.moments = def.frictionless ? 0 : def.moments;
      geom.margin = def.margin;
      geom.gap = def.gap;
      geom.adhesion = def.adhesion;
      geom.surface_velocity = def.surface_velocity;
      geom.pairs = def.pairs;
      ShapeWriter writer{model, geom, body.moves, ""};
      const std::string shape = std::visit(writer, def.shape);
      if (!def.X_BG.IsFinite()) writer.problem = "its pose is not finite";
      if (!(def.friction >= 0 && std::isfinite(def.friction)))
        writer.problem = "friction must not be negative";
      if (!(def.torsion >= 0 && def.rolling >= 0 && std::isfinite(def.torsion + def.rolling)))
        writer.problem = "torsional and rolling friction must not be negative";
      if (!std::isfinite(def.margin)) writer.problem = "margin must be finite";
      if (!(def.gap >= 0 && std::isfinite(def.gap))) writer.problem = "gap must be finite and not negative";
      if (!(def.adhesion >= 0 && std::isfinite(def.adhesion)))
        writer.problem = "adhesion must be finite and not negative";
      if (!def.surface_velocity.allFinite()) writer.problem = "surface velocity must be finite";
      if (!(def.restitution >= 0 && def.restitution <= 1)) writer.problem = "restitution must be 0 to 1";
      if (!writer.problem.empty()) {
        return Fail(ErrorCode::kModel, Place(body, static_cast<int>(g)), writer.problem);
      }
      geom_text.push_back(Text("<geom name=\"g", model.geoms.size(), "\"", shape, PoseText(geom.X_BG)));
      model.geoms.push_back(geom);
    }
  }
  const std::string pairs = PairText(model, bodies, excluded, options);
  std::string world, moving;
  std::vector<bool> written(bodies.size(), false);
  std::size_t next = 0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const CollisionBodyDef& body = bodies[b];
    std::string text;
    for (; next < geom_text.size() && model.geoms[next].body == static_cast<int>(b); ++next) {
      // Pairs that are named are all there are.
      const GeometryDef& def = body.geometries[static_cast<std::size_t>(model.geoms[next].geometry)];
      text += Text(geom_text[next], " contype=\"", pairs.empty() ? def.contype : 0, "\" conaffinity=\"",
                   pairs.empty() ? def.conaffinity : 0, "\" margin=\"", 0.5 * options.margin, "\"/>\n");
    }
    if (text.empty()) continue;
    if (body.moves) {
      written[b] = true;
      moving += Text("<body name=\"b", b, "\"><freejoint/>",
                     "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>\n", text, "</body>\n");
    } else {
      world += text;
    }
  }
  // Still geometry all sits in the world body: planes on several still bodies overflow the broad phase. Pairs
  // excluded from still bodies are therefore dropped after detection.
  std::string contact;
  const int count = static_cast<int>(bodies.size());
  for (const auto& [a, b] : excluded) {
    if (a < 0 || b < 0 || a >= count || b >= count) {
      return Fail(ErrorCode::kUsage, "excluded pair", "there is no body of that index");
    }
    if (a == b || !written[static_cast<std::size_t>(a)] || !written[static_cast<std::size_t>(b)]) continue;
    contact += Text("<exclude body1=\"b", a, "\" body2=\"b", b, "\"/>\n");
  }
  std::string asset;
  for (std::size_t k = 0; k < model.meshes.size(); ++k) {
    asset += Text("<mesh name=\"m", k, "\" file=\"m", k, ".msh\"/>\n");
  }
  for (std::size_t k = 0; k < model.grids.size(); ++k) {
    asset += GridText(*model.grids[k], static_cast<int>(k));
  }
  // Bytes for what MuJoCo's compiler computes of the bodies; pairs are searched in scratch of ours
  // (pair_search.cpp).
  const std::size_t n = bodies.size() + 2;
  const std::size_t bytes = (1u << 20) + 16 * n * n + 64000 * model.geoms.size();
  model.xml = Text("<mujoco model=\"", kCollisionModelName,
                   "\">\n<compiler angle=\"radian\" inertiafromgeom=\"false\"/>\n<size memory=\"", bytes,
                   "\"/>\n<asset>\n", asset, "</asset>\n<worldbody>\n", world, moving,
                   "</worldbody>\n<contact>\n", contact, pairs, "</contact>\n</mujoco>\n");
  return model;
}

std::string WriteMsh(const TriangleMesh& mesh, bool with_triangles) {
  const int counts[4] = {static_cast<int>(mesh.vertices.size()), 0, 0,
                         with_triangles ? static_cast<int>(mesh.triangles.size()) : 0};
  std::string data(sizeof counts, '\0');
  std::memcpy(data.data(), counts, sizeof counts);
  for (const Eigen::Vector3f& v : mesh.vertices) {
    const float xyz[3] = {v.x(), v.y(), v.z()};
    data.append(reinterpret_cast<const char*>(xyz), sizeof xyz);
  }
  for (int k = 0; k < counts[3]; ++k) {
    const Eigen::Vector3i& t = mesh.triangles[static_cast<std::size_t>(k)];
    const int corners[3] = {t.x(), t.y(), t.z()};
    data.append(reinterpret_cast<const char*>(corners), sizeof corners);
  }
  return data;
}

}  // namespace fork1s::internal
