#include "mechanism/rigid_parts.hpp"

#include <fork1s/base/quad.hpp>

namespace fork1s {
namespace {

const RigidTransform kPoseOfBase;

const RigidTransform& PoseOf(const Kinematics& kinematics, std::size_t part) {
  return part == 0 ? kPoseOfBase : kinematics.P[part - 1];
}

using Lanes = Eigen::Array4d;

// Vectors of four parts.
struct LaneVectors {
  Lanes x, y, z;
};

inline Lanes Dot(const LaneVectors& a, const LaneVectors& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

inline LaneVectors Cross(const LaneVectors& a, const LaneVectors& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

inline LaneVectors Times(const RigidParts::Four& I, const LaneVectors& a) {
  return {I.xx * a.x + I.xy * a.y + I.xz * a.z, I.xy * a.x + I.yy * a.y + I.yz * a.z,
          I.xz * a.x + I.yz * a.y + I.zz * a.z};
}

// ω of four parts after a time t: the iteration of TurnFreely (spatial_inertia.hpp), until all four have ended.
LaneVectors TurnFour(const RigidParts::Four& I, const LaneVectors& omega, double t) {
  LaneVectors next = omega;
  const double half = 0.5 * t;
  const Lanes least = 1e-12 * (I.xx + I.yy + I.zz);
  for (int i = 0; i < 8; ++i) {
    const LaneVectors mean{0.5 * (omega.x + next.x), 0.5 * (omega.y + next.y), 0.5 * (omega.z + next.z)};
    const LaneVectors spin = Times(I, mean), turn = Cross(mean, spin);
    LaneVectors residual = Times(I, {next.x - omega.x, next.y - omega.y, next.z - omega.z});
    residual.x += t * turn.x;
    residual.y += t * turn.y;
    residual.z += t * turn.z;
    // Rows of I + t/2 ([mean] I - [I mean]).
    const LaneVectors a{I.xx + least + half * (mean.y * I.xz - mean.z * I.xy),
                        I.xy + half * (mean.y * I.yz - mean.z * I.yy + spin.z),
                        I.xz + half * (mean.y * I.zz - mean.z * I.yz - spin.y)};
    const LaneVectors b{I.xy + half * (mean.z * I.xx - mean.x * I.xz - spin.z),
                        I.yy + least + half * (mean.z * I.xy - mean.x * I.yz),
                        I.yz + half * (mean.z * I.xz - mean.x * I.zz + spin.x)};
    const LaneVectors c{I.xz + half * (mean.x * I.xy - mean.y * I.xx + spin.y),
                        I.yz + half * (mean.x * I.yy - mean.y * I.xy - spin.x),
                        I.zz + least + half * (mean.x * I.yz - mean.y * I.xz)};
    const LaneVectors bc = Cross(b, c), ca = Cross(c, a), ab = Cross(a, b);
    const Lanes inverse = 1 / Dot(a, bc);
    const LaneVectors step{inverse * (bc.x * residual.x + ca.x * residual.y + ab.x * residual.z),
                           inverse * (bc.y * residual.x + ca.y * residual.y + ab.y * residual.z),
                           inverse * (bc.z * residual.x + ca.z * residual.y + ab.z * residual.z)};
    next = {next.x - step.x, next.y - step.y, next.z - step.z};
    if (((Dot(step, step) - 1e-28 * Dot(next, next)) < 1e-28).all()) break;
  }
  return next;
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
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const SpatialInertia& I = parts[i].inertia_R0;
    // The equation of a point's turn is empty.
    if (I.mass == 0 || I.rotational.isZero(0)) continue;
    if (turning.empty() || turning.back().count == 4) turning.emplace_back();
    Four& four = turning.back();
    const int end = four.count == 0 ? 4 : four.count + 1;  // the first stands in all lanes until others come
    for (int lane = four.count; lane < end; ++lane) {
      four.part[lane] = static_cast<int>(i);
      four.xx(lane) = I.rotational(0, 0);
      four.xy(lane) = I.rotational(0, 1);
      four.xz(lane) = I.rotational(0, 2);
      four.yy(lane) = I.rotational(1, 1);
      four.yz(lane) = I.rotational(1, 2);
      four.zz(lane) = I.rotational(2, 2);
    }
    ++four.count;
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
    const RigidTransform& X = PoseOf(kinematics, at);
    const Vector3 w = out.twist.col(i).head<3>();
    out.c_dot.col(i) = out.twist.col(i).tail<3>() + w.cross(X * parts.parts[at].inertia_R0.center);
    out.omega.col(i).noalias() = X.rotation().transpose() * w;
  }
}

void TurnFreely(const RigidParts& parts, double t, MaterialVelocities& v) {
  for (const RigidParts::Four& four : parts.turning) {
    LaneVectors omega;
    for (int lane = 0; lane < 4; ++lane) {
      const double* from = v.omega.data() + 3 * four.part[lane];
      omega.x(lane) = from[0];
      omega.y(lane) = from[1];
      omega.z(lane) = from[2];
    }
    omega = TurnFour(four, omega, t);
    for (int lane = 0; lane < four.count; ++lane) {
      double* to = v.omega.data() + 3 * four.part[lane];
      to[0] = omega.x(lane);
      to[1] = omega.y(lane);
      to[2] = omega.z(lane);
    }
  }
}

void AddMomentum(const RigidParts& parts, const Kinematics& kinematics, const MaterialVelocities& v,
                 const Matrix3& R_now_then, double factor, Matrix6X& F) {
  for (int i = 0; i < parts.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RigidParts::Part& part = parts.parts[at];
    if (part.inertia_R0.mass == 0) continue;
    const RigidTransform& X = PoseOf(kinematics, at);
    const Vector3 p = factor * part.inertia_R0.mass * (R_now_then * v.c_dot.col(i));
    const Vector3 spin = X.rotation() * (part.inertia_R0.rotational * v.omega.col(i));
    F.col(i).head<3>() += (X * part.inertia_R0.center).cross(p) + factor * spin;
    F.col(i).tail<3>() += p;
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
    const double* f = F.data() + 6 * (j + 1);
    const double* s = S.data() + 6 * joint.offset;
    for (int i = joint.offset; i < joint.offset + joint.size; ++i, s += 6)
      tau(i) += (s[0] * f[0] + s[1] * f[1] + s[2] * f[2]) + (s[3] * f[3] + s[4] * f[4] + s[5] * f[5]);
    double* before = F.data() + 6 * (joint.previous + 1);
    ByFours(6, [&](const auto& at) { at(before) += at(f); });
  }
}

}  // namespace fork1s
