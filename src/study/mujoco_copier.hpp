// Our state in MuJoCo's terms, so that both take a step from the same pose with the same contacts.
#pragma once

#include <mujoco/mujoco.h>
#include <cstddef>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::internal {

/// Copies our state to MuJoCo's: hinges, slides, balls, free joints, mocap bodies and controls of the same
/// names.
class MuJoCoCopier {
 public:
  MuJoCoCopier(const Simulation& simulation, const mjModel* m) : simulation_(simulation), m_(m) {
    const auto& mechanisms = simulation.world().mechanisms();
    for (std::size_t i = 0; i < mechanisms.size(); ++i)
      for (const auto& joint : mechanisms[i].mechanism().joints())
        if (const int id = mj_name2id(m, mjOBJ_JOINT, joint.name.c_str()); id >= 0)
          joints_.push_back({static_cast<int>(i), joint.offset, joint.size, id});
    for (std::size_t b = 0; b < simulation.bodies().size(); ++b) {
      const int id = mj_name2id(m, mjOBJ_BODY, simulation.bodies()[b].name.c_str());
      if (id < 0) continue;
      if (m->body_mocapid[id] >= 0)
        mocaps_.push_back({static_cast<int>(b), m->body_mocapid[id]});
      else if (m->body_jntnum[id] == 1 && m->jnt_type[m->body_jntadr[id]] == mjJNT_FREE)
        frees_.push_back(
            {static_cast<int>(b), m->jnt_qposadr[m->body_jntadr[id]], m->jnt_dofadr[m->body_jntadr[id]]});
    }
    for (int a = 0; a < m->nu; ++a) {
      const char* name = mj_id2name(m, mjOBJ_ACTUATOR, a);
      controls_.push_back(name ? simulation.FindControl(name) : -1);
    }
  }

  void Copy(mjData* d) const {
    for (const Joint& j : joints_) {
      const VectorX& q =
          simulation_.world().mechanisms()[static_cast<std::size_t>(j.mechanism)].configuration().q;
      mjtNum* qpos = d->qpos + m_->jnt_qposadr[j.id];
      const mjtNum* qpos0 = m_->qpos0 + m_->jnt_qposadr[j.id];
      if (j.size == 1) {
        qpos[0] = qpos0[0] + q(j.offset);
      } else if (m_->jnt_type[j.id] == mjJNT_BALL) {
        const Vector3 v = q.segment<3>(j.offset);
        const Quaternion turn(ExpRotation(v));
        mjtNum t[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
        mju_mulQuat(qpos, qpos0, t);
      }
    }
    for (const auto& [body, at, dof] : frees_) {
      WritePose(simulation_.Pose(body), d->qpos + at, d->qpos + at + 3);
      const Vector6 V = simulation_.Velocity(body);
      for (int i = 0; i < 3; ++i) d->qvel[dof + i] = V(3 + i);
    }
    for (const auto& [body, id] : mocaps_)
      WritePose(simulation_.Pose(body), d->mocap_pos + 3 * id, d->mocap_quat + 4 * id);
    for (std::size_t a = 0; a < controls_.size(); ++a)
      if (controls_[a] >= 0) d->ctrl[a] = simulation_.controls()(controls_[a]);
  }

 private:
  static void WritePose(const RigidTransform& X, mjtNum* position, mjtNum* quaternion) {
    for (int i = 0; i < 3; ++i) position[i] = X.translation()(i);
    const Quaternion q = X.quaternion();
    quaternion[0] = q.w(), quaternion[1] = q.x(), quaternion[2] = q.y(), quaternion[3] = q.z();
  }
  struct Joint {
    int mechanism, offset, size, id;
  };
  struct Free {
    int body, at, dof;
  };
  const Simulation& simulation_;
  const mjModel* m_;
  std::vector<Joint> joints_;
  std::vector<Free> frees_;
  std::vector<std::pair<int, int>> mocaps_;
  std::vector<int> controls_;
};

}  // namespace fork1s::internal
