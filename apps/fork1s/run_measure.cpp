#include "run_measure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <utility>

#include "progress.hpp"
#include "sim/run_watch.hpp"

namespace fork1s::app {
namespace {

// Changes the level of detail when its time has come.
void Switch(const FidelityTrack& track, std::size_t& next, Simulation& simulation, Measured& out) {
  for (; next < track.entries.size() && IsDue(track.entries[next], simulation); ++next) {
    Measured::Switch done{simulation.time(), track.entries[next].fidelity, 0, ""};
    const auto start = std::chrono::steady_clock::now();
    if (auto set = simulation.SetFidelity(done.fidelity); !set)
      done.refused = set.error().Text();
    else if (out.error)
      out.error->Restart("where the detail changed");
    done.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    out.switches.push_back(std::move(done));
  }
}

void WatchHolds(const Simulation& simulation, Measured& out) {
  for (const FrozenContactForce& f : simulation.FrozenContactForces()) {
    out.held = true;
    out.hold_use_max = std::max(out.hold_use_max, f.use);
  }
}

// Looks at the grasp now and then: it costs more than a step.
class LoadWatch {
 public:
  void Update(const Simulation& simulation, Measured& out) {
    if (simulation.steps() % 10 != 0) return;
    const LoadFactor now = ComputeLoadFactor(simulation);
    // An impact loads a contact for a single step: of two looks in a row the gentler one counts.
    const LoadFactor& held = now.factor > before_.factor ? now : before_;
    if (held.factor < out.load_min.factor) {
      out.load_min = held;
      out.load_min_time = simulation.time();
    }
    Record(simulation.time(), held, out.loads);
    before_ = now;
  }

 private:
  // A long run keeps the smaller one of two neighbours, again and again, so that its course stays readable.
  void Record(double time, const LoadFactor& load, std::vector<Measured::Load>& loads) {
    if (!std::isfinite(load.factor)) return;
    if (in_last_ > 0 && in_last_ < stride_) {
      if (load.factor < loads.back().load.factor) loads.back() = {time, load};
      ++in_last_;
      return;
    }
    constexpr std::size_t kMost = 500;
    if (loads.size() >= kMost) {
      for (std::size_t i = 0; 2 * i + 1 < loads.size(); ++i)
        loads[i] = loads[2 * i].load.factor < loads[2 * i + 1].load.factor ? loads[2 * i] : loads[2 * i + 1];
      loads.resize(loads.size() / 2);
      stride_ *= 2;
    }
    loads.push_back({time, load});
    in_last_ = 1;
  }

  LoadFactor before_;
  std::int64_t stride_ = 1, in_last_ = 0;
};

void StartBasePaths(const Simulation& simulation, Measured& out) {
  out.base_paths.resize(simulation.scene().mechanisms.size());
  for (std::size_t i = 0; i < out.base_paths.size(); ++i)
    out.base_paths[i].start = out.base_paths[i].last = simulation.BasePose(static_cast<int>(i)).translation();
}

void FollowBases(const Simulation& simulation, Measured& out) {
  for (std::size_t i = 0; i < out.base_paths.size(); ++i) {
    const auto number = static_cast<int>(i);
    if (simulation.given_mechanism(number).base() == BaseKind::kFixed) continue;
    Measured::BasePath& path = out.base_paths[i];
    const Vector3 position = simulation.BasePose(number).translation();
    path.length += (position - path.last).norm();
    path.last = position;
    path.speed_max = std::max(path.speed_max, simulation.BaseTwist(number).tail<3>().norm());
  }
}

// Joints with a limit of their speed.
class SpeedWatch {
 public:
  SpeedWatch(const Simulation& simulation, const std::map<std::string, double>& limits) {
    const std::vector<std::string> names = simulation.CoordinateNames();
    std::size_t next = 0;
    for (std::size_t m = 0; m < simulation.scene().mechanisms.size(); ++m) {
      const Mechanism& mechanism = simulation.given_mechanism(static_cast<int>(m));
      for (int i = 0; i < mechanism.num_coordinates(); ++i, ++next)
        if (const auto limit = limits.find(names[next]); limit != limits.end())
          watched_.push_back({static_cast<int>(m), i, limit->first, limit->second, mechanism.Turns(i)});
    }
  }
  void Update(const Simulation& simulation, Measured& out) const {
    int mechanism = -1;
    VectorX rates;
    for (const Watched& w : watched_) {
      if (std::exchange(mechanism, w.mechanism) != w.mechanism) rates = simulation.JointRates(w.mechanism);
      const double speed = std::abs(rates(w.coordinate));
      if (!(speed > w.limit)) continue;
      Measured::Speeding& most =
          out.speeding.try_emplace(w.joint, Measured::Speeding{w.limit, 0, w.turns, 0, simulation.time()})
              .first->second;
      if (speed > most.speed) {
        most.speed = speed;
        most.when = simulation.time();
      }
    }
  }

