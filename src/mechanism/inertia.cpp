#include <fork1s/mechanism/kinematics.hpp>

namespace fork1s {
namespace {

Matrix6 InertiaInRoot(const Mechanism& mechanism, const Kinematics& kinematics, std::size_t b) {
  return Transform(kinematics.X_RB[b], mechanism.bodies()[b].inertia_B).Matrix();
}

// Inertia of each body together with all that it carries, in R about R's origin.
std::vector<Matrix6> CompositeInertia(const Mechanism& mechanism, const Kinematics& kinematics) {
  const auto& bodies = mechanism.bodies();
  std::vector<Matrix6> composite(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) composite[b] = InertiaInRoot(mechanism, kinematics, b);
  for (std::size_t b = bodies.size(); b-- > 1;) composite[bodies[b].parent.u()] += composite[b];
  return composite;
}

}  // namespace

void MassMatrix(const Mechanism& mechanism, const Kinematics& kinematics, MatrixX& M) {
  const int n = mechanism.num_coordinates();
  const auto composite = CompositeInertia(mechanism, kinematics);
  M.setZero(n, n);
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
    const auto columns = kinematics.S.middleCols(joint.offset, joint.size);
    const Matrix6X F = composite[joint.body.u()] * columns;
    M.block(joint.offset, joint.offset, joint.size, joint.size) = columns.transpose() * F;
    for (int i = joint.previous; i >= 0; i = mechanism.joint(JointIndex(i)).previous) {
      const Mechanism::Joint& above = mechanism.joint(JointIndex(i));
      M.block(above.offset, joint.offset, above.size, joint.size) =
          kinematics.S.middleCols(above.offset, above.size).transpose() * F;
      M.block(joint.offset, above.offset, joint.size, above.size) =
          M.block(above.offset, joint.offset, above.size, joint.size).transpose();
    }
  }
  M.diagonal() += mechanism.armature();
}

void BaseInertia(const Mechanism& mechanism, const Kinematics& kinematics, Matrix6& M_00, Matrix6X& M_0q) {
  const auto composite = CompositeInertia(mechanism, kinematics);
  M_00 = composite[0];
  M_0q.resize(6, mechanism.num_coordinates());
  for (const Mechanism::Joint& joint : mechanism.joints())
    M_0q.middleCols(joint.offset, joint.size).noalias() =
        composite[joint.body.u()] * kinematics.S.middleCols(joint.offset, joint.size);
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
  Mx = mechanism.armature().cwiseProduct(x);
  AccumulateGeneralizedForce(mechanism, kinematics.S, V, Mx);
}

}  // namespace fork1s
