// A state of a scene as a keyframe of MJCF: keyframes.cpp the other way round.
#include <fmt/format.h>

#include "conversion.hpp"
#include "importer/model_copy.hpp"

namespace fork1s::internal {
namespace {

void PutFree(const Conversion& c, int joint, const RigidTransform& X_WB, const Vector6& V_B,
             KeyNumbers& key) {
  double *qpos = &key.qpos[c.m.jnt_qposadr[joint]], *qvel = &key.qvel[c.m.jnt_dofadr[joint]];
  const Vector3 p = X_WB.translation(), v_W = X_WB.rotation() * V_B.tail<3>();
  const Quaternion turn = X_WB.quaternion();
  for (int i = 0; i < 3; ++i) {
    qpos[i] = p(i);
    qvel[i] = v_W(i);
    qvel[3 + i] = V_B(i);
  }
  qpos[3] = turn.w();
  for (int i = 0; i < 3; ++i) qpos[4 + i] = turn.vec()(i);
}

void PutJoint(const Conversion& c, const MechanismDef& mechanism, const KeyframeDef::MechanismState& state,
              int j, int at, KeyNumbers& key) {
  const mjModel& m = c.m;
  double *qpos = &key.qpos[m.jnt_qposadr[j]], *qvel = &key.qvel[m.jnt_dofadr[j]];
  const mjtNum* qpos0 = m.qpos0 + m.jnt_qposadr[j];
  switch (m.jnt_type[j]) {
    case mjJNT_BALL: {
      const Vector3 phi = state.q.segment<3>(at);
      const Quaternion turn = Quat(qpos0) * Quaternion(ExpRotation(phi));
      const Vector3 rate = DexpRotation(-phi) * state.q_dot.segment<3>(at);
      qpos[0] = turn.w();
      for (int i = 0; i < 3; ++i) {
        qpos[1 + i] = turn.vec()(i);
        qvel[i] = rate(i);
      }
      break;
    }
    case mjJNT_FREE: {
      const Vector6 x = state.q.segment<6>(at);
      const RigidTransform X_RB = mechanism.X_WR.inverse() * c.WorldPose(m.jnt_bodyid[j]) * Exp(x);
      PutFree(c, j, state.X_WR * X_RB,
              Dexp(Vector6(-x)) * state.q_dot.segment<6>(at) + AdjointApply(X_RB.inverse(), state.V_R), key);
      break;
    }
    default:
      qpos[0] = qpos0[0] + state.q[at];
      qvel[0] = state.q_dot[at];
  }
}

void PutMechanism(const Conversion& c, const Component& component, int index,
                  const KeyframeDef::MechanismState& state, KeyNumbers& key) {
  const mjModel& m = c.m;
  const MechanismDef& mechanism = c.scene.mechanisms[index];
  if (const int b = component.base_body; b != 0 && component.base == BaseKind::kFloating) {
    PutFree(c, m.body_jntadr[b], state.X_WR, state.V_R, key);
  } else if (b != 0 && m.body_mocapid[b] >= 0) {
    const Quaternion turn = state.X_WR.quaternion();
    const int i = m.body_mocapid[b];
    for (int k = 0; k < 3; ++k) {
      key.mpos[3 * i + k] = state.X_WR.translation()(k);
      key.mquat[4 * i + 1 + k] = turn.vec()(k);
    }
    key.mquat[4 * i] = turn.w();
  }
  std::vector<int> offset;
  int n = 0;
  for (const JointDef& joint : mechanism.joints) {
    offset.push_back(n);
    n += static_cast<int>(joint.freedoms.size());
  }
  for (int j = 0; j < m.njnt; ++j)
    if (c.joint[j].mechanism == index) PutJoint(c, mechanism, state, j, offset[c.joint[j].joint.u()], key);
  for (std::size_t i = 0; i < c.controls[index].size(); ++i) {
    const ControlSource& source = c.controls[index][i];
    const double u = state.controls[static_cast<Eigen::Index>(i)];
    if (source.ctrl >= 0) key.ctrl[source.ctrl] = u;
    if (source.act >= 0)
      key.act[source.act] = state.activation.size() > 0 ? state.activation[static_cast<Eigen::Index>(i)]
                                                        : mechanism.controls[i].initial_activation;
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

KeyNumbers NumbersOf(const Conversion& c, const KeyframeDef& state) {
  const mjModel& m = c.m;
  KeyNumbers key;
  key.qpos.assign(m.qpos0, m.qpos0 + m.nq);
  key.qvel.assign(static_cast<std::size_t>(m.nv), 0);
  key.act.assign(static_cast<std::size_t>(m.na), 0);
  key.ctrl.assign(static_cast<std::size_t>(m.nu), 0);
  key.mpos.assign(3 * static_cast<std::size_t>(m.nmocap), 0);
  for (int i = 0; i < m.nmocap; ++i) key.mquat.insert(key.mquat.end(), {1, 0, 0, 0});
  std::size_t mechanism = 0, free_body = 0;
  for (const Component& component : c.components) {
    if (component.free_body) {
      const KeyframeDef::FreeBodyState& s = state.free_bodies[free_body++];
      const Matrix3 R_BW = s.X_WB.rotation().transpose();
      Vector6 V_B;
      V_B << R_BW * s.omega_W, R_BW * s.velocity_W;
      PutFree(c, m.body_jntadr[component.tops[0]], s.X_WB, V_B, key);
      continue;
    }
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
