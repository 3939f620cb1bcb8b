#include "legged_mujoco.hpp"

#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fork1s/mechanism/mechanism.hpp>
#include <fstream>
#include <memory>

using namespace fork1s;
using namespace fork1s::examples;

namespace {

struct Deleter {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
  void operator()(mjData* d) const { mj_deleteData(d); }
};

std::string GroundText(const GeometryDef& g) {
  const Vector3& p = g.X_BG.translation();
  const Quaternion q = g.X_BG.quaternion();
  const auto* box = std::get_if<Box>(&g.shape);
  const std::string shape =
      box ? fmt::format("type='box' size='{} {} {}'", box->half.x(), box->half.y(), box->half.z())
          : "type='plane' size='0 0 1'";
  return fmt::format(
      "<geom {} pos='{} {} {}' quat='{} {} {} {}' contype='0' conaffinity='15' condim='3' friction='{}'/>\n",
      shape, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(), g.friction);
}

// A file in `folder` that includes the model's, by a relative path as MuJoCo wants it, and adds the ground.
std::string WithGround(const Scene& scene, const std::string& model_file,
                       const std::filesystem::path& folder) {
  const auto path = std::filesystem::absolute(model_file).lexically_normal();
  std::string text = fmt::format(
      "<mujoco>\n<include file='{}'/>\n<compiler meshdir='{}'/>\n<size njmax='2000' "
      "nconmax='400'/>\n<worldbody>\n",
      path.lexically_relative(folder).string(), (path.parent_path() / "assets").string());
  for (const GeometryDef& g : scene.world) text += GroundText(g);
  return text + "</worldbody>\n</mujoco>\n";
}

Expected<std::unique_ptr<mjModel, Deleter>> LoadModel(const std::string& path) {
  char message[1000] = "";
  std::unique_ptr<mjModel, Deleter> model(
      mj_loadXML(path.c_str(), nullptr, message, static_cast<int>(sizeof message)));
  if (!model) return Fail(ErrorCode::kModel, path, fmt::format("MuJoCo refuses it: {}", message));
  return model;
}

// Servos and dampers as the scene has them; no dry friction and no limits of force, which it leaves out.
void TakeGains(const MechanismDef& m, mjModel* model) {
  for (const JointDef& joint : m.joints) {
    const int j = mj_name2id(model, mjOBJ_JOINT, joint.name.c_str());
    if (j < 0) continue;
    for (std::size_t i = 0; i < joint.freedoms.size(); ++i) {
      const int dof = model->jnt_dofadr[j] + static_cast<int>(i);
      model->dof_damping[dof] = joint.freedoms[i].damping;
      model->dof_frictionloss[dof] = 0;
    }
    const int a = mj_name2id(model, mjOBJ_ACTUATOR, joint.name.c_str());
    if (a < 0) continue;
    const double kp = joint.freedoms[0].stiffness;
    model->actuator_gear[6 * a] = 1;
    model->actuator_gainprm[mjNGAIN * a] = kp;
    model->actuator_biastype[a] = mjBIAS_AFFINE;
    model->actuator_biasprm[mjNBIAS * a + 1] = -kp;
    model->actuator_ctrllimited[a] = model->actuator_forcelimited[a] = 0;
  }
}

void KeepFeet(const LeggedScene& legged, mjModel* model) {
  for (int g = 0; g < model->ngeom; ++g) {
    const int body = model->geom_bodyid[g];
    if (body == 0) continue;
    const char* name = mj_id2name(model, mjOBJ_BODY, body);
    const bool round = model->geom_type[g] == mjGEOM_SPHERE || model->geom_type[g] == mjGEOM_CAPSULE;
    const bool foot = round && name &&
                      std::any_of(legged.feet.begin(), legged.feet.end(),
                                  [&](const FootPoint& f) { return f.body == name; });
    if (!foot) model->geom_contype[g] = model->geom_conaffinity[g] = 0;
  }
}

void TakePose(const MechanismDef& m, const KeyframeDef::MechanismState& state, const mjModel* model,
              mjData* data) {
  const RigidTransform& X = state.X_WR;
  const Quaternion q = X.quaternion();
  const double base[7] = {
      X.translation().x(), X.translation().y(), X.translation().z(), q.w(), q.x(), q.y(), q.z()};
  std::copy(base, base + 7, data->qpos);
  Eigen::Index next = 0;
  for (const JointDef& joint : m.joints) {
    const auto size = static_cast<Eigen::Index>(joint.freedoms.size());
    const int j = mj_name2id(model, mjOBJ_JOINT, joint.name.c_str());
    const int at = model->jnt_qposadr[j];
    if (model->jnt_type[j] == mjJNT_BALL) {
      const Quaternion turn(Matrix3(ExpRotation(state.q.segment<3>(next))));
      const double values[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
      std::copy(values, values + 4, data->qpos + at);
    } else {
      data->qpos[at] = model->qpos0[at] + state.q(next);
    }
    next += size;
  }
}

void TakeTargets(const MechanismDef& m, const VectorX& u, const mjModel* model, mjData* data) {
  for (std::size_t i = 0; i < m.controls.size(); ++i) {
    const ControlDef& control = m.controls[i];
    const JointDef& joint = m.joints[control.terms[0].first.joint.u()];
    const int a = mj_name2id(model, mjOBJ_ACTUATOR, joint.name.c_str());
    const int j = mj_name2id(model, mjOBJ_JOINT, joint.name.c_str());
    if (a < 0 || j < 0) continue;
    data->ctrl[a] = model->qpos0[model->jnt_qposadr[j]] + joint.freedoms[0].rest +
                    (u.size() > 0 ? u(static_cast<Eigen::Index>(i)) : 0.0);
  }
}

RigidTransform PoseOf(const mjModel* model, const mjData* data, const std::string& body) {
  const int b = mj_name2id(model, mjOBJ_BODY, body.c_str());
  const double* q = data->xquat + 4 * b;
  return {Quaternion(q[0], q[1], q[2], q[3]), Vector3(Eigen::Map<const Vector3>(data->xpos + 3 * b))};
}

}  // namespace

Expected<MuJoCoStand> StandInMuJoCo(const LeggedScene& legged, const std::string& model_file, bool discrete,
                                    double dt, double settling, double time) {
  const Scene& scene = legged.imported.scene;
  const bool own = legged.imported.initial_keyframe < 0;  // the file has its ground, and starts as it is
  std::string path = model_file;
  if (!own) {
    const auto folder = std::filesystem::temp_directory_path();
    path = (folder / fmt::format("fork1s_legged_{}.xml", getpid())).string();
    std::ofstream(path) << WithGround(scene, model_file, folder);
  }
  mju_user_warning = [](const char*) {};  // counted in mjData
  auto loaded = LoadModel(path);
  if (!own) std::filesystem::remove(path);
  if (!loaded) return tl::unexpected(loaded.error());
  mjModel* model = loaded->get();
  model->opt.timestep = dt;
  model->opt.integrator = discrete ? mjINT_DISCRETE : mjINT_EULER;
  for (const MechanismDef& m : scene.mechanisms) TakeGains(m, model);
  if (!own) KeepFeet(legged, model);
  const std::unique_ptr<mjData, Deleter> holder(mj_makeData(model));
  mjData* data = holder.get();
  if (!own) {
    const auto& state = scene.keyframes[0].mechanisms[0];
    TakePose(scene.mechanisms[0], state, model, data);
    TakeTargets(scene.mechanisms[0], state.controls, model, data);
  }

  mj_kinematics(model, data);
  const double height = PoseOf(model, data, legged.trunk).translation().z();
  MuJoCoStand out;
  out.coordinates = static_cast<int>(model->nv);
  std::vector<double> us;
  std::vector<Vector3> settled;
  double all = 0;
  const auto steps = static_cast<int>(std::lround(time / dt));
  for (int i = 1; i <= steps; ++i) {
    const auto start = std::chrono::steady_clock::now();
    mj_step(model, data);
    us.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    all += us.back();
    for (int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data->warning[warning].number > 0) return out;
    if (i * dt < settling) continue;
    for (std::size_t k = 0; k < legged.feet.size(); ++k) {
      const Vector3 p = PoseOf(model, data, legged.feet[k].body) * legged.feet[k].p_B;
      if (settled.size() <= k) settled.push_back(p);
      out.foot_motion = std::max(out.foot_motion, (p - settled[k]).norm());
    }
  }
  const RigidTransform X_WT = PoseOf(model, data, legged.trunk);
  const Matrix3 R = X_WT.rotation() * legged.R_trunk.transpose();
  out.stood = R(2, 2) > std::cos(0.5) && X_WT.translation().z() > 0.5 * height;
  std::nth_element(us.begin(), us.begin() + static_cast<std::ptrdiff_t>(us.size() / 2), us.end());
  out.step_us = us[us.size() / 2];
  out.real_time_factor = 1e6 * time / all;
  return out;
}
