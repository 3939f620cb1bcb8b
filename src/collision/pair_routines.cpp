#include "pair_routines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <mutex>

#include "box_box.hpp"
#include "contact_patch.hpp"
#include "cylinder_box.hpp"
#include "geometry/interval.hpp"
#include "sphere_on_grid.hpp"

// MuJoCo's search for one point of two convex shapes is exact once its tolerance is set for it. Its several
// points (multiccd) are not: with shapes apart they leave out the nearest point and turn the normal. So it is
// asked for one, and the others are made of the faces there. Two boxes have a routine of their own in MuJoCo,
// which overlooks contacts while they are apart; ours takes its place. On height fields MuJoCo stops at 50
// columns, in the order of the grid and not of nearness; ours asks again for what is nearer.
namespace fork1s::internal {
namespace {

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

mjfCollision mujoco_convex = nullptr, mujoco_box_box = nullptr, mujoco_field = nullptr,
             mujoco_field_sphere = nullptr, mujoco_plane_mesh = nullptr, mujoco_plane_cylinder = nullptr,
             mujoco_capsule_box = nullptr, mujoco_capsules = nullptr;

bool IsOurs(const mjModel* m) { return std::strcmp(m->names, kCollisionModelName) == 0; }

// MuJoCo asked for one point. The model is the world's own, and only one thread searches it at a time. It
// cannot be told so for good: it gives routines room for as many points as the flag lets it expect.
class OnePoint {
 public:
  explicit OnePoint(const mjModel* m) : flags_(const_cast<mjModel*>(m)->opt.disableflags), before_(flags_) {
    flags_ |= mjDSBL_MULTICCD;
  }
  ~OnePoint() { flags_ = before_; }
  OnePoint(const OnePoint&) = delete;
  OnePoint& operator=(const OnePoint&) = delete;

 private:
  int& flags_;
  int before_;
};

struct Posed {
  Eigen::Map<const RowMajor> R;
  Eigen::Map<const Vector3> p, size;

