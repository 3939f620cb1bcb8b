#include <fork1s/spatial/spatial_inertia.hpp>

namespace fork1s {

Matrix6 SpatialInertia::Matrix() const {
  const Matrix3 c = Skew(center);
  Matrix6 I;
  I.topLeftCorner<3, 3>() = rotational - mass * c * c;
  I.topRightCorner<3, 3>() = mass * c;
  I.bottomLeftCorner<3, 3>() = -mass * c;
  I.bottomRightCorner<3, 3>() = mass * Matrix3::Identity();
  return I;
}

SpatialInertia Transform(const RigidTransform& X, const SpatialInertia& I) {
  return {I.mass, X * I.center, X.rotation() * I.rotational * X.rotation().transpose()};
}

}  // namespace fork1s
