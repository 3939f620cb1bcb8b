#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/dynamics/rolling.hpp>
#include <fork1s/linalg/spectrum.hpp>

#include "group_geometry.hpp"
#include "local_curvature.hpp"

namespace fork1s {
namespace {

// Of one side of a contact, in world axes.
Matrix3 Curvature(const World& world, const Scene& scene, int body, int geometry, const Vector3& p,
                  const Vector3& outward) {
  const Contactor& c = world.contactors()[static_cast<std::size_t>(body)];
  RigidTransform X_WB;
  GeometryDef g;
  const auto at = static_cast<std::size_t>(geometry), i = static_cast<std::size_t>(c.index);
  if (c.kind == Contactor::Kind::kFreeBody) {
    g = scene.free_bodies[i].geometries[at];
    X_WB = world.free_bodies()[i].pose();
  } else if (body == 0) {  // the scene's own still geometry comes first
    g = scene.world[at];
  } else {
    const MechanismDynamics& m = world.mechanisms()[i];
    g = GroupGeometry(m.mechanism(), m.groups()[static_cast<std::size_t>(c.group)])[at];
    X_WB = m.GroupPose(c.group);
  }
  const RigidTransform X_WG = X_WB * g.X_BG;
  const Matrix3& R = X_WG.rotation();
  return R * LocalCurvature(g.shape, X_WG.inverse() * p, R.transpose() * outward) * R.transpose();
}

}  // namespace

Matrix3 InverseCurvature(const World& world, const Scene& scene, const ContactPoint& p) {
  const Vector3 normal = p.frame.row(0).transpose();
  const Matrix3 sum = Curvature(world, scene, p.body_a, p.geometry_a, p.point, normal) +
                      Curvature(world, scene, p.body_b, p.geometry_b, p.point, -normal);
  const Eigen::Matrix<double, 2, 3> tangents = p.frame.bottomRows<2>();
  const SymmetricSpectrum bends = SpectrumOf(tangents * sum * tangents.transpose());
  Matrix3 inverse = Matrix3::Zero();
  for (int i = 0; i < 2; ++i) {
    constexpr double kFlat = 1e-3;  // 1/m: radii of a kilometre
    if (bends.values(i) < kFlat) continue;
    const Vector3 d = tangents.transpose() * bends.vectors.col(i);
    inverse += d * d.transpose() / bends.values(i);
  }
  return inverse;
}

}  // namespace fork1s