  Posed(const mjModel* m, const mjData* d, int geom)
      : R(d->geom_xmat + 9 * geom), p(d->geom_xpos + 3 * geom), size(m->geom_size + 3 * geom) {}
  Vector3 Out(const Vector3& v) const { return R * v + p; }
};

void AddBoxFace(const Posed& box, const Vector3& n, SupportFace& face) {
  Eigen::Index axis = 0;
  n.cwiseAbs().maxCoeff(&axis);
  const Eigen::Index u = (axis + 1) % 3, v = (axis + 2) % 3;
  for (const auto& [side_u, side_v] :
       {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)}) {
    Vector3 corner;
    corner[axis] = std::copysign(box.size[axis], n[axis]);
    corner[u] = side_u * box.size[u];
    corner[v] = side_v * box.size[v];
    face.Add(box.Out(corner));
  }
}

// A flat end as eight points of its rim, or the line of the side.
void AddCylinderFace(const Posed& cylinder, const Vector3& n, SupportFace& face) {
  const double radius = cylinder.size[0], half = cylinder.size[1], flat = std::hypot(n.x(), n.y());
  if (std::abs(n.z()) > flat) {
    constexpr int kRim = 8;
    constexpr double kStep = 2 * 3.14159265358979323846 / kRim;
    for (int k = 0; k < kRim; ++k)
      face.Add(cylinder.Out(
          {radius * std::cos(k * kStep), radius * std::sin(k * kStep), std::copysign(half, n.z())}));
    return;
  }
  const double x = radius * n.x() / flat, y = radius * n.y() / flat;
  face.Add(cylinder.Out({x, y, -half}));
  face.Add(cylinder.Out({x, y, half}));
  face.to_axis = cylinder.R * Vector3(-x, -y, 0);
}

void AddCapsuleFace(const Posed& capsule, const Vector3& n, SupportFace& face) {
  const Vector3 out = capsule.size[0] * n, half(0, 0, capsule.size[1]);
  face.Add(capsule.Out(out - half));
  face.Add(capsule.Out(out + half));
  face.to_axis = capsule.R * Vector3(-out);
}

// The flat face of the hull that looks along n the most.
void AddMeshFace(const mjModel* m, int geom, const Posed& mesh, const Vector3& n, SupportFace& face) {
  const int id = m->geom_dataid[geom], first = m->mesh_polyadr[id];
  int best = -1;
  double most = 0;
  for (int k = first; k < first + m->mesh_polynum[id]; ++k)
    if (const double along = n.dot(Eigen::Map<const Vector3>(m->mesh_polynormal + 3 * k)); along > most) {
      most = along;
      best = k;
    }
  if (best < 0) return;
  const int count = m->mesh_polyvertnum[best], kept = std::min(count, SupportFace::kMost);
  for (int i = 0; i < kept; ++i) {
    const int vertex = m->mesh_polyvert[m->mesh_polyvertadr[best] + i * count / kept];
    face.Add(mesh.Out(
        Eigen::Map<const Eigen::Vector3f>(m->mesh_vert + 3 * (m->mesh_vertadr[id] + vertex)).cast<double>()));
  }
}

SupportFace FaceAlong(const mjModel* m, const mjData* d, int geom, const Vector3& n_W) {
  const Posed posed(m, d, geom);
  const Vector3 n = posed.R.transpose() * n_W;
  SupportFace face;
  switch (m->geom_type[geom]) {
    case mjGEOM_BOX:
      AddBoxFace(posed, n, face);
      break;
    case mjGEOM_CYLINDER:
      AddCylinderFace(posed, n, face);
      break;
    case mjGEOM_CAPSULE:
      AddCapsuleFace(posed, n, face);
      break;
    case mjGEOM_MESH:
      AddMeshFace(m, geom, posed, n, face);
      break;
    default:
      break;  // round: one point
  }
  return face;
}

// What is chosen of a patch; `room`: for how many.
int WritePatch(ContactPatch& patch, int room, mjPreContact* contacts) {
  const int count = std::min(patch.ChooseSupport(), room);
  for (int i = 0; i < count; ++i) {
    contacts[i].dist = patch[i].gap;
    Eigen::Map<Vector3>(contacts[i].pos) = patch[i].point;
    Eigen::Map<Vector3>(contacts[i].normal) = patch[i].normal;
    Eigen::Map<Vector3>(contacts[i].tangent).setZero();
  }
  return count;
}

Deepest DeepestOf(const mjPreContact& contact) {
  Deepest deepest;
  deepest.gap = contact.dist;
  deepest.normal = Eigen::Map<const Vector3>(contact.normal);
  deepest.point = Eigen::Map<const Vector3>(contact.pos);
  return deepest;
}

bool FindDeepest(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, double margin,
                 Deepest& deepest) {
  if (m->geom_type[a] == mjGEOM_BOX && m->geom_type[b] == mjGEOM_BOX) {
    const Posed box_a(m, d, a), box_b(m, d, b);
    return BoxBox(box_a.size, RigidTransform(Matrix3(box_a.R), box_a.p), box_b.size,
                  RigidTransform(Matrix3(box_b.R), box_b.p), margin, deepest);
  }
  if (m->geom_type[a] == mjGEOM_CYLINDER && m->geom_type[b] == mjGEOM_BOX) {
    const Posed cylinder(m, d, a), box(m, d, b);
    const auto found =
        CylinderBox(cylinder.size[0], cylinder.size[1], RigidTransform(Matrix3(cylinder.R), cylinder.p),
                    box.size, RigidTransform(Matrix3(box.R), box.p), margin);
    if (found) {
      deepest = *found;
      return deepest.gap < margin;
    }
  }
  if (m->geom_type[a] == mjGEOM_CAPSULE && m->geom_type[b] == mjGEOM_CYLINDER) {
    const Posed capsule(m, d, a), cylinder(m, d, b);
    const auto found = CylinderCapsule(
        cylinder.size[0], cylinder.size[1], RigidTransform(Matrix3(cylinder.R), cylinder.p), capsule.size[0],
        capsule.size[1], RigidTransform(Matrix3(capsule.R), capsule.p), margin);
    if (found) {
      deepest = *found;
      deepest.normal = -found->normal;
      return deepest.gap < margin;
    }
  }
  const OnePoint one(m);
  if (mujoco_convex(m, d, contacts, a, b, margin) == 0) return false;
  deepest = DeepestOf(contacts[0]);
  return true;
}

// The deepest point, and of several what else the faces and lines there may rest on.
int WriteOverlap(const mjModel* m, const mjData* d, mjPreContact* contacts, int a, int b, double margin,
                 const Deepest& deepest) {
  ContactPatch patch(deepest.normal);
  patch.SetDeepest(deepest.point, deepest.gap);
  if (!(m->opt.disableflags & mjDSBL_MULTICCD))
    patch.AddOverlap(FaceAlong(m, d, a, deepest.normal), FaceAlong(m, d, b, -deepest.normal), margin);
  return WritePatch(patch, mjMAXCONPAIR, contacts);
}

int ConvexPair(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  Deepest deepest;
  return FindDeepest(m, d, contacts, a, b, margin, deepest)
             ? WriteOverlap(m, d, contacts, a, b, margin, deepest)
             : 0;
}

constexpr double kSameNormal =
    1 - 5e-9;  // cosine of 1e-4 rad: one face of the ground, seen by several columns

// MuJoCo's nearest point of a capsule and a box, or of two capsules, is exact. Its second one is not to be had where the
// capsule stands out of the face on both sides, or lies along an edge: which edge it names, if any, turns with the last
// digits of the pose, and what lies there tips over.
int OnCapsule(const mjModel* m, const mjData* d, mjPreContact* contacts, int found, int a, int b,
              double margin) {
  if (found == 0 || m->opt.disableflags & mjDSBL_MULTICCD) return found;
  const mjPreContact& nearest =
      *std::min_element(contacts, contacts + found,
                        [](const mjPreContact& p, const mjPreContact& q) { return p.dist < q.dist; });
  return WriteOverlap(m, d, contacts, a, b, margin, DeepestOf(nearest));
}
// Whether the segment of a capsule meets the box.
bool Pierces(const Posed& capsule, const Posed& box) {
  const Vector3 middle = box.R.transpose() * (capsule.p - box.p),
                along = box.R.transpose() * (capsule.size[1] * capsule.R.col(2));
  const RayInterval inside = InBox(middle - along, 2 * along, box.size);
  return inside.first < std::min(inside.last, 1.0);
}
// MuJoCo's routine seeks the point of the segment that is nearest to the box and says nothing, or that they are apart, of
// a segment that meets it. That is a box without width, as deep in the other as the two boxes are, and by the radius more.
int CapsuleOnBox(const mjModel* m, mjData* d, mjPreContact* contacts, int capsule, int box, mjtNum margin) {
  const Posed rod(m, d, capsule), block(m, d, box);
  Deepest deepest;
  if (!(m->opt.disableflags & mjDSBL_MULTICCD) && Pierces(rod, block) &&
      BoxBox(block.size, RigidTransform(Matrix3(block.R), block.p), Vector3(0, 0, rod.size[1]),
             RigidTransform(Matrix3(rod.R), rod.p), margin, deepest)) {
    deepest.normal = -deepest.normal;
    deepest.point += 0.5 * rod.size[0] * deepest.normal;
    deepest.gap -= rod.size[0];
    return WriteOverlap(m, d, contacts, capsule, box, margin, deepest);
  }
  return OnCapsule(m, d, contacts, mujoco_capsule_box(m, d, contacts, capsule, box, margin), capsule, box,
                   margin);
}
int CapsuleOnCapsule(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return OnCapsule(m, d, contacts, mujoco_capsules(m, d, contacts, a, b, margin), a, b, margin);
}

// Corners of the face that looks at a plane, and what `patch` has of the shape already.
int FaceOnPlane(const mjModel* m, const mjData* d, mjPreContact* contacts, int plane, int shape,
                double margin, ContactPatch& patch) {
  const Posed posed(m, d, plane);
  const Vector3 n = posed.R.col(2);
  const SupportFace face = FaceAlong(m, d, shape, -n);
  for (int i = 0; i < face.count; ++i)
    if (const double gap = n.dot(face[i] - posed.p); gap < margin) patch.Add(face[i] - 0.5 * gap * n, gap);
  return WritePatch(patch, mjMAXCONPAIR, contacts);
}

// MuJoCo names the nearest corner and some of its neighbours; a face that lies on the plane has more.
int MeshOnPlane(const mjModel* m, mjData* d, mjPreContact* contacts, int plane, int mesh, mjtNum margin) {
  const int found = mujoco_plane_mesh(m, d, contacts, plane, mesh, margin);
  if (found == 0 || m->opt.disableflags & mjDSBL_MULTICCD) return found;
  ContactPatch patch(Posed(m, d, plane).R.col(2));
  for (int i = 0; i < found; ++i) patch.Add(Eigen::Map<const Vector3>(contacts[i].pos), contacts[i].dist);
  return FaceOnPlane(m, d, contacts, plane, mesh, margin, patch);
}

// The nearest point of the lower rim in closed form. MuJoCo takes the direction to it from what is left of two vectors:
// of a cylinder that stands level that is rounding, and the point may be off by the radius along the normal. Of a flat
// end it names two more, turned as the nearest one is, which rolls about the rim.
int CylinderOnPlane(const mjModel* m, mjData* d, mjPreContact* contacts, int plane, int cylinder,
                    mjtNum margin) {
  if (m->opt.disableflags & mjDSBL_MULTICCD)
    return mujoco_plane_cylinder(m, d, contacts, plane, cylinder, margin);
  const Posed ground(m, d, plane), posed(m, d, cylinder);
  const double radius = posed.size[0], half = posed.size[1];
  const Vector3 n = ground.R.col(2), axis = posed.R.col(2);
  const Vector3 across = n.cross(axis);  // as long as the sine of the tilt
  const Vector3 end = posed.p - std::copysign(half, n.dot(axis)) * axis;
  const double gap = n.dot(end - ground.p) - radius * across.norm();
  if (!(gap < margin)) return 0;
  // Level but for rounding, any point of the rim is the nearest.
  const Vector3 along = across.norm() > 1e-12 ? axis.cross(across).normalized() : Vector3(posed.R.col(0));
  ContactPatch patch(n);
  const double lower = n.dot(along) > 0 ? -radius : radius;
  patch.SetDeepest(end + lower * along - 0.5 * gap * n, gap);
  return FaceOnPlane(m, d, contacts, plane, cylinder, margin, patch);
}

// Contacts of a convex shape with a field: of each normal at most as many as a patch keeps.
class FieldContacts {
 public:
  void Add(const mjPreContact& contact) {
    if (count_ < kMost) contacts_[static_cast<std::size_t>(count_++)] = contact;
  }
  int Write(mjPreContact* out) {
    int written = 0;
    std::array<bool, kMost> used{};
    for (int i = 0; i < count_ && written < mjMAXCONPAIR; ++i) {
      if (used[static_cast<std::size_t>(i)]) continue;
      const Vector3 n = Normal(i);
      ContactPatch patch(n);
      for (int k = i; k < count_; ++k) {
        if (used[static_cast<std::size_t>(k)] || !(n.dot(Normal(k)) > kSameNormal)) continue;
        used[static_cast<std::size_t>(k)] = true;
        const mjPreContact& c = contacts_[static_cast<std::size_t>(k)];
        patch.Add(Eigen::Map<const Vector3>(c.pos), c.dist);
      }
      written += WritePatch(patch, mjMAXCONPAIR - written, out + written);
    }
    return written;
  }

