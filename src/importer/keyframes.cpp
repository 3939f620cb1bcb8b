// Keyframes as displacements from the reference.
//
// hinge, slide: q = qpos - qpos0.  ball: exp(q) = quat0⁻¹ quat.  free joint below a base:
// Exp(q) = X_RB0⁻¹ X_RB in the axes of B, as all screws of B are given there.
#include <fmt/format.h>

#include <algorithm>

#include "conversion.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// A free joint's qpos is a pose in the world, its qvel [velocity in world axes; rotation in body axes].
RigidTransform FreePose(const mjtNum* qpos) { return {Quat(qpos + 3), Vec3(qpos)}; }
Vector6 FreeTwist(const RigidTransform& X_WB, const mjtNum* qvel) {
  Vector6 V_B;
  V_B << Vec3(qvel + 3), X_WB.rotation().transpose() * Vec3(qvel);
  return V_B;
}

struct BaseState {
  RigidTransform X_WR;
  Vector6 V_R = Vector6::Zero();
};

BaseState BaseAt(const Conversion& c, const Component& component, const MechanismDef& mechanism, int key) {
  const mjModel& m = c.m;
  BaseState state;
  state.X_WR = mechanism.X_WR;
  const int b = component.base_body;
  if (b == 0) return state;
  if (component.base == BaseKind::kFloating) {
    const int j = m.body_jntadr[b];
    state.X_WR = FreePose(m.key_qpos + key * m.nq + m.jnt_qposadr[j]);
    state.V_R = FreeTwist(state.X_WR, m.key_qvel + key * m.nv + m.jnt_dofadr[j]);
  } else if (m.body_mocapid[b] >= 0) {
    const auto i = key * m.nmocap + m.body_mocapid[b];
    state.X_WR = RigidTransform(Quat(m.key_mquat + 4 * i), Vec3(m.key_mpos + 3 * i));
  }
  return state;
}

void SetJoint(const Conversion& c, const MechanismDef& mechanism, const BaseState& base, int j, int key,
              int at, KeyframeDef::MechanismState& state) {
  const mjModel& m = c.m;
  const mjtNum* qpos = m.key_qpos + key * m.nq + m.jnt_qposadr[j];
  const mjtNum* qvel = m.key_qvel + key * m.nv + m.jnt_dofadr[j];
  const mjtNum* qpos0 = m.qpos0 + m.jnt_qposadr[j];
  switch (m.jnt_type[j]) {
    case mjJNT_BALL: {
      const Quaternion turn = (Quat(qpos0).conjugate() * Quat(qpos)).normalized();
      const Vector3 phi = LogRotation(turn.toRotationMatrix());
      state.q.segment<3>(at) = phi;
      // Body rate ω_B = dexp(-φ) φ̇.
      state.q_dot.segment<3>(at) = DexpInverseRotation(-phi) * Vec3(qvel);
      break;
    }
    case mjJNT_FREE: {
      const RigidTransform X_RB0 = mechanism.X_WR.inverse() * c.WorldPose(m.jnt_bodyid[j]);
      const RigidTransform X_WB = FreePose(qpos), X_RB = base.X_WR.inverse() * X_WB;
      const Vector6 x = Log(X_RB0.inverse() * X_RB);
      const Vector6 V_B = FreeTwist(X_WB, qvel) - AdjointApply(X_RB.inverse(), base.V_R);
      state.q.segment<6>(at) = x;
      state.q_dot.segment<6>(at) = DexpInverse(Vector6(-x)) * V_B;
      break;
    }
    default:
      state.q[at] = qpos[0] - qpos0[0];
      state.q_dot[at] = qvel[0];
  }
}

