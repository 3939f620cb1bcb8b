#include "joint_curvature.hpp"
#include "spatial/twist_exponential.hpp"

namespace fork1s::internal {
namespace {

// Central differences of smooth functions of angles of order 1: off by some 1e-10.
constexpr double kTurn = 1e-5;  // rad

// Dexp(x) s
Vector6 Turned(const Vector6& x, const Vector6& s) {
  Quad angular, linear;
  TwistExponential(x).Apply(s.data(), angular, linear);
  Vector6 out;
  out << angular.head<3>(), linear.head<3>();
  return out;
}

}  // namespace

// With L_i = Dexp(x) s_i the derivative of Exp(x), x = Σ s_i q_i, along q_i, the second derivative of its
// logarithm seen from the pose at hand is the symmetric part of ∂L_i/∂q_k. Two screws one after the other
// have ½ L_a x L_b.
std::vector<JointCurvature> JointCurvatures(const Mechanism& mechanism, const Kinematics& kinematics,
                                            const VectorX& q) {
  std::vector<JointCurvature> out;
  for (const Mechanism::Joint& joint : mechanism.joints()) {
    if (joint.size == 1) continue;
    const auto s = mechanism.screws().middleCols(joint.offset, joint.size);
    const Vector6 x = s * q.segment(joint.offset, joint.size);
    const RigidTransform X_up =
        joint.previous < 0 ? RigidTransform() : kinematics.P[static_cast<std::size_t>(joint.previous)];
    const auto slope = [&](int i, int k) {
      return Vector6((Turned(x + kTurn * s.col(k), s.col(i)) - Turned(x - kTurn * s.col(k), s.col(i))) /
                     (2 * kTurn));
    };
    for (int b = 0; b < joint.size; ++b)
      for (int a = 0; a <= b; ++a) {
        Vector6 second = AdjointApply(X_up, 0.5 * (slope(a, b) + slope(b, a)));
        const int i = joint.offset + a, k = joint.offset + b;
        if (a < b) second -= 0.5 * Bracket(kinematics.S.col(i), kinematics.S.col(k));
        out.push_back({i, k, second});
      }
  }
  return out;
}

// E = W⁻¹ J_r(W θ) W with the right Jacobian of the exponential, the left one at -W θ.
Matrix3 TurnOfVelocityMap(const Mechanism::Rotation& rotation, const VectorX& q, int c) {
  Vector3 theta;
  for (int i = 0; i < 3; ++i) theta(i) = q(rotation.coordinates[static_cast<std::size_t>(i)]);
  const auto E = [&](double step) {
    const Vector3 at = theta + step * Vector3::Unit(c);
    return Matrix3(rotation.axes_inverse * DexpRotation(-rotation.axes * at) * rotation.axes);
  };
  return (E(kTurn) - E(-kTurn)) / (2 * kTurn);
}

}  // namespace fork1s::internal