 private:
  Vector3 Normal(int i) const {
    return Eigen::Map<const Vector3>(contacts_[static_cast<std::size_t>(i)].normal);
  }
  static constexpr int kMost = 4 * mjMAXCONPAIR;
  std::array<mjPreContact, kMost> contacts_;
  int count_ = 0;
};

// Corners of a shape that look at the ground, each once; of a capsule the middles of its ends.
class FieldCorners {
 public:
  FieldCorners(const mjModel* m, const mjData* d, int shape)
      : model_(m), data_(d), shape_(shape), is_capsule_(m->geom_type[shape] == mjGEOM_CAPSULE) {}

  void AddFace(const Vector3& normal) {
    const SupportFace face = FaceAlong(model_, data_, shape_, -normal);
    for (int i = 0; i < face.count && count_ < kMost; ++i) {
      const Vector3 corner = face[i] + Radius() * normal;
      const auto end = corners_.begin() + count_;
      if (std::none_of(corners_.begin(), end, [&](const Vector3& c) { return (c - corner).norm() < kLevel; }))
        corners_[static_cast<std::size_t>(count_++)] = corner;
    }
  }
  // Each with the places of the ground nearest to it, where that corner is the shape's nearest.
  void Report(int field, double margin, FieldContacts& contacts) const {
    std::array<mjPreContact, 16> nearest;
    for (int i = 0; i < count_; ++i) {
      const Vector3& corner = corners_[static_cast<std::size_t>(i)];
      const int found = BallOnGrid(model_, data_, nearest.data(), field, corner, Radius(), margin);
      for (int k = 0; k < found; ++k) {  // several in a valley
        const mjPreContact& place = nearest[static_cast<std::size_t>(k)];
        if (is_capsule_ || IsLowest(corner, Eigen::Map<const Vector3>(place.normal))) contacts.Add(place);
      }
    }
  }

