#include "runs.hpp"
#include "sim/interface_names.hpp"

#include <algorithm>
#include <chrono>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <fmt/format.h>

namespace fork1s::internal {
namespace {

// Times one step and books it.
template <class Step>
void Clock(Run& run, Step step) {
  const auto start = std::chrono::steady_clock::now();
  step();
  run.step_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

void AddForce(const std::vector<TrackedBody>& tracked, int body, const Vector3& force, Sample& sample) {
  for (std::size_t k = 0; k < tracked.size(); ++k)
    if (tracked[k].index == body) sample.force[k] += force;
}

Sample Empty(std::size_t bodies) {
  Sample sample;
  sample.force.assign(bodies, Vector3::Zero());
  return sample;
}

Expected<void> ApplyFidelity(const RunOptions& options, std::size_t& next, Simulation& simulation) {
  if (!options.fidelity) return {};
  const auto& entries = options.fidelity->entries;
  for (; next < entries.size() && entries[next].time <= simulation.time() + 1e-9; ++next)
    if (auto set = simulation.SetFidelity(entries[next].fidelity); !set) return set;
  return {};
}

Error NotFinite(const std::string& simulator, double time, double dt) {
  return {ErrorCode::kNumerics, simulator + " simulation",
          fmt::format(
              "gave numbers that are not finite at {:.4g} s with steps of {:.4g} s; try a smaller time step",
              time, dt)};
}

}  // namespace

double LoopTurn(const Mechanism& mechanism, const std::vector<RigidTransform>& X_RB) {
  double largest = 0;
  for (const ClosureDef& c : mechanism.closures()) {
    const RigidTransform X_aJ = X_RB[c.body_a.u()] * c.X_AJ, X_bJ = X_RB[c.body_b.u()] * c.X_BJ;
    Vector3 turn = LogRotation(X_aJ.rotation().transpose() * X_bJ.rotation());
    for (int i = 0; i < 3; ++i)
      if (!c.rigid(i)) turn(i) = 0;
    largest = std::max(largest, turn.norm());
  }
  return largest;
}

std::vector<TrackedBody> TrackedBodies(const Simulation& simulation) {
  std::vector<TrackedBody> tracked;
  for (std::size_t i = 0; i < simulation.bodies().size(); ++i) {
    const SceneBody& b = simulation.bodies()[i];
    if (b.is_interface || b.mechanism < 0) tracked.push_back({b.name, static_cast<int>(i), b.is_interface});
  }
  return tracked;
}

Expected<Simulation> MakeReduced(const Scene& scene, const RunOptions& options) {
  SimulationOptions o;
  o.dt = options.interval / options.substeps;
  o.recovery = options.recovery;
  o.step.integrator = options.integrator;
  o.step.controls_move = options.controls && options.controls->times.size() > 1;
  if (options.fidelity && !options.fidelity->entries.empty() && options.fidelity->entries.front().time == 0) {
    const Fidelity& first = options.fidelity->entries.front().fidelity;
    o.detail = first.level;
    o.reduction.modes = first.modes;
    o.recovery = first.recovery;
  }
  o.initial_keyframe = options.initial_keyframe;
  return Simulation::Create(scene, o);
}

Expected<Run> RunReduced(const Scene& scene, const std::vector<TrackedBody>& tracked,
                         const RunOptions& options) {
  auto made = MakeReduced(scene, options);
  if (!made) return tl::unexpected(made.error());
  Simulation& s = *made;
  Run run{"reduced", s.dt(), 0, {}, s.warnings()};
  std::size_t next_fidelity = 0;
  StepPartTimes parts;
  auto measure = [&](Sample sample) {
    for (const TrackedBody& b : tracked) sample.X_WB.push_back(s.Pose(b.index));
    sample.energy = s.Energy();
    sample.gap = s.JointGap();
    for (const MechanismDynamics& m : s.world().mechanisms()) {
      std::vector<RigidTransform> X_RB;
      const RigidTransform X_RW = m.state().X_WR.inverse();
      for (int b = 0; b < m.mechanism().num_bodies(); ++b) X_RB.push_back(X_RW * m.BodyPose(BodyIndex(b)));
      sample.loop_turn = std::max(sample.loop_turn, LoopTurn(m.mechanism(), X_RB));
    }
    run.samples.push_back(std::move(sample));
  };
  options.controls->Start(s);
  measure(Empty(tracked.size()));
  for (int i = 0; i < options.samples; ++i) {
    Sample sample = Empty(tracked.size());
    for (int k = 0; k < options.substeps; ++k) {
      if (auto set = ApplyFidelity(options, next_fidelity, s); !set) return tl::unexpected(set.error());
      options.controls->Apply(s.time() + s.dt(), s);
      if (options.pushes)
        for (const PushNow& p : options.pushes->Over(s.time() + s.dt(), s.dt(), s))
          s.ApplyWrench(p.body, p.force_W, p.moment_W, p.point_W);
      StepReport report;
      s.world().Watch(options.watch_parts ? &parts : nullptr);  // a change of fidelity makes another world
      Clock(run, [&] { report = s.Step(); });
      if (options.watch_parts) run.parts.push_back(parts);
      run.refreshed.push_back(report.refreshes > 0);
      if (!report.finite) return tl::unexpected(NotFinite("reduced", s.time(), s.dt()));
      run.unconverged += report.IsSolved() ? 0 : 1;
      for (const ContactRecord& c : s.world().contacts()) {
        const Vector3 force = c.point.frame.transpose() * c.impulse / options.interval;
        AddForce(tracked, s.BodyOfCollisionBody(c.point.body_a), -force, sample);
        AddForce(tracked, s.BodyOfCollisionBody(c.point.body_b), force, sample);
      }
      for (const FrozenContactForce& f : s.FrozenContactForces()) {
        const Vector3 force = f.force_W * (s.dt() / options.interval);
        AddForce(tracked, f.body, -force, sample);
        AddForce(tracked, f.held, force, sample);
      }
    }
    measure(std::move(sample));
    if (options.progress) options.progress();
  }
  run.coordinates = 6 * static_cast<int>(s.world().free_bodies().size());
  for (const MechanismDynamics& m : s.world().mechanisms()) run.coordinates += m.num_velocities();
  return run;
}

Expected<Run> RunFull(const Scene& scene, const std::vector<TrackedBody>& tracked,
                      const RunOptions& options) {
  // The reduced simulation stands still beside it: it turns the track into controls and knows the interfaces.
  RunOptions as_given = options;
  as_given.fidelity = nullptr;
  auto guide = MakeReduced(scene, as_given);
  if (!guide) return tl::unexpected(guide.error());
  FullSimulationOptions o;
  o.dt = options.interval / options.substeps;
  o.integrator = options.full_integrator;
  o.controls_move = options.controls && options.controls->times.size() > 1;
  o.initial_keyframe = options.initial_keyframe;
  o.interfaces = InterfaceNames(*guide);
  o.collision = guide->options().collision;
  auto made = FullSimulation::Create(scene, o);
  if (!made) return tl::unexpected(made.error());
  FullSimulation& s = *made;
  Run run{"full", s.dt(), 0, {}, s.warnings()};
  run.coordinates = 6 * static_cast<int>(s.bodies().size());
  for (int i = 0; i < s.num_mechanisms(); ++i) run.coordinates += s.mechanism(i).num_coordinates();
  auto apply = [&](double time) {
    options.controls->Apply(time, *guide);
    s.SetControls(guide->controls());
    s.SetBaseRates(guide->base_rates());
  };
  auto measure = [&](Sample sample) {
    for (const TrackedBody& b : tracked) sample.X_WB.push_back(s.Pose(b.index));
    sample.energy = s.Energy();
    if (const auto gaps = s.JointGaps(); !gaps.empty()) sample.gap = gaps.front().gap;
    run.samples.push_back(std::move(sample));
  };
  apply(0);
  s.StartFromControls();
  measure(Empty(tracked.size()));
  for (int i = 0; i < options.samples; ++i) {
    Sample sample = Empty(tracked.size());
    for (int k = 0; k < options.substeps; ++k) {
      apply(s.time() + s.dt());
      if (options.pushes)
        for (const PushNow& p : options.pushes->Over(s.time() + s.dt(), s.dt(), *guide))
          s.ApplyWrench(p.body, p.force_W, p.moment_W, s.Pose(p.body) * p.point_B);
      FullStepReport report;
      Clock(run, [&] { report = s.Step(); });
      if (!report.finite) return tl::unexpected(NotFinite("full", s.time(), s.dt()));
      run.unconverged += report.converged ? 0 : 1;
      run.halved += report.parts > 1 ? 1 : 0;
      for (const FullContact& c : s.contacts()) {
        AddForce(tracked, c.point.body_a, -c.force / options.substeps, sample);
        AddForce(tracked, c.point.body_b, c.force / options.substeps, sample);
      }
    }
    measure(std::move(sample));
    if (options.progress) options.progress();
  }
  return run;
}

}  // namespace fork1s::internal
