// A state of a scene as a keyframe of MJCF: keyframes.cpp the other way round.
#include <fmt/format.h>

#include <algorithm>

#include "conversion.hpp"
#include "importer/model_copy.hpp"

namespace fork1s::internal {
namespace {

void PutMechanism(const Conversion& c, const Component& component, int index,
                  const KeyframeDef::MechanismState& state, KeyNumbers& key) {
  const mjModel& m = c.m;
  if (const int b = component.base_body; b != 0 && m.body_mocapid[b] >= 0) {
    const Quaternion turn = state.X_WR.quaternion();
    const int i = m.body_mocapid[b];
    for (int k = 0; k < 3; ++k) {
      key.mpos[3 * i + k] = state.X_WR.translation()(k);
      key.mquat[4 * i + 1 + k] = turn.vec()(k);
    }
    key.mquat[4 * i] = turn.w();
  }
  for (std::size_t i = 0; i < c.controls[index].size(); ++i) {
    const ControlSource& source = c.controls[index][i];
    const double u = state.controls[static_cast<Eigen::Index>(i)];
    if (source.ctrl >= 0) key.ctrl[source.ctrl] = u;
    if (source.act >= 0)
      key.act[source.act] = state.activation.size() > 0
                                ? state.activation[static_cast<Eigen::Index>(i)]
                                : c.scene.mechanisms[index].controls[i].initial_activation;
  }
}

// A base that floats without a joint of the file gets one before the joints of its mechanism.
void AddFloatingBases(const Scene& scene, std::vector<FileJoint>& joints) {
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    const auto is_of = [&](const FileJoint& joint) { return joint.mechanism == static_cast<int>(i); };
    const auto moves_base = [&](const FileJoint& joint) {
      return is_of(joint) && joint.coordinate < 0 && joint.body == 0;
    };
    if (scene.mechanisms[i].base != BaseKind::kFloating ||
        std::any_of(joints.begin(), joints.end(), moves_base))
      continue;
    FileJoint base;
    base.name = scene.mechanisms[i].bodies[0].name;
    base.kind = FileJoint::Kind::kFree;
    base.mechanism = static_cast<int>(i);
    joints.insert(std::find_if(joints.begin(), joints.end(), is_of), std::move(base));
  }
}

std::string Numbers(const char* attribute, const std::vector<double>& values) {
  if (values.empty()) return "";
  std::string text = fmt::format(" {}=\"", attribute);
  for (std::size_t i = 0; i < values.size(); ++i)
    text += fmt::format("{}{:.12g}", i > 0 ? " " : "", values[i]);
  return text + '"';
}

}  // namespace

std::vector<FileJoint> FileJointsOf(const Conversion& c) {
  const mjModel& m = c.m;
  std::vector<FileJoint> joints;
  for (int j = 0; j < m.njnt; ++j) {
    FileJoint& joint = joints.emplace_back();
    joint.name = c.joint_names[j];
    const BodyPlace& place = c.body[m.jnt_bodyid[j]];
    joint.free_body = place.free_body;
    joint.mechanism = place.mechanism;
    if (place.mechanism >= 0) joint.body = place.body.value();
    if (c.joint[j].mechanism >= 0) {
      const auto& defs = c.scene.mechanisms[c.joint[j].mechanism].joints;
      joint.coordinate = 0;
      for (std::size_t k = 0; k < c.joint[j].joint.u(); ++k)
        joint.coordinate += static_cast<int>(defs[k].freedoms.size());
    }
    const mjtNum* qpos0 = m.qpos0 + m.jnt_qposadr[j];
    switch (m.jnt_type[j]) {
      case mjJNT_FREE:
        joint.kind = FileJoint::Kind::kFree;
        break;
      case mjJNT_BALL:
        joint.kind = FileJoint::Kind::kBall;
        joint.reference.assign(qpos0, qpos0 + 4);
        break;
      default:
        joint.kind = m.jnt_type[j] == mjJNT_SLIDE ? FileJoint::Kind::kSlide : FileJoint::Kind::kHinge;
        joint.reference = {qpos0[0]};
    }
  }
  return joints;
}

ImportedScene MoveOut(Conversion& c) {
  std::vector<FileJoint> joints = FileJointsOf(c);
  AddFloatingBases(c.scene, joints);
  return {std::move(c.scene), std::move(c.report),    c.initial_keyframe,
          std::move(joints),  std::move(c.actuators), std::move(c.frames)};
}

KeyNumbers NumbersOf(const Conversion& c, const KeyframeDef& state) {
  const mjModel& m = c.m;
  KeyNumbers key;
  const FileState file = ComputeFileState(FileJointsOf(c), c.scene, state);
  key.qpos.assign(file.positions.begin(), file.positions.end());
  key.qvel.assign(file.velocities.begin(), file.velocities.end());
  key.act.assign(static_cast<std::size_t>(m.na), 0);
  key.ctrl.assign(static_cast<std::size_t>(m.nu), 0);
  key.mpos.assign(3 * static_cast<std::size_t>(m.nmocap), 0);
  for (int i = 0; i < m.nmocap; ++i) key.mquat.insert(key.mquat.end(), {1, 0, 0, 0});
  std::size_t mechanism = 0;
  for (const Component& component : c.components) {
    if (component.free_body) continue;
    PutMechanism(c, component, static_cast<int>(mechanism), state.mechanisms[mechanism], key);
    ++mechanism;
  }
  return key;
}

std::string MomentText(const Conversion& c, const KeyframeDef& state, const std::string& name, double time) {
  const KeyNumbers key = NumbersOf(c, state);
  return fmt::format("<key name=\"{}\" time=\"{:.9g}\"{}{}{}{}{}{}/>", name, time, Numbers("qpos", key.qpos),
                     Numbers("qvel", key.qvel), Numbers("act", key.act), Numbers("ctrl", key.ctrl),
                     Numbers("mpos", key.mpos), Numbers("mquat", key.mquat));
}

}  // namespace fork1s::internal
