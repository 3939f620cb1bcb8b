// hinge, slide: q = position - reference.  ball: exp(q) = quat0⁻¹ quat.  free joint below a base: q = [p_RB - p_RB0; θ]
// with exp(θ) = R_RB0ᵀ R_RB, its position and rotation.
#include <fmt/format.h>

#include <fork1s/importer/file_state.hpp>

namespace fork1s {
namespace {

using Kind = FileJoint::Kind;

Quaternion ReadQuaternion(const double* w_x_y_z) {
  return Quaternion(w_x_y_z[0], w_x_y_z[1], w_x_y_z[2], w_x_y_z[3]).normalized();
}

// Of the two quaternions of a rotation the one with w >= 0.
void WriteQuaternion(const Quaternion& turn, double* w_x_y_z) {
  const double sign = turn.w() < 0 ? -1 : 1;
  w_x_y_z[0] = sign * turn.w();
  for (int i = 0; i < 3; ++i) w_x_y_z[1 + i] = sign * turn.vec()(i);
}

// A free joint's positions are a pose in the world, its velocities [of the origin in world axes; ω in body axes].
RigidTransform FreePose(const double* positions) {
  return {ReadQuaternion(positions + 3), Vector3(positions[0], positions[1], positions[2])};
}
Vector6 FreeTwist(const RigidTransform& X_WB, const double* velocities) {
  Vector6 V_B;
  V_B << Vector3(velocities + 3), X_WB.rotation().transpose() * Vector3(velocities);
  return V_B;
}

void WriteFree(const RigidTransform& X_WB, const Vector6& V_B, double* positions, double* velocities) {
  Eigen::Map<Vector3>{positions} = X_WB.translation();
  WriteQuaternion(X_WB.quaternion(), positions + 3);
  Eigen::Map<Vector3>{velocities} = X_WB.rotation() * V_B.tail<3>();
  Eigen::Map<Vector3>{velocities + 3} = V_B.head<3>();
}

// Pose of a body in the frame of the base at the reference.
RigidTransform ReferencePose(const MechanismDef& mechanism, int body) {
  RigidTransform X_RB0;
  for (BodyIndex b(body); mechanism.bodies[b.u()].parent.valid(); b = mechanism.bodies[b.u()].parent)
    X_RB0 = mechanism.bodies[b.u()].X_PB * X_RB0;
  return X_RB0;
}

void WriteJoint(const FileJoint& joint, const MechanismDef& mechanism,
                const KeyframeDef::MechanismState& state, double* positions, double* velocities) {
  const int at = joint.coordinate;
  switch (joint.kind) {
    case Kind::kFree: {
      const RigidTransform X_RB0 = ReferencePose(mechanism, joint.body);
      if (at < 0)
        return WriteFree(state.X_WR * X_RB0, AdjointApply(X_RB0.inverse(), state.V_R), positions, velocities);
      const Vector3 phi = state.q.segment<3>(at + 3);
      const RigidTransform X_RB(X_RB0.rotation() * ExpRotation(phi),
                                X_RB0.translation() + state.q.segment<3>(at));
      Vector6 V_B;  // relative to the base
      V_B << DexpRotation(-phi) * state.q_dot.segment<3>(at + 3),
          X_RB.rotation().transpose() * state.q_dot.segment<3>(at);
      return WriteFree(state.X_WR * X_RB, V_B + AdjointApply(X_RB.inverse(), state.V_R), positions,
                       velocities);
    }
    case Kind::kBall: {
      const Vector3 phi = state.q.segment<3>(at);
      WriteQuaternion(ReadQuaternion(joint.reference.data()) * Quaternion(ExpRotation(phi)), positions);
      // ω_B = dexp(-φ) φ̇.
      Eigen::Map<Vector3>{velocities} = DexpRotation(-phi) * state.q_dot.segment<3>(at);
      return;
    }
    case Kind::kSlide:
    case Kind::kHinge:
      positions[0] = joint.reference[0] + state.q(at);
      velocities[0] = state.q_dot(at);
  }
}

void ReadJoint(const FileJoint& joint, const MechanismDef& mechanism, const double* positions,
               const double* velocities, KeyframeDef::MechanismState& state) {
  const int at = joint.coordinate;
  switch (joint.kind) {
    case Kind::kFree: {
      const RigidTransform X_RB0 = ReferencePose(mechanism, joint.body);
      const RigidTransform X_WB = FreePose(positions), X_RB = state.X_WR.inverse() * X_WB;
      const Vector3 phi = LogRotation(X_RB0.rotation().transpose() * X_RB.rotation());
      const Vector6 V_B = FreeTwist(X_WB, velocities) - AdjointApply(X_RB.inverse(), state.V_R);
      state.q.segment<6>(at) << X_RB.translation() - X_RB0.translation(), phi;
      state.q_dot.segment<6>(at) << X_RB.rotation() * V_B.tail<3>(),
          DexpInverseRotation(-phi) * V_B.head<3>();
      return;
    }
    case Kind::kBall: {
      const Quaternion turn =
          (ReadQuaternion(joint.reference.data()).conjugate() * ReadQuaternion(positions)).normalized();
      const Vector3 phi = LogRotation(turn.toRotationMatrix());
      state.q.segment<3>(at) = phi;
      state.q_dot.segment<3>(at) = DexpInverseRotation(-phi) * Vector3(velocities);
      return;
    }
    case Kind::kSlide:
    case Kind::kHinge:
      state.q(at) = positions[0] - joint.reference[0];
      state.q_dot(at) = velocities[0];
  }
}

bool MovesBase(const FileJoint& joint) {
  return joint.mechanism >= 0 && joint.coordinate < 0 && joint.body == 0;
}

struct Sizes {
  int positions = 0, velocities = 0;
};
Sizes SizesOf(const std::vector<FileJoint>& joints) {
  Sizes sizes;
  for (const FileJoint& joint : joints) {
    sizes.positions += joint.num_positions();
    sizes.velocities += joint.num_velocities();
  }
  return sizes;
}

Expected<void> Check(const std::vector<FileJoint>& joints, const FileState& given) {
  const auto [nq, nv] = SizesOf(joints);
  for (const auto& [name, values, count] :
       {std::tuple{"qpos", &given.positions, nq}, std::tuple{"qvel", &given.velocities, nv}}) {
    if (values->size() != count)
      return Fail(ErrorCode::kUsage, name,
                  fmt::format("has {} numbers; the joints of the file have {}", values->size(), count));
    if (!values->allFinite())
      return Fail(ErrorCode::kUsage, name, "has a number that is not finite; give finite numbers");
  }
  int at = 0;
  for (const FileJoint& joint : joints) {
    if (joint.kind == Kind::kFree || joint.kind == Kind::kBall) {
      const auto turn = given.positions.segment<4>(at + (joint.kind == Kind::kFree ? 3 : 0));
      if (!(turn.norm() > 0))
        return Fail(ErrorCode::kUsage, fmt::format("qpos of joint '{}'", joint.name),
                    "has a quaternion of length 0; give w x y z, (1, 0, 0, 0) for no rotation");
    }
    at += joint.num_positions();
  }
  return {};
}

}  // namespace

std::vector<FileJoint> MovingJoints(const std::vector<FileJoint>& joints, const Scene& scene) {
  std::vector<FileJoint> moving;
  for (const FileJoint& joint : joints) {
    const bool floats =
        MovesBase(joint) &&
        scene.mechanisms[static_cast<std::size_t>(joint.mechanism)].base == BaseKind::kFloating;
    if (joint.free_body >= 0 || joint.coordinate >= 0 || floats) moving.push_back(joint);
  }
  return moving;
}

FileState ComputeFileState(const std::vector<FileJoint>& joints, const Scene& scene,
                           const KeyframeDef& state) {
  const auto [nq, nv] = SizesOf(joints);
  FileState out{VectorX(nq), VectorX(nv)};
  double *positions = out.positions.data(), *velocities = out.velocities.data();
  for (const FileJoint& joint : joints) {
    if (joint.free_body >= 0) {
      const KeyframeDef::FreeBodyState& s = state.free_bodies[static_cast<std::size_t>(joint.free_body)];
      const Matrix3 R_BW = s.X_WB.rotation().transpose();
      Vector6 V_B;
      V_B << R_BW * s.omega_W, R_BW * s.velocity_W;
      WriteFree(s.X_WB, V_B, positions, velocities);
    } else {
      const auto i = static_cast<std::size_t>(joint.mechanism);
      WriteJoint(joint, scene.mechanisms[i], state.mechanisms[i], positions, velocities);
    }
    positions += joint.num_positions();
    velocities += joint.num_velocities();
  }
  return out;
}

Expected<void> ApplyFileState(const std::vector<FileJoint>& joints, const Scene& scene,
                              const FileState& given, KeyframeDef& state) {
  if (auto fits = Check(joints, given); !fits) return fits;
  // Bases first: free joints below them count from their pose.
  for (const bool bases : {true, false}) {
    const double *positions = given.positions.data(), *velocities = given.velocities.data();
    for (const FileJoint& joint : joints) {
      if (MovesBase(joint) == bases) {
        if (joint.free_body >= 0) {
          KeyframeDef::FreeBodyState& s = state.free_bodies[static_cast<std::size_t>(joint.free_body)];
          s.X_WB = FreePose(positions);
          s.omega_W = s.X_WB.rotation() * Vector3(velocities + 3);
          s.velocity_W = Vector3(velocities);
        } else {
          const auto i = static_cast<std::size_t>(joint.mechanism);
          KeyframeDef::MechanismState& s = state.mechanisms[i];
          if (bases) {
            s.X_WR = FreePose(positions);
            if (scene.mechanisms[i].base == BaseKind::kFloating) s.V_R = FreeTwist(s.X_WR, velocities);
          } else if (joint.coordinate >= 0) {
            ReadJoint(joint, scene.mechanisms[i], positions, velocities, s);
          }
        }
      }
      positions += joint.num_positions();
      velocities += joint.num_velocities();
    }
  }
  return {};
}

}  // namespace fork1s
