// Angular velocity of joints with a rotation vector: docs/method.md, section 2.
//
// The present screws of the joint are those of θ̇ in R, so that with P the pose that the joint carries
//     ω_R = S_rot θ̇,   ω = W⁻¹ R_Pᵀ ω_R = E θ̇,   E = W⁻¹ R_Pᵀ S_rot
// and a force τ on ω is Eᵀ τ on θ.
#include <algorithm>
#include <fork1s/base/quad.hpp>
#include <fork1s/mechanism/kinematics.hpp>

#include "mechanism/periodic_rotation.hpp"

namespace fork1s {
namespace {

Vector3 Segment(const Mechanism::Rotation& rotation, const VectorX& x) {
  const auto& [a, b, c] = rotation.coordinates;
  return {x(a), x(b), x(c)};
}

void SetSegment(const Mechanism::Rotation& rotation, const Vector3& from, VectorX& x) {
  for (int i = 0; i < 3; ++i) x(rotation.coordinates[static_cast<std::size_t>(i)]) = from(i);
}

}  // namespace

bool IsPeriodic(const Mechanism& mechanism, const Mechanism::Joint& joint) {
  if (joint.kind != JointKind::kBall) return false;
  const auto is_of_joint = [&](int i) { return i >= joint.offset && i < joint.offset + joint.size; };
  const auto acts = [&](const Mechanism::LinearForm& terms) {
    return std::any_of(terms.begin(), terms.end(), [&](const auto& term) { return is_of_joint(term.first); });
  };
  const auto any_acts = [&](const auto& elements) {
    return std::any_of(elements.begin(), elements.end(), [&](const auto& e) { return acts(e.length.terms); });
  };
  // Lengths of muscles along a rotation count its turns (Mechanism::Path::rates).
  const auto flexes = [&](const MuscleDef& muscle) {
    return std::any_of(muscle.terms.begin(), muscle.terms.end(), [&](const auto& term) {
      return mechanism.joint(term.first.joint).offset == joint.offset;
    });
  };
  const auto& muscles = mechanism.definition().muscles;
  return mechanism.stiffness().segment(joint.offset, joint.size).isZero(0) &&
         std::none_of(muscles.begin(), muscles.end(), flexes) && !any_acts(mechanism.springs()) &&
         !any_acts(mechanism.controls()) && !any_acts(mechanism.length_limits()) &&
         !any_acts(mechanism.force_limits()) &&
         std::none_of(mechanism.couplings().begin(), mechanism.couplings().end(),
                      [&](const Mechanism::Coupling& c) {
                        const std::vector<int> all = c.Coordinates();
                        return std::any_of(all.begin(), all.end(), is_of_joint);
                      });
}

// The rows of W⁻¹ R_Pᵀ are the columns of R_P W⁻ᵀ, sums of columns of R_P.
Matrix3 AngularVelocityMap(const Mechanism&, const Kinematics& kinematics,
                           const Mechanism::Rotation& rotation) {
  const double* R = kinematics.P[rotation.joint.u()].data();
  const Matrix3& W_inverse = rotation.axes_inverse;
  const Quad x = QuadAt(R), y = QuadAt(R + 3), z = QuadAt(R + 6);
  Matrix3 E;
  for (int row = 0; row < 3; ++row) {
    const Quad axis = W_inverse(row, 0) * x + W_inverse(row, 1) * y + W_inverse(row, 2) * z;
    for (int i = 0; i < 3; ++i) {
      const double* s = kinematics.S.data() + 6 * rotation.coordinates[static_cast<std::size_t>(i)];
      E(row, i) = axis[0] * s[0] + axis[1] * s[1] + axis[2] * s[2];
    }
  }
  return E;
}

Matrix3 WeightedRotationBlock(const Mechanism& mechanism, const Kinematics& kinematics,
                              const Mechanism::Rotation& rotation, const VectorX& weights) {
  const Matrix3 E = AngularVelocityMap(mechanism, kinematics, rotation);
  const Vector3 w = Segment(rotation, weights);
  Matrix3 block;
  for (int i = 0; i < 3; ++i) {
    const Vector3 weighted = w.cwiseProduct(E.col(i));
    for (int k = 0; k <= i; ++k) block(i, k) = block(k, i) = weighted.dot(E.col(k));
  }
  return block;
}

void ComputeJointVelocities(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q_dot,
                            VectorX& nu) {
  nu = q_dot;
  for (const Mechanism::Rotation& rotation : mechanism.rotations())
    SetSegment(rotation, AngularVelocityMap(mechanism, kinematics, rotation) * Segment(rotation, q_dot), nu);
}

// Ė θ̇ by a central difference along θ̇: E is smooth on the scale of a radian, so the step truncates 1e-9 and rounds less.
void ComputeJointAccelerations(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                               const VectorX& q_dot, const VectorX& q_ddot, VectorX& nu_dot) {
  nu_dot = q_ddot;
  for (const Mechanism::Rotation& rotation : mechanism.rotations()) {
    Vector3 rate = AngularVelocityMap(mechanism, kinematics, rotation) * Segment(rotation, q_ddot);
    const Vector3 x = rotation.axes * Segment(rotation, q), x_dot = rotation.axes * Segment(rotation, q_dot);
    if (const double speed = x_dot.norm(); speed > 0) {
      const double step = 1e-4 / speed;  // s
      // The right Jacobian is the left one of the opposite rotation.
      rate += rotation.axes_inverse *
              ((DexpRotation(-x - step * x_dot) - DexpRotation(-x + step * x_dot)) * x_dot) / (2 * step);
    }
    SetSegment(rotation, rate, nu_dot);
  }
}

void SubtractArmatureForces(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                            const VectorX& q_dot, const VectorX& q_ddot, VectorX& tau) {
  VectorX inertial;
  ComputeJointAccelerations(mechanism, kinematics, q, q_dot, q_ddot, inertial);
  inertial = mechanism.armature().cwiseProduct(inertial);
  ConvertToCoordinateForces(mechanism, kinematics, inertial);
  tau -= inertial;
}

void ConvertToCoordinateForces(const Mechanism& mechanism, const Kinematics& kinematics, VectorX& f) {
  for (const Mechanism::Rotation& rotation : mechanism.rotations())
    SetSegment(rotation,
               AngularVelocityMap(mechanism, kinematics, rotation).transpose() * Segment(rotation, f), f);
}

}  // namespace fork1s
