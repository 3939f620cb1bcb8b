#include "margin_limit.hpp"

#include <algorithm>
#include <limits>

namespace fork1s::internal {
namespace {

// Of the smallest half-size of either shape.
constexpr double kShare = 0.5;
constexpr double kLeast = 0.001;  // m; what is thinner than this is found late rather than never
constexpr double kNone = std::numeric_limits<double>::infinity();

bool IsGeneral(int type) {
  return type == mjGEOM_ELLIPSOID || type == mjGEOM_CYLINDER || type == mjGEOM_MESH || type == mjGEOM_HFIELD;
}

double SmallestHalfSize(const mjModel* model, int geom) {
  const mjtNum* size = model->geom_size + 3 * geom;
  switch (model->geom_type[geom]) {
    case mjGEOM_SPHERE:
    case mjGEOM_CAPSULE:
      return size[0];
    case mjGEOM_CYLINDER:
      return std::min(size[0], size[1]);
    case mjGEOM_ELLIPSOID:
    case mjGEOM_BOX:
    case mjGEOM_MESH:
      return std::min({size[0], size[1], size[2]});
    default:  // planes and height fields have none
      return kNone;
  }
}

}  // namespace

double MarginLimit(const mjModel* model, int geom1, int geom2) {
  const int a = model->geom_type[geom1], b = model->geom_type[geom2];
  const bool exact = (a == mjGEOM_HFIELD && b == mjGEOM_SPHERE) || (a == mjGEOM_SPHERE && b == mjGEOM_HFIELD);
  if (exact || a == mjGEOM_PLANE || b == mjGEOM_PLANE || !(IsGeneral(a) || IsGeneral(b))) return kNone;
  return std::max(kLeast, kShare * std::min(SmallestHalfSize(model, geom1), SmallestHalfSize(model, geom2)));
}

double MarginLimit(const mjModel* model) {
  bool general = false;
  double smallest = kNone;
  for (int g = 0; g < model->ngeom; ++g) {
    if (model->geom_contype[g] == 0 && model->geom_conaffinity[g] == 0) continue;
    general = general || IsGeneral(model->geom_type[g]);
    smallest = std::min(smallest, SmallestHalfSize(model, g));
  }
  return general ? std::max(kLeast, kShare * smallest) : kNone;
}

}  // namespace fork1s::internal