 private:
  struct Watched {
    int mechanism, coordinate;
    std::string joint;
    double limit;
    bool turns;
  };
  std::vector<Watched> watched_;
};

// Numbers that are finite, or were a step ago, and mean nothing.
std::string Impossible(const Simulation& simulation, double energy) {
  std::string body;
  double fastest = 0;
  for (std::size_t b = 0; b < simulation.bodies().size(); ++b) {
    if (simulation.bodies()[b].mechanism >= 0 && !simulation.bodies()[b].is_interface) continue;
    const double speed = simulation.Velocity(static_cast<int>(b)).tail<3>().norm();
    if (speed <= fastest) continue;
    fastest = speed;
    body = simulation.bodies()[b].name;
  }
  constexpr double kLight = 299792458;  // m/s
  if (std::isfinite(energy) && fastest < kLight) return "";
  if (body.empty())  // nothing that is looked at moves along
    return fmt::format("after {:.6g} s the energy is {:.3g} J", simulation.time(), energy);
  return fmt::format("after {:.6g} s body '{}' moves at {:.3g} m/s, energy {:.3g} J", simulation.time(), body,
                     fastest, energy);
}

void Note(const ContactSolverReport& report, double h, Measured::Solver& out) {
  if (report.active == 0) return;
  ++out.solves;
  out.iterations += report.newton_iterations;
  out.iterations_max = std::max(out.iterations_max, report.newton_iterations);
  out.helped += report.fallback > 0 ? 1 : 0;
  out.active_max = std::max(out.active_max, report.active);
  out.sliding_max = std::max(out.sliding_max, report.sliding);
  out.force_max = std::max(out.force_max, report.residual_impulse / h);
  out.speed_max = std::max(out.speed_max, report.residual_speed);
}

void Note(const StepReport& report, const World& world, Measured::Stages& out) {
  out.stages += report.stages;
  out.iterations += report.stage_iterations;
  out.iterations_max = std::max(out.iterations_max, report.max_stage_iterations);
  if (report.stage_residual > out.residual_max) {
    out.residual_max = report.stage_residual;
    out.residual_of = world.NameOf(report.stage_residual_of);
  }
  const auto count = [&](HalvingCause cause, int& steps, std::string& name) {
    if (report.halving != cause) return;
    ++steps;
    name = world.NameOf(report.halving_of);
  };
  count(HalvingCause::kImpact, out.impacts, out.impact);
  count(HalvingCause::kSaturation, out.saturations, out.saturation);
  count(HalvingCause::kUnsolved, out.unsolved, out.unsolved_of);
}

}  // namespace

bool IsDue(const FidelityTrack::Entry& entry, const Simulation& simulation) {
  constexpr double kRounding = 1e-9;  // s: of sums of steps
  return entry.time <= simulation.time() + kRounding;
}

std::vector<AppliedWrench> ApplyPushes(const RunInputs& inputs, double end, Simulation& simulation) {
  std::vector<AppliedWrench> applied;
  for (const PushTrack& track : inputs.pushes)
    for (const PushNow& p : track.Over(end, simulation.dt(), simulation))
      applied.push_back({p.body, p.force_W, p.moment_W, p.point_W});
  ApplyWrenches(applied, simulation);
  return applied;
}

Measured Simulate(Simulation& simulation, const RunInputs& inputs, std::int64_t steps, const Watches& watches,
                  std::optional<Recorder>& recorder, Expected<void>& recorded) {
  Measured out;
  out.step_us.reserve(static_cast<std::size_t>(std::min<std::int64_t>(steps, 1 << 20)));
  out.energy_first = out.energy_last = simulation.Energy();
  ProgressBar bar("simulating");
  LoadWatch watch;
  std::size_t next_detail = 0;
  if (watches.error) out.error.emplace();
  internal::RunWatch plausible(simulation);
  out.statistics.Begin(simulation);
  const SpeedWatch speeds(simulation, watches.velocity_limits);
  StartBasePaths(simulation, out);
  for (std::int64_t i = 0; i < steps; ++i) {
    const std::size_t switches = out.switches.size();
    Switch(inputs.detail, next_detail, simulation, out);
    if (out.switches.size() != switches) {
      plausible.Changed(simulation);
      out.statistics.Begin(simulation);
    }
    const double end = static_cast<double>(i + 1) * simulation.dt();
    inputs.controls.Apply(end, simulation);
    const std::vector<AppliedWrench> applied = ApplyPushes(inputs, end, simulation);
    if (out.error) out.error->BeginStep(simulation);
    const auto start = std::chrono::steady_clock::now();
    const StepReport report = simulation.Step();
    const std::chrono::duration<double, std::micro> spent = std::chrono::steady_clock::now() - start;
    if (out.error) out.error->EndStep(simulation, report);
    if (!report.finite) {
      out.failed_step = i;
      out.failed_unsolved = !report.stages_converged;
      out.failed_of = simulation.world().NameOf(report.halving_of);
      break;
    }
    out.step_us.push_back(spent.count());
    out.contacts_max = std::max(out.contacts_max, report.contacts);
    out.unconverged += report.IsSolved() ? 0 : 1;
    Note(report.solver, simulation.dt(), out.solver);
    Note(report, simulation.world(), out.stages);
    out.refreshes += report.refreshes;
    AddRelinearizations(report, simulation.world(), out.refreshes_by_cause);
    out.failed_refreshes += report.failed_refreshes;
    out.expansions += report.expansions;
    out.expanded_steps += report.by_expansion > 0 ? 1 : 0;
    out.steps_at_bound += report.forces_at_bound > 0 ? 1 : 0;
    out.most_at_bound = std::max(out.most_at_bound, report.forces_at_bound);
    out.contacts_dropped |= report.contacts_dropped;
    WatchHolds(simulation, out);
    FollowBases(simulation, out);
    speeds.Update(simulation, out);
    out.statistics.Update(simulation);
    out.penetration_max = std::max(out.penetration_max, report.max_penetration);
    const double energy = simulation.Energy();
    out.energy_increase = std::max(out.energy_increase, energy - out.energy_last);
    out.energy_last = energy;
    const double gap = simulation.JointGap();
    out.gap_max = std::max(out.gap_max, gap);
    plausible.Update(simulation, {energy, simulation.KineticEnergy(), gap, !applied.empty(),
                                  report.IsSolved(), report.stages_converged ? 0 : report.stage_residual});
    if (watches.load_factor) watch.Update(simulation, out);
    if (recorder)
      if (recorded = recorder->Append(simulation, report, applied); !recorded) break;
    if (out.impossible = Impossible(simulation, energy); !out.impossible.empty()) break;
    bar.Update(static_cast<double>(i + 1) / static_cast<double>(steps));
  }
  out.passed = plausible.Passed();
  out.implausible = plausible.Implausible();
  return out;
}

}  // namespace fork1s::app
