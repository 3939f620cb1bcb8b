#include "reduction/point_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/reduction/free_motion.hpp>
#include <limits>

#include "linalg/products.hpp"

namespace fork1s {
namespace {

constexpr double kStillPoint = 1e-6;  // rounding of a null space at its worst, beside motions near 1

// From the body's origin, world axes.
Vector3 ArmTo(const Mechanism& mechanism, const VectorX& q, const BodyPoint& point) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  return mechanism.definition().X_WR.rotation() * (kinematics.X_RB[point.body.u()].rotation() * point.p_B);
}

// On the motions that move the point, less those that locked coordinates hold.
std::vector<std::string> Sentences(const Mechanism& mechanism, const std::vector<FreeMotion>& motions,
                                   const Vector3& arm, const std::vector<int>& locked) {
  std::vector<std::string> sentences;
  for (const FreeMotion& motion : motions) {
    const Vector3 moved = motion.twist.tail<3>() + motion.twist.head<3>().cross(arm);
    const bool is_locked = std::find(locked.begin(), locked.end(), motion.pivot) != locked.end();
    if (!is_locked && moved.norm() > kStillPoint * (mechanism.length_scale() + arm.norm()))
      sentences.push_back(motion.Text(mechanism));
  }
  return sentences;
}

}  // namespace

double PointStiffness::Along(const Vector3& direction_W) const {
  const Vector3 d = direction_W.normalized();
  const MatrixX& F = compliance.free;
  const double moved = F.cols() > 0 ? (d.transpose() * F.bottomRows(3)).cwiseAbs().maxCoeff() : 0;
  const double largest = F.cols() > 0 ? F.bottomRows(3).colwise().norm().maxCoeff() : 0;
  if (moved > kStillPoint * std::max(largest, length)) return 0;
  const auto& C = compliance.C;
  const double yields = d.dot(C.bottomRightCorner(3, 3) * d);
  const VectorX diagonal = C.diagonal().cwiseAbs();
  const double softest = std::max(diagonal.head(3).maxCoeff() * length * length, diagonal.tail(3).maxCoeff());
  if (compliance.rank == 0 || std::abs(yields) <= kStillPoint * kStillPoint * softest)
    return std::numeric_limits<double>::infinity();
  return 1 / yields;
}

PointStiffness ComputeSpringStiffness(const Mechanism& mechanism, const VectorX& q, const BodyPoint& point,
                                      const std::vector<int>& locked) {
  const Vector3 arm = ArmTo(mechanism, q, point);
  Matrix6 to_point = Matrix6::Identity();
  to_point.bottomLeftCorner<3, 3>() = -Skew(arm);
  PointStiffness out{WalkCompliance(mechanism, q, {point.body}, locked), {}, mechanism.length_scale()};
  out.compliance.C = to_point * out.compliance.C * to_point.transpose();
  out.compliance.free = to_point * out.compliance.free;
  out.free = Sentences(mechanism, FindFreeMotions(mechanism, q, {point.body}), arm, locked);
  return out;
}

PointStiffness ComputePointStiffness(const Mechanism& mechanism, const VectorX& q,
                                     const TangentStiffness& tangent, const BodyPoint& point) {
  PointStiffness out{TangentCompliance(mechanism, q, tangent, {point}), {}, mechanism.length_scale()};
  out.free = Sentences(mechanism, FindSingularMotions(mechanism, q, tangent, {point.body}),
                       ArmTo(mechanism, q, point), {});
  return out;
}

}  // namespace fork1s
