#include "true_gap.hpp"

#include <cmath>

namespace fork1s::internal {
namespace {

// Face normals are copied from the box's rotation, so a contact that rests on a face matches to rounding.
constexpr double kAligned = 1e-10;

/// Height of the contact point over the face of the box whose outward normal is `side` times the contact's.
/// False where no face is.
bool HeightOverFace(const mjModel* model, const mjData* data, const mjContact& contact, int geom, double side,
                    double* height) {
  const mjtNum* R = data->geom_xmat + 9 * geom;
  const mjtNum* p = data->geom_xpos + 3 * geom;
  const mjtNum* n = contact.frame;
  for (int axis = 0; axis < 3; ++axis) {
    const double along = R[axis] * n[0] + R[3 + axis] * n[1] + R[6 + axis] * n[2];
    if (1 - std::abs(along) > kAligned) continue;
    const double offset =
        n[0] * (contact.pos[0] - p[0]) + n[1] * (contact.pos[1] - p[1]) + n[2] * (contact.pos[2] - p[2]);
    *height = side * offset - model->geom_size[3 * geom + axis];
    return true;
  }
  return false;
}

}  // namespace

double TrueGap(const mjModel* model, const mjData* data, const mjContact& contact) {
  const int type1 = model->geom_type[contact.geom1], type2 = model->geom_type[contact.geom2];
  if (type1 == mjGEOM_BOX && type2 == mjGEOM_BOX) {
    double height = 0;
    if (HeightOverFace(model, data, contact, contact.geom1, 1, &height) ||
        HeightOverFace(model, data, contact, contact.geom2, -1, &height)) {
      return 2 * height;
    }
  }
  if (type1 == mjGEOM_HFIELD && type2 != mjGEOM_SPHERE) {
    const mjtNum* R = data->geom_xmat + 9 * contact.geom1;
    const double up = R[2] * contact.frame[0] + R[5] * contact.frame[1] + R[8] * contact.frame[2];
    const double margin = contact.includemargin;
    return contact.dist + margin * (std::abs(up) + 0.5);
  }
  return contact.dist;
}

}  // namespace fork1s::internal
