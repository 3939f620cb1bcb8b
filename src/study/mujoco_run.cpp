// mj_step on the file itself.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "mujoco_handles.hpp"
#include "mujoco_laws.hpp"
#include "mujoco_pairs.hpp"
#include "runs.hpp"

namespace fork1s::internal {
namespace {

RigidTransform Between(const RigidTransform& a, const RigidTransform& b, double share) {
  return {a.quaternion().slerp(share, b.quaternion()),
          Vector3((1 - share) * a.translation() + share * b.translation())};
}

// Contact forces on every body, times the step.
void AddImpulses(const mjModel* m, const mjData* d, double h, std::vector<Vector3>& impulse) {
  for (int i = 0; i < d->ncon; ++i) {
    mjtNum wrench[6];
    mj_contactForce(m, d, i, wrench);
    const mjContact& c = d->contact[i];
    if (c.geom[0] < 0 || c.geom[1] < 0) continue;  // a flexible body, which the reduced model has not
    // Rows of the frame: normal from geom 1 to geom 2, tangents; the force acts on geom 2's body.
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> frame(c.frame);
    const Vector3 force = frame.transpose() * Vector3(wrench[0], wrench[1], wrench[2]);
    impulse[static_cast<std::size_t>(m->geom_bodyid[c.geom[0]])] -= h * force;
    impulse[static_cast<std::size_t>(m->geom_bodyid[c.geom[1]])] += h * force;
  }
}

// A mocap body of the file, which is a driven base here: its six controls come one after the other, from where
// the file or its keyframe starts it.
struct DrivenBase {
  int control = 0, mocap = 0;
  RigidTransform start;
};

std::vector<DrivenBase> FindDrivenBases(const mjModel* m, const mjData* d, const Simulation& guide) {
  std::vector<DrivenBase> bases;
  for (int body = 0; body < m->nbody; ++body) {
    const char* name = mj_id2name(m, mjOBJ_BODY, body);
    if (m->body_mocapid[body] < 0 || !name) continue;
    const int control = guide.FindControl(std::string(name) + ".x");
    if (control < 0) continue;
    const int mocap = m->body_mocapid[body];
    const double* q = d->mocap_quat + 4 * mocap;
    bases.push_back({control,
                     mocap,
                     {Quaternion(q[0], q[1], q[2], q[3]).normalized(),
                      Vector3(Eigen::Map<const Vector3>(d->mocap_pos + 3 * mocap))}});
  }
  return bases;
}

// Whether the table moves the control away from where it starts. The rows before the first time and after the
// last hold the first and the last value, so that the rows alone decide.
bool IsDriven(const ControlTrack& controls, const std::string& name, double start) {
  for (std::size_t c = 0; c < controls.names.size(); ++c)
    if (controls.names[c] == name)
      return std::any_of(controls.rows.begin(), controls.rows.end(),
                         [&](const std::vector<double>& row) { return row[c] != start; });
  return false;
}

// Pairs (control of ours, equality of the file that it switches).
std::vector<std::pair<int, int>> FindSwitches(const mjModel* m, const Scene& scene, const Simulation& guide) {
  std::vector<std::pair<int, int>> switches;
  for (const MechanismDef& mechanism : scene.mechanisms)
    for (const SwitchedClosureDef& closure : mechanism.switched_closures)
      if (const int e = mj_name2id(m, mjOBJ_EQUALITY, closure.name.c_str()); e >= 0)
        switches.emplace_back(guide.FindControl(closure.control), e);
  return switches;
}

// Pairs (control of ours, actuator of the file) of the same name. Errors (kModel): the table drives a control
// that has neither an actuator nor an equality nor a mocap body in the file. MuJoCo would run another experiment.
Expected<std::vector<std::pair<int, int>>> FindActuators(const mjModel* m, const std::string& path,
                                                         const Simulation& guide,
                                                         const std::vector<DrivenBase>& bases,
                                                         const std::vector<std::pair<int, int>>& switches,
                                                         const ControlTrack& controls) {
  std::vector<std::pair<int, int>> inputs;
  for (int i = 0; i < static_cast<int>(guide.control_names().size()); ++i) {
    if (std::any_of(bases.begin(), bases.end(),
                    [&](const DrivenBase& b) { return i >= b.control && i < b.control + 6; }))
      continue;
    if (std::any_of(switches.begin(), switches.end(), [&](const auto& s) { return s.first == i; })) continue;
    const std::string& name = guide.control_names()[static_cast<std::size_t>(i)];
    if (const int a = mj_name2id(m, mjOBJ_ACTUATOR, name.c_str()); a >= 0) {
      inputs.emplace_back(i, a);
      continue;
    }
    if (!IsDriven(controls, name, guide.controls()(i))) continue;
    const std::string body = guide.DrivesBase(i) ? name.substr(0, name.rfind('.')) : std::string();
    const std::string remedy =
        !body.empty() && mj_name2id(m, mjOBJ_BODY, body.c_str()) >= 0
            ? fmt::format("make body '{}' a mocap body of the file (mocap=\"true\", no joint)", body)
            : std::string("give it an actuator of that name in the file");
    return Fail(
        ErrorCode::kModel, path,
        fmt::format("the controls drive '{}', for which MuJoCo has no actuator, so that the two would "
                    "run different experiments; {}, or leave the column out",
                    name, remedy));
  }
  return inputs;
}

// Loops in MuJoCo's poses, measured as the reduced run's are: bodies by name, the base where it starts if the
// file has no name for it. MuJoCo's joints are exact, so that what opens is a loop.
class LoopGaps {
 public:
  LoopGaps(const mjModel* m, const Simulation& guide) : guide_(guide) {
    for (const MechanismDynamics& mechanism : guide.world().mechanisms()) {
      ids_.emplace_back();
      const Mechanism& built = mechanism.mechanism();
      for (int b = 0; b < built.num_bodies(); ++b) {
        ids_.back().push_back(mj_name2id(m, mjOBJ_BODY, built.body(BodyIndex(b)).name.c_str()));
        if (b > 0 && ids_.back().back() < 0 && !built.closures().empty())
          unknown_ = built.body(BodyIndex(b)).name;
      }
    }
  }
  /// A body without a name in the file that keeps a loop from being measured; empty: none.
  const std::string& unknown() const { return unknown_; }

