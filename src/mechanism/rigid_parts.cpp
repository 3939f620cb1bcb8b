#include <fork1s/mechanism/rigid_parts.hpp>

namespace fork1s {
namespace {

RigidTransform PoseOf(const Kinematics& kinematics, std::size_t part) {
  return part == 0 ? RigidTransform() : kinematics.P[part - 1];
}

}  // namespace

RigidParts::RigidParts(const Mechanism& mechanism)
    : parts(static_cast<std::size_t>(mechanism.num_joints()) + 1) {
  // Σ = ∫ p pᵀ dm about R's origin: these add up.
  std::vector<Matrix3> about_origin(parts.size(), Matrix3::Zero());
  for (const Mechanism::Body& body : mechanism.bodies()) {
    const auto i = static_cast<std::size_t>(body.last_joint + 1);
    const SpatialInertia& I = body.inertia_R0;
    const Matrix3 central = 0.5 * I.rotational.trace() * Matrix3::Identity() - I.rotational;
    about_origin[i] += central + I.mass * I.center * I.center.transpose();
    parts[i].inertia_R0.mass += I.mass;
    parts[i].inertia_R0.center += I.mass * I.center;
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    SpatialInertia& I = parts[i].inertia_R0;
    if (I.mass > 0) I.center /= I.mass;
    const Matrix3 central = about_origin[i] - I.mass * I.center * I.center.transpose();
    I.rotational = central.trace() * Matrix3::Identity() - central;
  }
}

void ComputeMaterialVelocities(const Mechanism& mechanism, const RigidParts& parts,
                               const Kinematics& kinematics, const VectorX& q_dot, const Vector6& V_R,
                               MaterialVelocities& out) {
  out.c_dot.resize(3, parts.size());
  out.omega.resize(3, parts.size());
  out.twist.resize(6, parts.size());
  out.twist.col(0) = V_R;
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const Mechanism::Joint& joint = mechanism.joints()[static_cast<std::size_t>(j)];
    Vector6 V = out.twist.col(joint.previous + 1);
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) V += q_dot(i) * kinematics.S.col(i);
    out.twist.col(j + 1) = V;
  }
  for (int i = 0; i < parts.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (parts.parts[at].inertia_R0.mass == 0) {
      out.c_dot.col(i).setZero();
      out.omega.col(i).setZero();
      continue;
    }
    const RigidTransform X = PoseOf(kinematics, at);
    const Vector3 w = out.twist.col(i).head<3>();
    out.c_dot.col(i) = out.twist.col(i).tail<3>() + w.cross(X * parts.parts[at].inertia_R0.center);
    out.omega.col(i).noalias() = X.rotation().transpose() * w;
  }
}

void TurnFreely(const RigidParts& parts, double t, MaterialVelocities& v) {
  for (int i = 0; i < parts.size(); ++i) {
    const SpatialInertia& I = parts.parts[static_cast<std::size_t>(i)].inertia_R0;
    if (I.mass > 0) v.omega.col(i) = TurnFreely(I.rotational, v.omega.col(i), Vector3::Zero(), t);
  }
}

void SubtractFrom(const MaterialVelocities& y, const Matrix3& R_now_then, MaterialVelocities& x) {
  for (Eigen::Index i = 0; i < x.c_dot.cols(); ++i) {
    x.c_dot.col(i) = y.c_dot.col(i) - R_now_then * x.c_dot.col(i);
    x.omega.col(i) = y.omega.col(i) - x.omega.col(i);
  }
}

void AddMomentum(const RigidParts& parts, const Kinematics& kinematics, const MaterialVelocities& v,
                 const Matrix3& R_now_then, double factor, Matrix6X& F) {
  for (int i = 0; i < parts.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RigidParts::Part& part = parts.parts[at];
    if (part.inertia_R0.mass == 0) continue;
    const RigidTransform X = PoseOf(kinematics, at);
    const Vector3 p = factor * part.inertia_R0.mass * (R_now_then * v.c_dot.col(i));
    const Vector3 spin = X.rotation() * (part.inertia_R0.rotational * v.omega.col(i));
    F.col(i).head<3>() += (X * part.inertia_R0.center).cross(p) + factor * spin;
    F.col(i).tail<3>() += p;
  }
}

void OwnMomentum(const RigidParts& parts, const Kinematics& kinematics, const MaterialVelocities& v,
                 Matrix6X& F) {
  for (int i = 0; i < parts.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const SpatialInertia& I = parts.parts[at].inertia_R0;
    if (I.mass == 0) {
      F.col(i).setZero();
      continue;
    }
    F.col(i).head<3>().noalias() = PoseOf(kinematics, at).rotation() * (I.rotational * v.omega.col(i));
    F.col(i).tail<3>() = I.mass * v.c_dot.col(i);
  }
}

void CarryMomentum(const RigidParts& parts, const Kinematics& kinematics, const Matrix3& R_now_then,
                   Matrix6X& F) {
  for (int i = 0; i < parts.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const SpatialInertia& I = parts.parts[at].inertia_R0;
    if (I.mass == 0) continue;
    const Vector3 p = R_now_then * F.col(i).tail<3>(), spin = R_now_then * F.col(i).head<3>();
    F.col(i).head<3>() = spin + (PoseOf(kinematics, at) * I.center).cross(p);
    F.col(i).tail<3>() = p;
  }
}

Vector3 CenterOfParts(const RigidParts& parts, const Kinematics& kinematics) {
  Vector3 moment = Vector3::Zero();
  double mass = 0;
  for (std::size_t i = 0; i < parts.parts.size(); ++i) {
    const SpatialInertia& I = parts.parts[i].inertia_R0;
    if (I.mass == 0) continue;
    mass += I.mass;
    moment += I.mass * (PoseOf(kinematics, i) * I.center);
  }
  return moment / mass;
}

void GatherFromParts(const Mechanism& mechanism, const Matrix6X& S, Matrix6X& F, VectorX& tau) {
  for (int j = mechanism.num_joints(); j-- > 0;) {
    const Mechanism::Joint& joint = mechanism.joints()[static_cast<std::size_t>(j)];
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) tau(i) += S.col(i).dot(F.col(j + 1));
    F.col(joint.previous + 1) += F.col(j + 1);
  }
}

}  // namespace fork1s
