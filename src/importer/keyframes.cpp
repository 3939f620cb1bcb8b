// Keyframes of the file as states of the scene.
#include <fmt/format.h>

#include <algorithm>

#include "conversion.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

RigidTransform MocapPose(const mjModel& m, int key, int mocap) {
  const auto i = key * m.nmocap + mocap;
  return {Quat(m.key_mquat + 4 * i), Vec3(m.key_mpos + 3 * i)};
}

// Base and controls; joints follow in ApplyFileState.
KeyframeDef::MechanismState MechanismAt(const Conversion& c, const Component& component, int index, int key) {
  const MechanismDef& mechanism = c.scene.mechanisms[index];
  const mjModel& m = c.m;
  KeyframeDef::MechanismState state;
  state.X_WR = mechanism.X_WR;
  if (const int b = component.base_body;
      b != 0 && component.base != BaseKind::kFloating && m.body_mocapid[b] >= 0)
    state.X_WR = MocapPose(m, key, m.body_mocapid[b]);
  Eigen::Index n = 0;
  for (const JointDef& joint : mechanism.joints) n += static_cast<Eigen::Index>(joint.freedoms.size());
  state.q = VectorX::Zero(n);
  state.q_dot = VectorX::Zero(n);
  state.controls = VectorX::Zero(static_cast<Eigen::Index>(mechanism.controls.size()));
  for (std::size_t i = 0; i < mechanism.controls.size(); ++i) {
    const ControlDef& control = mechanism.controls[i];
    const ControlSource& source = c.controls[index][i];
    const double u = source.ctrl < 0 ? control.initial : m.key_ctrl[key * m.nu + source.ctrl];
    state.controls[static_cast<Eigen::Index>(i)] = std::clamp(u, control.lower, control.upper);
    if (source.act < 0) continue;
    if (state.activation.size() == 0) state.activation = VectorX::Zero(state.controls.size());
    state.activation[static_cast<Eigen::Index>(i)] = m.key_act[key * m.na + source.act];
  }
  return state;
}

}  // namespace

std::optional<Error> ConvertKeyframes(Conversion& c, const std::string& wanted) {
  const mjModel& m = c.m;
  const std::vector<FileJoint> joints = FileJointsOf(c);
  std::vector<std::string> names;
  for (int key = 0; key < m.nkey; ++key) {
    KeyframeDef keyframe;
    keyframe.name = NameOr(m, m.name_keyadr[key], "key", key);
    names.push_back(keyframe.name);
    int mechanism = 0;
    for (const Component& component : c.components) {
      if (component.free_body)
        keyframe.free_bodies.emplace_back();
      else
        keyframe.mechanisms.push_back(MechanismAt(c, component, mechanism++, key));
    }
    const FileState given{Eigen::Map<const VectorX>(m.key_qpos + key * m.nq, m.nq),
                          Eigen::Map<const VectorX>(m.key_qvel + key * m.nv, m.nv)};
    if (auto applied = ApplyFileState(joints, c.scene, given, keyframe); !applied)
      return c.ModelError("keyframe '" + keyframe.name + "'",
                          applied.error().where + " " + applied.error().message);
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