  void Measure(const mjData* d, Sample& sample) const {
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      const MechanismDynamics& mechanism = guide_.world().mechanisms()[i];
      if (mechanism.mechanism().closures().empty() || !unknown_.empty()) continue;
      const RigidTransform X_WR = ids_[i][0] >= 0 ? PoseOf(d, ids_[i][0]) : mechanism.state().X_WR;
      const RigidTransform X_RW = X_WR.inverse();
      std::vector<RigidTransform> X_RB{RigidTransform()};
      for (std::size_t b = 1; b < ids_[i].size(); ++b) X_RB.push_back(X_RW * PoseOf(d, ids_[i][b]));
      for (const JointGap& gap : MeasureJointGaps(mechanism.mechanism(), X_RB))
        sample.gap = std::max(sample.gap, gap.gap);
      sample.loop_turn = std::max(sample.loop_turn, LoopTurn(mechanism.mechanism(), X_RB));
    }
  }

 private:
  const Simulation& guide_;
  std::vector<std::vector<int>> ids_;  // per mechanism and body
  std::string unknown_;
};

// Pushes of the step that ends at `time`, as forces and moments at centres of mass.
void ApplyPushes(const mjModel* m, mjData* d, const PushTrack& pushes, double time, const Simulation& guide) {
  std::fill(d->xfrc_applied, d->xfrc_applied + 6 * m->nbody, 0);
  for (const PushNow& p : pushes.Over(time, m->opt.timestep, guide)) {
    const int body = mj_name2id(m, mjOBJ_BODY, guide.bodies()[static_cast<std::size_t>(p.body)].name.c_str());
    if (body < 0) continue;
    const Vector3 arm = PoseOf(d, body) * p.point_B - Vector3(Eigen::Map<const Vector3>(d->xipos + 3 * body));
    Eigen::Map<Vector6> wrench(d->xfrc_applied + 6 * body);
    wrench.head<3>() += p.force_W;
    wrench.tail<3>() += p.moment_W + arm.cross(p.force_W);
  }
}

// What a user of MuJoCo sets where loops shall stay closed and grasps shall not creep: a time constant of
// the loops of a tenth of the default, elliptic friction cones, and friction rows ten times as hard as normal
// ones.
void Tune(mjModel* m) {
  for (int e = 0; e < m->neq; ++e) {
    m->eq_solref[mjNREF * e] = 0.002;  // s
    m->eq_solref[mjNREF * e + 1] = 1;  // critical damping
  }
  m->opt.cone = mjCONE_ELLIPTIC;
  m->opt.impratio = 10;
}

// As ScaleStiffness does to a mechanism.
void Stiffen(mjModel* m, double factor) {
  const double root = std::sqrt(factor);
  for (int j = 0; j < m->njnt; ++j) m->jnt_stiffness[j] *= factor;
  for (int i = 0; i < m->nv; ++i) m->dof_damping[i] *= root;
  for (int t = 0; t < m->ntendon; ++t) {
    m->tendon_stiffness[t] *= factor;
    m->tendon_damping[t] *= root;
  }
  for (int a = 0; a < m->nu; ++a) {
    if (m->actuator_biastype[a] != mjBIAS_AFFINE) continue;  // a motor has no stiffness
    m->actuator_gainprm[mjNGAIN * a] *= factor;
    m->actuator_biasprm[mjNBIAS * a] *= factor;
    m->actuator_biasprm[mjNBIAS * a + 1] *= factor;
    m->actuator_biasprm[mjNBIAS * a + 2] *= root;
  }
}

// The root of the tree that an interface body of this mechanism is in, where the file gives it no name; -1: it does.
int FindUnnamedBase(const mjModel* m, const Simulation& guide, int mechanism) {
  for (const SceneBody& b : guide.bodies()) {
    const int at = b.given == mechanism && b.is_interface ? mj_name2id(m, mjOBJ_BODY, b.name.c_str()) : -1;
    if (at < 0) continue;
    const int root = m->body_rootid[at];
    if (m->names[m->name_bodyadr[root]] == '\0') return root;
  }
  return -1;
}

Expected<Run> Simulate(const std::string& path, const Scene& scene, const std::vector<TrackedBody>& tracked,
                       double timestep, const RunOptions& options) {
  char message[1000] = "";
  const MuJoCoModelPointer model(
      mj_loadXML(path.c_str(), nullptr, message, static_cast<int>(sizeof message)));
  if (!model) return Fail(ErrorCode::kModel, path, fmt::format("MuJoCo refuses it: {}", message));
  mjModel* m = model.get();
  if (timestep > 0) m->opt.timestep = timestep;
  switch (options.mujoco_integrator) {
    case MuJoCoIntegrator::kOfFile:
      break;
    case MuJoCoIntegrator::kEuler:
      m->opt.integrator = mjINT_EULER;
      break;
    case MuJoCoIntegrator::kImplicitFast:
      m->opt.integrator = mjINT_IMPLICITFAST;
      break;
    case MuJoCoIntegrator::kDiscrete:
      m->opt.integrator = mjINT_DISCRETE;
      break;
  }
  if (options.mujoco_tuned) Tune(m);
  if (options.mujoco_stiffness != 1) Stiffen(m, options.mujoco_stiffness);
  if (options.energy) m->opt.enableflags |= mjENBL_ENERGY;
  const MuJoCoDataPointer data(mj_makeData(m));
  mjData* d = data.get();
  Run run{"mujoco", m->opt.timestep, 0, {}, {}};
  run.coordinates = static_cast<int>(m->nv);
  if (options.initial_keyframe >= 0) {
    const std::string& name = scene.keyframes[static_cast<std::size_t>(options.initial_keyframe)].name;
    const int key = mj_name2id(m, mjOBJ_KEY, name.c_str());
    if (key >= 0) mj_resetDataKeyframe(m, d, key);
  }

  auto guide = MakeReduced(scene, options);
  if (!guide) return tl::unexpected(guide.error());
  const std::vector<DrivenBase> bases = FindDrivenBases(m, d, *guide);
  const std::vector<std::pair<int, int>> switches = FindSwitches(m, scene, *guide);
  const auto inputs = FindActuators(m, path, *guide, bases, switches, *options.controls);
  if (!inputs) return tl::unexpected(inputs.error());
  auto apply = [&](double time) {
    options.controls->Apply(time, *guide);
    for (const auto& [control, actuator] : *inputs) d->ctrl[actuator] = guide->controls()(control);
    for (const auto& [control, equality] : switches)
      d->eq_active[equality] = SwitchedClosureDef::IsOn(guide->controls()(control)) ? 1 : 0;
    for (const DrivenBase& b : bases) {
      const Vector3 at = b.start.translation() + guide->controls().segment<3>(b.control);
      const Quaternion q(
          Matrix3(ExpRotation(guide->controls().segment<3>(b.control + 3)) * b.start.rotation()));
      Eigen::Map<Vector3>(d->mocap_pos + 3 * b.mocap) = at;
      Eigen::Map<Eigen::Vector4d>(d->mocap_quat + 4 * b.mocap) << q.w(), q.x(), q.y(), q.z();
    }
  };
  std::vector<int> id;
  for (const TrackedBody& b : tracked) {
    id.push_back(mj_name2id(m, mjOBJ_BODY, b.name.c_str()));
    if (id.back() < 0 && b.base_of >= 0) id.back() = FindUnnamedBase(m, *guide, b.base_of);
    if (id.back() < 0)
      return Fail(ErrorCode::kUsage, path,
                  fmt::format("MuJoCo knows no body '{}'; give the bodies names to compare them", b.name));
  }

  if (options.pushes)
    for (const Push& push : options.pushes->pushes)
      if (mj_name2id(m, mjOBJ_BODY, push.body.c_str()) < 0)
        return Fail(ErrorCode::kUsage, path,
                    fmt::format("MuJoCo knows no body '{}' to push; give it a name in the file", push.body));

  run.laws = MuJoCoLaws(m);
  if (!bases.empty())
    run.laws.push_back(
        "a driven base is a mocap body in MuJoCo and moves without velocity: friction on it resists motion "
        "against "
        "the world and its acceleration acts on no joint; here it has its velocity");
  PairDifference pairs(m, *guide);
  const LoopGaps gaps(m, *guide);
  if (!gaps.unknown().empty())
    run.warnings.push_back(fmt::format(
        "MuJoCo knows no body '{}'; give it a name to learn how far MuJoCo's loops open", gaps.unknown()));

  apply(0);
  mj_forward(m, d);
  std::vector<RigidTransform> before(tracked.size());
  std::vector<Vector3> impulse(static_cast<std::size_t>(m->nbody), Vector3::Zero());
  auto measure = [&](double share) {
    Sample sample;
    for (std::size_t k = 0; k < tracked.size(); ++k) {
      sample.X_WB.push_back(Between(before[k], PoseOf(d, id[k]), share));
      sample.force.push_back(impulse[static_cast<std::size_t>(id[k])] / options.interval);
    }
    std::fill(impulse.begin(), impulse.end(), Vector3::Zero());
    sample.energy = d->energy[0] + d->energy[1];
    gaps.Measure(d, sample);
    run.samples.push_back(std::move(sample));
    if (options.progress) options.progress();
  };
  auto keep = [&] {
    for (std::size_t k = 0; k < tracked.size(); ++k) before[k] = PoseOf(d, id[k]);
  };
  keep();
  measure(1);
  const double h = m->opt.timestep;
  for (int step = 1; static_cast<int>(run.samples.size()) <= options.samples; ++step) {
    const double time = step * h;
    apply(time);
    if (options.pushes) ApplyPushes(m, d, *options.pushes, time, *guide);
    keep();
    const auto start = std::chrono::steady_clock::now();
    mj_step(m, d);
    run.step_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    AddImpulses(m, d, h, impulse);
    pairs.Observe(d);
    for (int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (d->warning[warning].number > 0)
        return Fail(ErrorCode::kNumerics, "MuJoCo",
                    fmt::format("became unstable at {:.4g} s with steps of {:.4g} s", time, h));
    // mj_step leaves the poses of the start of the step behind.
    mj_kinematics(m, d);
    // Samples that fall into this step, on the straight line between its ends.
    while (static_cast<int>(run.samples.size()) <= options.samples) {
      const double at = static_cast<double>(run.samples.size()) * options.interval;
      if (at > time * (1 + 1e-12)) break;
      measure(std::clamp(1 - (time - at) / h, 0.0, 1.0));
    }
  }
  run.pairs_only_here = pairs.OnlyMuJoCo();
  run.pairs_only_reduced = pairs.OnlyReduced();
  return run;
}

}  // namespace

Expected<Run> RunMuJoCo(const std::string& path, const Scene& scene, const std::vector<TrackedBody>& tracked,
                        double timestep, const RunOptions& options) {
  const MuJoCoHandlers handlers;
  try {
    return Simulate(path, scene, tracked, timestep, options);
  } catch (const std::runtime_error& fault) {
    return Fail(ErrorCode::kModel, path, fmt::format("MuJoCo stopped: {}", fault.what()));
  }
}

}  // namespace fork1s::internal