 private:
  double Radius() const { return is_capsule_ ? model_->geom_size[3 * shape_] : 0; }
  bool IsLowest(const Vector3& corner, const Vector3& normal) const {
    const SupportFace lowest = FaceAlong(model_, data_, shape_, -normal);
    for (int i = 0; i < lowest.count; ++i)
      if (normal.dot(lowest[i] - corner) < -kLevel) return false;
    return true;
  }
  static constexpr int kMost = 64;
  static constexpr double kLevel = 1e-6;  // m
  const mjModel* model_;
  const mjData* data_;
  int shape_;
  bool is_capsule_;
  std::array<Vector3, kMost> corners_;
  int count_ = 0;
};

// A ridge that a flat face lies on bears at both ends, where MuJoCo's columns name the one that is nearer:
// those of the ground's edges through a contact that are level with the face, as far as they lie under it.
void AddRidge(const mjModel* m, const mjData* d, int field, int shape, const mjPreContact& contact,
              double margin, FieldContacts& contacts) {
  constexpr double kLevel = 1e-2;  // rad
  const Vector3 n = Eigen::Map<const Vector3>(contact.normal);
  const SupportFace face = FaceAlong(m, d, shape, -n);
  if (face.count < 3) return;
  Vector3 up = (face[1] - face[0]).cross(face[2] - face[0]).normalized();
  if (up.dot(n) < 0) up = -up;
  if (!(up.dot(n) > std::cos(kLevel))) return;  // by an edge or a corner that leads elsewhere
  const double turn = (face[1] - face[0]).cross(face[2] - face[0]).dot(up) > 0 ? 1 : -1;
  const Vector3 on_ground = Eigen::Map<const Vector3>(contact.pos) - 0.5 * contact.dist * n;
  const EdgesOfGrid edges = EdgesThrough(m, d, field, on_ground);
  for (int i = 0; i < edges.count; ++i) {
    const auto& [a, b] = edges.ends[static_cast<std::size_t>(i)];
    const Vector3 along = b - a;
    if (std::abs(up.dot(along)) > kLevel * along.norm()) continue;
    double from = 0, to = 1;
    for (int k = 0; k < face.count; ++k) {
      const Vector3 inward = turn * up.cross(face[(k + 1) % face.count] - face[k]);
      const double at_a = inward.dot(a - face[k]), rise = inward.dot(along);
      if (std::abs(rise) <= 1e-12 * inward.norm() * along.norm()) continue;
      if (rise > 0)
        from = std::max(from, -at_a / rise);
      else
        to = std::min(to, -at_a / rise);
    }
    if (!(from < to)) continue;
    for (const double s : {from, to}) {
      const Vector3 p = a + s * along;
      mjPreContact end = contact;
      end.dist = up.dot(face[0] - p);
      if (!(end.dist < margin)) continue;
      Eigen::Map<Vector3>(end.pos) = p + 0.5 * end.dist * up;
      Eigen::Map<Vector3>(end.normal) = up;
      contacts.Add(end);
    }
  }
}

// MuJoCo takes each column for a body of its own. What it finds at the side of one, where another stands, is
// left out, or what slides would catch there. In its place count the corners of the shape, which are where it
// rests on ground that is even or hollow; what columns say right are the peaks and ridges.
int OfTheSurface(const mjModel* m, const mjData* d, int field, int shape, double margin, int count,
                 mjPreContact* contacts) {
  FieldCorners corners(m, d, shape);
  std::array<Vector3, mjMAXCONPAIR> faces;  // normals of the ground here
  int num_faces = 0, num_right = 0;
  const auto add_face = [&](const Vector3& n) {
    const auto end = faces.begin() + num_faces;
    if (std::any_of(faces.begin(), end, [&](const Vector3& f) { return f.dot(n) > kSameNormal; })) return;
    faces[static_cast<std::size_t>(num_faces++)] = n;
    corners.AddFace(n);
  };
  for (int i = 0; i < count; ++i) {
    const Vector3 n = Eigen::Map<const Vector3>(contacts[i].normal);
    const Vector3 on_ground = Eigen::Map<const Vector3>(contacts[i].pos) - 0.5 * contacts[i].dist * n;
    std::array<mjPreContact, 16> nearest;
    if (SupportsFromBelow(m, d, field, on_ground, n)) {
      contacts[num_right++] = contacts[i];
      add_face(n);
    } else if (BallOnGrid(m, d, nearest.data(), field, on_ground, 0, 1e-3) > 0) {
      add_face(Eigen::Map<const Vector3>(nearest[0].normal));
    }
  }
  FieldContacts kept;
  corners.Report(field, margin, kept);
  for (int i = 0; i < num_right; ++i) kept.Add(contacts[i]);  // after corners, which count first among equals
  for (int i = 0; i < num_right; ++i) AddRidge(m, d, field, shape, contacts[i], margin, kept);
  return kept.Write(contacts);
}

int ConvexOnField(const mjModel* m, mjData* d, mjPreContact* contacts, int field, int shape, mjtNum margin) {
  const OnePoint one(m);
  const double wanted = margin;
  int count = mujoco_field(m, d, contacts, field, shape, margin);
  std::array<mjPreContact, mjMAXCONPAIR> nearer;
  std::array<double, mjMAXCONPAIR> gaps;
  while (count == mjMAXCONPAIR && margin > 0) {
    for (std::size_t i = 0; i < gaps.size(); ++i) gaps[i] = contacts[i].dist;
    const auto middle = gaps.begin() + mjMAXCONPAIR / 2;
    std::nth_element(gaps.begin(), middle, gaps.end());
    // Half of them are nearer than the middle one, and so may be others that were never looked at. Where half
    // are equally near, only those count that are nearer than all. MuJoCo's gaps are wrong at margins below
    // zero.
    double within = *middle;
    if (!(within < margin)) within = *std::min_element(gaps.begin(), gaps.end());
    within = std::max(within, 0.0);
    if (!(within < margin)) break;
    const int found = mujoco_field(m, d, nearer.data(), field, shape, within);
    if (found == 0) break;
    std::copy_n(nearer.begin(), found, contacts);
    count = found;
    margin = within;
  }
  return OfTheSurface(m, d, field, shape, wanted, count, contacts);
}

int ConvexOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? ConvexPair : mujoco_convex)(m, d, contacts, a, b, margin);
}
int BoxBoxOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? ConvexPair : mujoco_box_box)(m, d, contacts, a, b, margin);
}
int PlaneMeshOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? MeshOnPlane : mujoco_plane_mesh)(m, d, contacts, a, b, margin);
}
int PlaneCylinderOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? CylinderOnPlane : mujoco_plane_cylinder)(m, d, contacts, a, b, margin);
}
int CapsuleBoxOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? CapsuleOnBox : mujoco_capsule_box)(m, d, contacts, a, b, margin);
}
int CapsulesOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? CapsuleOnCapsule : mujoco_capsules)(m, d, contacts, a, b, margin);
}
int FieldOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? ConvexOnField : mujoco_field)(m, d, contacts, a, b, margin);
}
int FieldSphereOrOwn(const mjModel* m, mjData* d, mjPreContact* contacts, int a, int b, mjtNum margin) {
  return (IsOurs(m) ? SphereOnGrid : mujoco_field_sphere)(m, d, contacts, a, b, margin);
}

}  // namespace

