// Writes collision bodies as MJCF text with meshes on the side, for MuJoCo's compiler.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <locale>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

namespace fork1s::internal {

/// Strings and numbers one after another; numbers read back to the same bits.
template <class... Parts>
std::string Text(const Parts&... parts) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(17);
  (text << ... << parts);
  return text.str();
}

/// One geometry that collides, in the order in which it was written.
struct CollisionGeom {
  int body = -1;        // index of the collision body
  int geometry = -1;    // index in the body's geometries
  RigidTransform X_BG;  // as given; still bodies: in the world
  int mesh = -1;        // index in ModelText::meshes
  int grid = -1;        // index in ModelText::grids
  double friction = 0;
  int priority = 0;
  bool frictionless = false;
  double torsion = 0, rolling = 0;
  double restitution = 0;
  int moments = 0;
  double margin = 0, gap = 0, adhesion = 0;
  /// Of GeometryDef; once the model is compiled in and about MuJoCo's frame of the geom.
  Vector6 surface_velocity = Vector6::Zero();
  std::vector<int> pairs;  // explicit contact pairs
  double reach = 0;        // m: largest distance from its shape at which it takes part in a contact
};

/// The explicit contact pair of two geometries; -1: none.
int ExplicitPair(const std::vector<int>& pairs_a, const std::vector<int>& pairs_b);

struct ModelText {
  std::string xml;
  std::vector<CollisionGeom> geoms;                         // geom k is called "g<k>"
  std::vector<std::shared_ptr<const TriangleMesh>> meshes;  // mesh k is "m<k>.msh"
  std::vector<std::shared_ptr<const HeightGrid>> grids;     // hfield k is "h<k>"
};

/// Errors: kModel, naming the geometry whose shape makes no sense. kUsage: an excluded pair out of range.
Expected<ModelText> WriteModelText(const std::vector<CollisionBodyDef>& bodies,
                                   const std::vector<std::pair<int, int>>& excluded,
                                   const CollisionOptions& options);

/// The mesh in MuJoCo's binary format; without triangles MuJoCo takes the convex hull.
std::string WriteMsh(const TriangleMesh& mesh, bool with_triangles);

/// "body hand, geometry palm" for messages.
std::string Place(const CollisionBodyDef& body, int geometry);

}  // namespace fork1s::internal
