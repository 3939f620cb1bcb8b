#include <fork1s/mechanism/kinematics.hpp>

#include "rotation_block.hpp"

namespace fork1s {
namespace {

Matrix6 InertiaInRoot(const Mechanism& mechanism, const Kinematics& kinematics, std::size_t b) {
  return Transform(kinematics.X_RB[b], mechanism.bodies()[b].inertia_B).Matrix();
}

// Inertia of each body together with all that it carries, in R about R's origin.
void CompositeInertia(const Mechanism& mechanism, const Kinematics& kinematics,
                      std::vector<Matrix6>& composite) {
  const auto& bodies = mechanism.bodies();
  composite.resize(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) composite[b] = InertiaInRoot(mechanism, kinematics, b);
  for (std::size_t b = bodies.size(); b-- > 1;) composite[bodies[b].parent.u()] += composite[b];
}

// (d/dt dexp(x)) ẋ for x = S q of one joint, in its own frame. Central difference along ẋ: dexp is smooth on
// the scale of a radian, so the step leaves 1e-9 of truncation and less of rounding.
Vector6 DexpRate(const Mechanism& mechanism, const Mechanism::Joint& joint, const VectorX& q,
                 const VectorX& q_dot) {
  const auto S = mechanism.screws().middleCols(joint.offset, joint.size);
  Vector6 x = Vector6::Zero(), x_dot = Vector6::Zero();
  for (int i = 0; i < joint.size; ++i) {
    x += S.col(i) * q(joint.offset + i);
    x_dot += S.col(i) * q_dot(joint.offset + i);
  }
  const double speed = x_dot.norm();
  if (speed == 0) return Vector6::Zero();
  const double step = 1e-4 / speed;
  return (Dexp(x + step * x_dot) - Dexp(x - step * x_dot)) * x_dot / (2 * step);
}

void FillMassMatrix(const Mechanism& mechanism, const Kinematics& kinematics,
                    const std::vector<Matrix6>& composite, MatrixX& M) {
  const int n = mechanism.num_coordinates();
  M.setZero(n, n);
  for (const Mechanism::Joint& joint : mechanism.joints())
    for (int c = joint.offset; c < joint.offset + joint.size; ++c) {
      const Vector6 F = composite[joint.body.u()] * kinematics.S.col(c);
      for (int i = joint.offset; i < joint.offset + joint.size; ++i) M(i, c) = kinematics.S.col(i).dot(F);
      for (int j = joint.previous; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
        const Mechanism::Joint& above = mechanism.joint(JointIndex(j));
        for (int i = above.offset; i < above.offset + above.size; ++i)
          M(c, i) = M(i, c) = kinematics.S.col(i).dot(F);
      }
    }
  M.diagonal() += mechanism.armature();
  for (const Mechanism::Rotation& rotation : mechanism.rotations())
    internal::AddRotationBlock(mechanism, kinematics, rotation, mechanism.armature(), M);
}

}  // namespace

void MassMatrix(const Mechanism& mechanism, const Kinematics& kinematics, MatrixX& M) {
  std::vector<Matrix6> composite;
  CompositeInertia(mechanism, kinematics, composite);
  FillMassMatrix(mechanism, kinematics, composite, M);
}

void BaseInertia(const Mechanism& mechanism, const Kinematics& kinematics, Matrix6& M_00, Matrix6X& M_0q) {
  std::vector<Matrix6> composite;
  CompositeInertia(mechanism, kinematics, composite);
  M_00 = composite[0];
  M_0q.resize(6, mechanism.num_coordinates());
  for (const Mechanism::Joint& joint : mechanism.joints())
    M_0q.middleCols(joint.offset, joint.size).noalias() =
        composite[joint.body.u()] * kinematics.S.middleCols(joint.offset, joint.size);
}

void SubtractVelocityWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                              const Vector6& V_R, const VectorX& q_dot, const VectorX& q_ddot, Matrix6X& V,
                              Matrix6X& A, Matrix6X& F) {
  const auto& bodies = mechanism.bodies();
  const auto& joints = mechanism.joints();
  // Twists and accelerations in R about R's origin. Relative to R the screws move with their parent's
  // relative twist; R itself moves by ξ, which adds ξ x V.
  V.col(0).setZero();
  A.col(0).setZero();
  std::size_t j = 0;
  for (std::size_t b = 1; b < bodies.size(); ++b) {
    Vector6 v = V.col(bodies[b].parent.value());
    Vector6 a = A.col(bodies[b].parent.value());
    for (; j < joints.size() && joints[j].body.u() == b; ++j) {
      Vector6 rate = Vector6::Zero();
      for (int i = joints[j].offset; i < joints[j].offset + joints[j].size; ++i) {
        rate += kinematics.S.col(i) * q_dot(i);
        a += kinematics.S.col(i) * q_ddot(i);
      }
      a += Bracket(v, rate);
      if (joints[j].size > 1) {
        const RigidTransform before = joints[j].previous < 0
                                          ? RigidTransform()
                                          : kinematics.P[static_cast<std::size_t>(joints[j].previous)];
        a += AdjointApply(before, DexpRate(mechanism, joints[j], q, q_dot));
      }
      v += rate;
    }
    V.col(static_cast<Eigen::Index>(b)) = v;
    A.col(static_cast<Eigen::Index>(b)) = a;
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const SpatialInertia& I = bodies[b].inertia_B;
    const RigidTransform& X = kinematics.X_RB[b];
    const auto column = static_cast<Eigen::Index>(b);
    const Vector6 v = V_R + V.col(column);
    const Vector6 a = A.col(column) + Bracket(V_R, v);
    const Vector3 c = X * I.center;
    const Matrix3& R = X.rotation();
    auto times_inertia = [&](const Vector6& x) {
      Vector6 h;
      h.tail<3>() = I.mass * (x.tail<3>() + x.head<3>().cross(c));
      h.head<3>() = R * (I.rotational * (R.transpose() * x.head<3>())) + c.cross(Vector3(h.tail<3>()));
      return h;
    };
    const Vector6 h = times_inertia(v);
    const Vector6 Ia = times_inertia(a);
    const Vector3 w = v.head<3>(), u = v.tail<3>(), L = h.head<3>(), p = h.tail<3>();
    F.col(column).head<3>() -= Ia.head<3>() + w.cross(L) + u.cross(p);
    F.col(column).tail<3>() -= Ia.tail<3>() + w.cross(p);
  }
}

void SubtractRigidMotionWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const Vector6& V_R,
                                 const Vector6& A_R, Matrix6X& F) {
  const Vector3 w = V_R.head<3>(), v = V_R.tail<3>();
  const auto& bodies = mechanism.bodies();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const SpatialInertia& I = bodies[b].inertia_B;
    const RigidTransform& X = kinematics.X_RB[b];
    const Vector3 c = X * I.center;
    auto times_inertia = [&](const Vector6& x, Vector3& angular, Vector3& linear) {
      linear = I.mass * (x.tail<3>() + x.head<3>().cross(c));
      angular = X.rotation() * (I.rotational * (X.rotation().transpose() * x.head<3>())) + c.cross(linear);
    };
    Vector3 L, p, torque, force;
    times_inertia(V_R, L, p);
    times_inertia(A_R, torque, force);
    const auto column = static_cast<Eigen::Index>(b);
    F.col(column).head<3>() -= torque + w.cross(L) + v.cross(p);
    F.col(column).tail<3>() -= force + w.cross(p);
  }
}

void ApplyMass(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& x, VectorX& Mx) {
  const auto& bodies = mechanism.bodies();
  Matrix6X V = Matrix6X::Zero(6, static_cast<Eigen::Index>(bodies.size()));
  std::size_t j = 0;
  const auto& joints = mechanism.joints();
  for (std::size_t b = 1; b < bodies.size(); ++b) {
    Vector6 twist = V.col(bodies[b].parent.value());
    for (; j < joints.size() && joints[j].body.u() == b; ++j)
      for (int i = joints[j].offset; i < joints[j].offset + joints[j].size; ++i)
        twist += kinematics.S.col(i) * x(i);
    V.col(static_cast<Eigen::Index>(b)) = twist;
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    // Momentum [L; p] of the body about R's origin.
    const SpatialInertia& I = bodies[b].inertia_B;
    const RigidTransform& X = kinematics.X_RB[b];
    const auto column = static_cast<Eigen::Index>(b);
    const Vector3 w = V.col(column).head<3>();
    const Vector3 c = X * I.center;
    const Vector3 p = I.mass * (V.col(column).tail<3>() + w.cross(c));
    const Vector3 w_B = X.rotation().transpose() * w;
    V.col(column).head<3>() = X.rotation() * (I.rotational * w_B) + c.cross(p);
    V.col(column).tail<3>() = p;
  }
  ComputeJointVelocities(mechanism, kinematics, x, Mx);
  Mx = mechanism.armature().cwiseProduct(Mx);
  ConvertToCoordinateForces(mechanism, kinematics, Mx);
  AccumulateGeneralizedForce(mechanism, kinematics.S, V, Mx);
}

}  // namespace fork1s