void InstallPairRoutines() {
  static std::once_flag once;
  std::call_once(once, [] {
    mujoco_convex = mjCOLLISIONFUNC[mjGEOM_ELLIPSOID][mjGEOM_CYLINDER];
    mujoco_box_box = mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX];
    mujoco_field = mjCOLLISIONFUNC[mjGEOM_HFIELD][mjGEOM_BOX];
    mujoco_field_sphere = mjCOLLISIONFUNC[mjGEOM_HFIELD][mjGEOM_SPHERE];
    mujoco_plane_mesh = mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_MESH];
    mujoco_plane_cylinder = mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_CYLINDER];
    mujoco_capsules = mjCOLLISIONFUNC[mjGEOM_CAPSULE][mjGEOM_CAPSULE];
    mujoco_capsule_box = mjCOLLISIONFUNC[mjGEOM_CAPSULE][mjGEOM_BOX];
    for (int a = 0; a < mjNGEOMTYPES; ++a)
      for (int b = a; b < mjNGEOMTYPES; ++b) {
        mjfCollision& routine = mjCOLLISIONFUNC[a][b];
        if (routine == mujoco_convex) routine = &ConvexOrOwn;
        if (routine == mujoco_field && b != mjGEOM_SPHERE) routine = &FieldOrOwn;
      }
    mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX] = &BoxBoxOrOwn;
    mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_MESH] = &PlaneMeshOrOwn;
    mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_CYLINDER] = &PlaneCylinderOrOwn;
    mjCOLLISIONFUNC[mjGEOM_HFIELD][mjGEOM_SPHERE] = &FieldSphereOrOwn;
    mjCOLLISIONFUNC[mjGEOM_CAPSULE][mjGEOM_CAPSULE] = &CapsulesOrOwn;
    mjCOLLISIONFUNC[mjGEOM_CAPSULE][mjGEOM_BOX] = &CapsuleBoxOrOwn;
  });
}

void SetPairOptions(mjModel& model, bool multi_point) {
  if (!multi_point) model.opt.disableflags |= mjDSBL_MULTICCD;
  // With MuJoCo's 1e-6 m and 35 steps, round shapes in penetration are wrong by up to 0.4 mm.
  model.opt.ccd_tolerance = 1e-10;
  model.opt.ccd_iterations = 1000;
}

}  // namespace fork1s::internal
