#include <fork1s/mechanism/kinematics.hpp>

#include <cmath>

#include "paths.hpp"

namespace fork1s {
namespace {

// Exp of a single screw s times q. Unit and zero rotation axes, all that hinges and slides need, skip the
// general map's square roots.
RigidTransform ExpScrew(const Vector6& s, double q) {
  const Vector3 w = s.head<3>();
  const Vector3 v = s.tail<3>();
  const double w2 = w.squaredNorm();
  if (w2 == 0) return RigidTransform(Vector3(v * q));
  if (std::abs(w2 - 1) > 1e-14) return Exp(s * q);
  // By the half angle, as 1 - cos needs it; one sine and cosine serve both.
  const double half = std::sin(0.5 * q);
  const double sine = 2 * half * std::cos(0.5 * q);
  const double versine = 2 * half * half;
  Matrix3 R;
  const double wx = w.x(), wy = w.y(), wz = w.z();
  const double c = 1 - versine;
  R << c + wx * wx * versine, wx * wy * versine - wz * sine, wx * wz * versine + wy * sine,
      wx * wy * versine + wz * sine, c + wy * wy * versine, wy * wz * versine - wx * sine,
      wx * wz * versine - wy * sine, wy * wz * versine + wx * sine, c + wz * wz * versine;
  const Vector3 wv = w.cross(v);
  return {R, Vector3(q * v + versine * wv + (q - sine) * w.cross(wv))};
}

}  // namespace

Kinematics::Kinematics(const Mechanism& mechanism)
    : P(static_cast<std::size_t>(mechanism.num_joints())),
      X_RB(static_cast<std::size_t>(mechanism.num_bodies())),
      S(mechanism.screws()),
      paths(mechanism.paths().size()) {
  for (std::size_t i = 0; i < paths.size(); ++i)
    for (const int coordinate : mechanism.paths()[i].coordinates) paths[i].arms.emplace_back(coordinate, 0.0);
}

void ComputeKinematics(const Mechanism& mechanism, const VectorX& q, Kinematics& out) {
  const Matrix6X& screws = mechanism.screws();
  const auto& joints = mechanism.joints();
  const RigidTransform identity;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Mechanism::Joint& joint = joints[j];
    const RigidTransform& before =
        joint.previous < 0 ? identity : out.P[static_cast<std::size_t>(joint.previous)];
    if (joint.size == 1) {
      const Vector6 s = screws.col(joint.offset);
      out.S.col(joint.offset) = AdjointApply(before, s);
      out.P[j] = before * ExpScrew(s, q(joint.offset));
    } else {
      const auto S = screws.middleCols(joint.offset, joint.size);
      Vector6 x = Vector6::Zero();
      for (int i = 0; i < joint.size; ++i) x += S.col(i) * q(joint.offset + i);
      const Matrix6 D = Dexp(x);
      for (int i = 0; i < joint.size; ++i)
        out.S.col(joint.offset + i) = AdjointApply(before, Vector6(D * S.col(i)));
      out.P[j] = before * Exp(x);
    }
  }
  const auto& bodies = mechanism.bodies();
  for (std::size_t b = 0; b < bodies.size(); ++b)
    out.X_RB[b] = bodies[b].last_joint < 0
                      ? bodies[b].X_RB0
                      : out.P[static_cast<std::size_t>(bodies[b].last_joint)] * bodies[b].X_RB0;
  for (std::size_t i = 0; i < out.paths.size(); ++i)
    internal::ComputePath(mechanism, mechanism.paths()[i], out, out.paths[i]);
}

Matrix6X BodyJacobian(const Mechanism& mechanism, const Kinematics& kinematics, BodyIndex b) {
  Matrix6X J = Matrix6X::Zero(6, mechanism.num_coordinates());
  for (int j = mechanism.body(b).last_joint; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
    const auto& joint = mechanism.joint(JointIndex(j));
    J.middleCols(joint.offset, joint.size) = kinematics.S.middleCols(joint.offset, joint.size);
  }
  return J;
}

void AccumulateGeneralizedForce(const Mechanism& mechanism, const Matrix6X& S, Matrix6X& F, VectorX& tau) {
  const auto& bodies = mechanism.bodies();
  const auto& joints = mechanism.joints();
  // Joints are sorted by body, so both tables are walked backwards together.
  std::size_t j = joints.size();
  for (std::size_t b = bodies.size(); b-- > 1;) {
    const auto column = static_cast<Eigen::Index>(b);
    for (; j > 0 && joints[j - 1].body.u() == b; --j) {
      const Mechanism::Joint& joint = joints[j - 1];
      for (int i = 0; i < joint.size; ++i)
        tau(joint.offset + i) += S.col(joint.offset + i).dot(F.col(column));
    }
    F.col(bodies[b].parent.value()) += F.col(column);
  }
}

void AddGravityWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const Vector3& g_R,
                        Matrix6X& F) {
  const auto& bodies = mechanism.bodies();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].weighed_mass == 0) continue;
    const Vector3 weight = bodies[b].weighed_mass * g_R;
    const auto column = static_cast<Eigen::Index>(b);
    F.col(column).head<3>() += (kinematics.X_RB[b] * bodies[b].inertia_B.center).cross(weight);
    F.col(column).tail<3>() += weight;
  }
}

}  // namespace fork1s
