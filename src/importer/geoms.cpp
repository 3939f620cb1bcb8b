#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "conversion.hpp"
#include "mechanism/restitution.hpp"

namespace fork1s::internal {
namespace {

std::shared_ptr<const TriangleMesh> ConvertMesh(const mjModel& m, int id) {
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->name = NameOr(m, m.name_meshadr[id], "mesh", id);
  const float* v = m.mesh_vert + 3 * m.mesh_vertadr[id];
  for (int i = 0; i < m.mesh_vertnum[id]; ++i)
    mesh->vertices.emplace_back(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
  const int* f = m.mesh_face + 3 * m.mesh_faceadr[id];
  for (int i = 0; i < m.mesh_facenum[id]; ++i)
    mesh->triangles.emplace_back(f[3 * i], f[3 * i + 1], f[3 * i + 2]);
  if (m.mesh_texcoordadr[id] < 0) return mesh;
  const float* uv = m.mesh_texcoord + 2 * m.mesh_texcoordadr[id];
  const int* corners = m.mesh_facetexcoord + 3 * m.mesh_faceadr[id];
  for (int i = 0; i < 3 * m.mesh_facenum[id]; ++i)
    mesh->corner_uv.emplace_back(uv[2 * corners[i]], uv[2 * corners[i] + 1]);
  return mesh;
}

std::shared_ptr<const HeightGrid> ConvertHeights(const mjModel& m, int id) {
  auto grid = std::make_shared<HeightGrid>();
  grid->name = NameOr(m, m.name_hfieldadr[id], "hfield", id);
  grid->rows = m.hfield_nrow[id];
  grid->columns = m.hfield_ncol[id];
  const mjtNum* size = m.hfield_size + 4 * id;
  grid->half_x = size[0];
  grid->half_y = size[1];
  grid->max_height = size[2];
  grid->base_depth = size[3];
  const float* data = m.hfield_data + m.hfield_adr[id];
  grid->values.assign(data, data + grid->rows * grid->columns);
  return grid;
}

// MuJoCo takes a geom's own colour where it differs from the default grey, else the material's.
Vector4 Colour(const mjModel& m, int g) {
  const float* own = m.geom_rgba + 4 * g;
  const bool is_default = own[0] == 0.5f && own[1] == 0.5f && own[2] == 0.5f && own[3] == 1.0f;
  const int material = m.geom_matid[g];
  const float* c = is_default && material >= 0 ? m.mat_rgba + 4 * material : own;
  return {c[0], c[1], c[2], c[3]};
}

class Shapes {
 public:
  explicit Shapes(const mjModel& model) : m(model), meshes_(model.nmesh), grids_(model.nhfield) {}

  std::optional<Shape> Of(int g) {
    const mjtNum* s = m.geom_size + 3 * g;
    const int data = m.geom_dataid[g];
    switch (m.geom_type[g]) {
      case mjGEOM_PLANE:
        return Plane{s[0], s[1]};
      case mjGEOM_SPHERE:
        return Sphere{s[0]};
      case mjGEOM_CAPSULE:
        return Capsule{s[0], s[1]};
      case mjGEOM_CYLINDER:
        return Cylinder{s[0], s[1]};
      case mjGEOM_ELLIPSOID:
        return Ellipsoid{Vec3(s)};
      case mjGEOM_BOX:
        return Box{Vec3(s)};
      case mjGEOM_MESH:
        if (data < 0) return std::nullopt;
        if (!meshes_[data]) meshes_[data] = ConvertMesh(m, data);
        return MeshShape{meshes_[data]};
      case mjGEOM_HFIELD:
        if (data < 0) return std::nullopt;
        if (!grids_[data]) grids_[data] = ConvertHeights(m, data);
        return HeightField{grids_[data]};
      default:
        return std::nullopt;
    }
  }

 private:
  const mjModel& m;
  std::vector<std::shared_ptr<const TriangleMesh>> meshes_;
  std::vector<std::shared_ptr<const HeightGrid>> grids_;
};

// Pictures of materials, each converted once.
class Pictures {
 public:
  explicit Pictures(const mjModel& model) : m(model), known_(static_cast<std::size_t>(model.ntex)) {}

  // Puts on a geom what its material shows; cube maps, and pictures on shapes that have no uv, are not shown.
  void Put(int g, GeometryDef& geometry) {
    const int material = m.geom_matid[g];
    if (material < 0) return;
    const int* roles = m.mat_texid + mjNTEXROLE * material;
    const int id = roles[mjTEXROLE_RGB] >= 0 ? roles[mjTEXROLE_RGB] : roles[mjTEXROLE_RGBA];
    if (id < 0 || m.tex_type[id] != mjTEXTURE_2D) return;
    const auto* plane = std::get_if<Plane>(&geometry.shape);
    const auto* mesh = std::get_if<MeshShape>(&geometry.shape);
    if (!plane && !(mesh && !mesh->mesh->corner_uv.empty())) return;
    geometry.picture = Convert(id);
    if (!plane || !geometry.picture) return;
    // `texrepeat` counts over the whole of a plane, or over 2 m of one without end or with texuniform.
    const float* repeat = m.mat_texrepeat + 2 * material;
    const bool uniform = m.mat_texuniform[material];
    geometry.picture_x =
        0.5 * static_cast<double>(repeat[0]) / (plane->half_x > 0 && !uniform ? plane->half_x : 1);
    geometry.picture_y =
        0.5 * static_cast<double>(repeat[1]) / (plane->half_y > 0 && !uniform ? plane->half_y : 1);
  }

 private:
  std::shared_ptr<const Picture> Convert(int id) {
    auto& known = known_[static_cast<std::size_t>(id)];
    const int channels = m.tex_nchannel[id];
    if (known || m.tex_width[id] <= 0 || m.tex_height[id] <= 0 || channels < 1) return known;
    auto picture = std::make_shared<Picture>();
    picture->name = NameOr(m, m.name_texadr[id], "texture", id);
    picture->width = m.tex_width[id];
    picture->height = m.tex_height[id];
    const auto pixels = static_cast<std::size_t>(picture->width) * static_cast<std::size_t>(picture->height);
    const mjtByte* data = m.tex_data + m.tex_adr[id];
    picture->rgb.reserve(3 * pixels);
    for (std::size_t i = 0; i < pixels; ++i, data += channels)
      for (int k = 0; k < 3; ++k) picture->rgb.push_back(data[channels >= 3 ? k : 0]);
    return known = std::move(picture);
  }

  const mjModel& m;
  std::vector<std::shared_ptr<const Picture>> known_;
};

bool Overrides(const mjModel& m) { return m.opt.enableflags & mjENBL_OVERRIDE; }

// The damping ratio that a contact's `solref` gives: named, or by stiffness and damping per mass.
double DampingRatio(const mjModel& m, const mjtNum* own) {
  const mjtNum* solref = Overrides(m) ? m.opt.o_solref : own;
  if (solref[0] > 0) return solref[1];
  return solref[0] < 0 ? -solref[1] / (2 * std::sqrt(-solref[0])) : 1;
}

// The explicit contact pairs of the file, and for each geom those of which it is one side.
std::vector<std::vector<int>> ConvertPairs(Conversion& c) {
  const mjModel& m = c.m;
  std::vector<std::vector<int>> pairs_of(static_cast<std::size_t>(m.ngeom));
  std::vector<std::string> rigid, by_direction;
  for (int k = 0; k < m.npair; ++k) {
    const int g = m.pair_geom1[k], h = m.pair_geom2[k];
    ContactPairDef pair;
    pair.name = NameOr(m, m.name_pairadr[k], "pair", k);
    if (m.body_weldid[m.geom_bodyid[g]] == m.body_weldid[m.geom_bodyid[h]]) {
      rigid.push_back(pair.name);
      continue;
    }
    // Two sliding coefficients, torsion, two rolling coefficients; condim says how many of them act.
    const mjtNum* friction = Overrides(m) ? m.opt.o_friction : m.pair_friction + 5 * k;
    const int dim = m.pair_dim[k];
    pair.friction = dim == 1 ? 0 : std::max(friction[0], friction[1]);
    if (pair.friction > 0) pair.friction_scale = Vector2(friction[0], friction[1]) / pair.friction;
    if (dim >= 4) pair.torsion = friction[2];
    if (dim >= 6) pair.rolling = std::max(friction[3], friction[4]);
    if (dim >= 6 && friction[3] != friction[4]) by_direction.push_back(pair.name);
    pair.restitution = RestitutionOf(DampingRatio(m, m.pair_solref + mjNREF * k));
    pair.margin = Overrides(m) ? m.opt.o_margin : m.pair_margin[k];
    pair.gap = m.pair_gap[k];
    pair.adhesion = m.pair_adhesion[k];
    for (int side : {g, h})
      pairs_of[static_cast<std::size_t>(side)].push_back(static_cast<int>(c.scene.contact_pairs.size()));
    c.scene.contact_pairs.push_back(std::move(pair));
  }
  c.DroppedMany("contact pair", rigid, "its geoms do not move relative to each other");
  c.ChangedMany(
      "contact pair", by_direction,
      "rolling friction is the same in all directions here, so the larger of its two coefficients acts");
  return pairs_of;
}

}  // namespace

void ConvertGeoms(Conversion& c) {
  const mjModel& m = c.m;
  Shapes shapes(m);
  Pictures pictures(m);
  const bool contacts_off = m.opt.disableflags & (mjDSBL_CONTACT | mjDSBL_CONSTRAINT);
  const auto pairs_of =
      contacts_off ? std::vector<std::vector<int>>(static_cast<std::size_t>(m.ngeom)) : ConvertPairs(c);
  c.shape.assign(static_cast<std::size_t>(m.ngeom), -1);
  for (int g = 0; g < m.ngeom; ++g) {
    std::optional<Shape> shape = shapes.Of(g);
    const std::string name = NameOr(m, m.name_geomadr[g], "geom", g);
    if (!shape) {
      c.Dropped(fmt::format("geom '{}'", name), "its type is not a shape that can be drawn or touched");
      continue;
    }
    GeometryDef geometry;
    geometry.name = name;
    geometry.shape = std::move(*shape);
    const mjtNum* q = m.geom_quat + 4 * g;
    geometry.X_BG = RigidTransform(Quaternion(q[0], q[1], q[2], q[3]), Vec3(m.geom_pos + 3 * g));
    const mjtNum* friction = m.geom_friction + 3 * g;
    const std::array<double, 3> coefficients =
        Overrides(m) ? std::array<double, 3>{m.opt.o_friction[0], m.opt.o_friction[2], m.opt.o_friction[3]}
                     : std::array<double, 3>{friction[0], friction[1], friction[2]};
    geometry.friction = coefficients[0];
    geometry.priority = m.geom_priority[g];
    geometry.contype = contacts_off ? 0 : m.geom_contype[g];
    geometry.conaffinity = contacts_off ? 0 : m.geom_conaffinity[g];
    geometry.frictionless = m.geom_condim[g] == 1;
    geometry.torsion = coefficients[1];
    geometry.rolling = coefficients[2];
    geometry.moments = m.geom_condim[g] >= 6 ? 2 : m.geom_condim[g] >= 4 ? 1 : 0;
    geometry.restitution = RestitutionOf(DampingRatio(m, m.geom_solref + mjNREF * g));
    // Two geoms touch at the sum of their margins, which an override gives as a whole.
    geometry.margin = Overrides(m) ? 0.5 * m.opt.o_margin : m.geom_margin[g];
    geometry.gap = m.geom_gap[g];
    geometry.adhesion = m.geom_adhesion[g];
    geometry.surface_velocity << Vec3(m.geom_surfacevel + 6 * g + 3), Vec3(m.geom_surfacevel + 6 * g);
    geometry.pairs = pairs_of[static_cast<std::size_t>(g)];
    geometry.rgba = Colour(m, g);
    geometry.group = m.geom_group[g];
    pictures.Put(g, geometry);

    const int b = m.geom_bodyid[g];
    const BodyPlace& place = c.body[b];
    std::vector<GeometryDef>* shapes_of_body = &c.scene.world;
    if (place.mechanism >= 0) {
      shapes_of_body = &c.scene.mechanisms[place.mechanism].bodies[place.body.u()].geometries;
    } else if (place.free_body >= 0) {
      FreeBodyDef& body = c.scene.free_bodies[place.free_body];
      geometry.X_BG = body.X_WB.inverse() * c.WorldPose(b) * geometry.X_BG;
      shapes_of_body = &body.geometries;
    } else {
      geometry.X_BG = c.WorldPose(b) * geometry.X_BG;
      // Messages name shapes of the world alone, so one without a name says whose it is.
      if (b != 0 && m.names[m.name_geomadr[g]] == '\0')
        geometry.name = fmt::format("{}/{}", c.body_names[b], name);
    }
    c.shape[static_cast<std::size_t>(g)] = static_cast<int>(shapes_of_body->size());
    shapes_of_body->push_back(std::move(geometry));
  }
  if (contacts_off)
    c.Note(ImportNote::Kind::kChanged, "option", "contact is switched off, so no shape touches");
}

}  // namespace fork1s::internal