KeyframeDef::MechanismState MechanismAt(const Conversion& c, const Component& component, int index, int key) {
  const MechanismDef& mechanism = c.scene.mechanisms[index];
  const mjModel& m = c.m;
  const BaseState base = BaseAt(c, component, mechanism, key);
  KeyframeDef::MechanismState state;
  state.X_WR = base.X_WR;
  state.V_R = mechanism.base == BaseKind::kFloating ? base.V_R : Vector6::Zero();
  std::vector<int> offset;
  int n = 0;
  for (const JointDef& joint : mechanism.joints) {
    offset.push_back(n);
    n += static_cast<int>(joint.freedoms.size());
  }
  state.q = VectorX::Zero(n);
  state.q_dot = VectorX::Zero(n);
  for (int j = 0; j < m.njnt; ++j) {
    if (c.joint[j].mechanism == index)
      SetJoint(c, mechanism, base, j, key, offset[c.joint[j].joint.u()], state);
  }
  state.controls = VectorX::Zero(static_cast<Eigen::Index>(mechanism.controls.size()));
  for (std::size_t i = 0; i < mechanism.controls.size(); ++i) {
    const ControlDef& control = mechanism.controls[i];
    const ControlSource& source = c.controls[index][i];
    const double u = m.key_ctrl[key * m.nu + source.ctrl];
    state.controls[static_cast<Eigen::Index>(i)] = std::clamp(u, control.lower, control.upper);
    if (source.act < 0) continue;
    if (state.activation.size() == 0) state.activation = VectorX::Zero(state.controls.size());
    state.activation[static_cast<Eigen::Index>(i)] = m.key_act[key * m.na + source.act];
  }
  return state;
}

KeyframeDef::FreeBodyState FreeBodyAt(const Conversion& c, const Component& component, int key) {
  const mjModel& m = c.m;
  const int j = m.body_jntadr[component.tops[0]];
  const mjtNum* qvel = m.key_qvel + key * m.nv + m.jnt_dofadr[j];
  KeyframeDef::FreeBodyState state;
  state.X_WB = FreePose(m.key_qpos + key * m.nq + m.jnt_qposadr[j]);
  state.omega_W = state.X_WB.rotation() * Vec3(qvel + 3);
  state.velocity_W = Vec3(qvel);
  return state;
}

}  // namespace

std::optional<Error> ConvertKeyframes(Conversion& c, const std::string& wanted) {
  const mjModel& m = c.m;
  std::vector<std::string> names;
  for (int key = 0; key < m.nkey; ++key) {
    KeyframeDef keyframe;
    keyframe.name = NameOr(m, m.name_keyadr[key], "key", key);
    names.push_back(keyframe.name);
    int mechanism = 0;
    for (const Component& component : c.components) {
      if (component.free_body) {
        keyframe.free_bodies.push_back(FreeBodyAt(c, component, key));
      } else {
        keyframe.mechanisms.push_back(MechanismAt(c, component, mechanism++, key));
      }
    }
    c.scene.keyframes.push_back(std::move(keyframe));
  }
  if (wanted.empty()) return std::nullopt;
  const auto found = std::find(names.begin(), names.end(), wanted);
  if (found == names.end()) {
    return Error{ErrorCode::kUsage, fmt::format("{}, option keyframe", c.file),
                 names.empty()
                     ? fmt::format("there is no keyframe '{}': the file has none", wanted)
                     : fmt::format("there is no keyframe '{}'; there are {}", wanted, Quoted(names, 24))};
  }
  c.initial_keyframe = static_cast<int>(found - names.begin());
  const KeyframeDef& keyframe = c.scene.keyframes[c.initial_keyframe];
  for (std::size_t i = 0; i < c.scene.mechanisms.size(); ++i) {
    auto& controls = c.scene.mechanisms[i].controls;
    for (std::size_t k = 0; k < controls.size(); ++k) {
      controls[k].initial = keyframe.mechanisms[i].controls[static_cast<Eigen::Index>(k)];
      if (controls[k].dynamics != ControlDynamics::kNone)
        controls[k].initial_activation = keyframe.mechanisms[i].activation[static_cast<Eigen::Index>(k)];
    }
  }
  return std::nullopt;
}

}  // namespace fork1s::internal
