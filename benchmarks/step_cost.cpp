// What a step costs beside mj_step on the same file, time step and contacts, collision counted on both sides.
//
//     build/release/benchmarks/step_cost MODEL [CONTROLS.csv [SECONDS [FROM]]]
//
// Both run in one process, step by step in turn. Before each of its steps MuJoCo gets our joint positions,
// base and free-body poses and controls, so that both see the same contacts; its warm start is its own. Only
// steps after FROM seconds count. Prints one CSV row: medians in µs and their ratio, and what the reduction
// of all mechanisms took at the start.
#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fork1s/base/percentile.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace fork1s;
using Clock = std::chrono::steady_clock;

// Copies our state to MuJoCo's: hinges, slides, balls, free joints, mocap bodies and controls of the same
// names.
class Copier {
 public:
  Copier(const Simulation& simulation, const mjModel* m) : simulation_(simulation), m_(m) {
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

double ReductionMs(const Simulation& simulation) {
  double sum = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    ReductionOptions options;
    options.interfaces = m.model().interfaces;
    std::vector<double> ms;
    for (int i = 0; i < 21; ++i) {
      const auto start = Clock::now();
      if (!Reduce(m.model().mechanism, m.model().q_ref, options)) return -1;
      ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    }
    sum += Median(ms);
  }
  return sum;
}

int Measure(int argc, char** argv) {
  const std::string path = argv[1];
  const double seconds = argc > 3 ? std::atof(argv[3]) : 4, from = argc > 4 ? std::atof(argv[4]) : 1;
  auto imported = LoadMechanism(path);
  if (!imported) {
    fmt::print(stderr, "{}\n", imported.error().Text());
    return 3;
  }
  auto simulation = Simulation::Create(imported->scene);
  if (!simulation) {
    fmt::print(stderr, "{}\n", simulation.error().Text());
    return 3;
  }
  ControlTrack track;
  if (argc > 2 && std::string(argv[2]) != "-") {
    auto read = ReadControls(argv[2]);
    if (!read) {
      fmt::print(stderr, "{}\n", read.error().Text());
      return 3;
    }
    track = std::move(*read);
  }
  char error[1000] = "";
  std::unique_ptr<mjModel, void (*)(mjModel*)> m(mj_loadXML(path.c_str(), nullptr, error, sizeof error),
                                                 mj_deleteModel);
  if (!m) {
    fmt::print(stderr, "{}\n", error);
    return 3;
  }
  m->opt.timestep = simulation->dt();
  const double reduction_ms = ReductionMs(*simulation);
  std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(m.get()), mj_deleteData);
  const Copier copier(*simulation, m.get());

  std::vector<double> ours, theirs;
  double our_contacts = 0, their_contacts = 0;
  const int steps = static_cast<int>(seconds / simulation->dt());
  for (int i = 0; i < steps; ++i) {
    track.Apply((i + 1) * simulation->dt(), *simulation);
    copier.Copy(d.get());
    mju_zero(d->qvel, m->nv);
    auto start = Clock::now();
    mj_step(m.get(), d.get());
    const double mujoco_us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    start = Clock::now();
    const StepReport report = simulation->Step();
    const double our_us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    if (i * simulation->dt() < from) continue;
    theirs.push_back(mujoco_us);
    ours.push_back(our_us);
    our_contacts += report.contacts;
    their_contacts += d->ncon;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(ours.size(), 1));
  const double a = Median(ours), b = Median(theirs);
  fmt::print("model,dt_s,contacts_ours,contacts_mujoco,step_us_ours,step_us_mujoco,ratio,reduction_ms\n");
  fmt::print("{},{:.5f},{:.1f},{:.1f},{:.2f},{:.2f},{:.3f},{:.3f}\n", path, simulation->dt(),
             our_contacts / count, their_contacts / count, a, b, a / b, reduction_ms);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: step_cost MODEL [CONTROLS.csv|- [SECONDS [FROM]]]\n");
    return 2;
  }
  return Measure(argc, argv);
}
