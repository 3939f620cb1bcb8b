#include <fork1s/world/rolling.hpp>

#include <fork1s/world/contact_motion.hpp>
#include "detail.hpp"

namespace fork1s {

Matrix3 InverseCurvature(const World& world, const ContactPoint& p) {
  const auto pose = [&](int body) {
    const Contactor& c = world.contactors()[static_cast<std::size_t>(body)];
    const auto i = static_cast<std::size_t>(c.index);
    if (c.kind == Contactor::Kind::kFreeBody) return world.free_bodies()[i].pose();
    if (body == 0) return RigidTransform();  // the scene's own still geometry comes first
    return GroupPose(world.mechanisms()[i], c.group);
  };
  const Eigen::Matrix<double, 2, 3> tangents = p.frame.bottomRows<2>();
  const PairCurvature curvature = CurvatureOf(world.geometry(p.body_a, p.geometry_a), pose(p.body_a),
                                              world.geometry(p.body_b, p.geometry_b), pose(p.body_b), p);
  return tangents.transpose() * InverseOf(curvature).inverse * tangents;
}

}  // namespace fork1s
