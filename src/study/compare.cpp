#include <algorithm>
#include <cmath>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "runs.hpp"
#include "sim/floating_base.hpp"
#include "sim/interface_names.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;
using internal::Sample;
using internal::TrackedBody;

constexpr double kDegrees = 180 / std::numbers::pi;

struct Distance {
  double rms_mm = 0, max_mm = 0, rms_deg = 0, max_deg = 0;
};

// Between two runs, over all samples after the start and the bodies [first, last).
Distance Between(const Run& a, const Run& b, std::size_t first, std::size_t last) {
  Distance d;
  int count = 0;
  for (std::size_t i = 1; i < std::min(a.samples.size(), b.samples.size()); ++i)
    for (std::size_t k = first; k < last; ++k, ++count) {
      const RigidTransform &X = a.samples[i].X_WB[k], &Y = b.samples[i].X_WB[k];
      const double mm = 1e3 * (X.translation() - Y.translation()).norm();
      const double deg = kDegrees * LogRotation(X.rotation().transpose() * Y.rotation()).norm();
      d.rms_mm += mm * mm;
      d.rms_deg += deg * deg;
      d.max_mm = std::max(d.max_mm, mm);
      d.max_deg = std::max(d.max_deg, deg);
    }
  if (count > 0) {
    d.rms_mm = std::sqrt(d.rms_mm / count);
    d.rms_deg = std::sqrt(d.rms_deg / count);
  }
  return d;
}

EnergyDrift Drift(const Run& run) {
  EnergyDrift drift{run.samples.front().energy, run.samples.back().energy, 0};
  for (std::size_t i = 1; i < run.samples.size(); ++i)
    drift.max_rise_J = std::max(drift.max_rise_J, run.samples[i].energy - run.samples[i - 1].energy);
  return drift;
}

double LargestGap(const Run& run) {
  double gap = 0;
  for (const Sample& s : run.samples) gap = std::max(gap, s.gap);
  return gap;
}

void CompareForces(const std::vector<TrackedBody>& tracked, const Run& a, const Run& b, Comparison& out) {
  double difference = 0, size = 0;
  int count = 0;
  for (std::size_t i = 1; i < std::min(a.samples.size(), b.samples.size()); ++i)
    for (std::size_t k = 0; k < a.samples[i].force.size(); ++k) {
      if (tracked[k].base_of >= 0) continue;  // it touches nothing
      ++count;
      const double d = (a.samples[i].force[k] - b.samples[i].force[k]).norm();
      difference += d * d;
      size += b.samples[i].force[k].squaredNorm();
      out.force_max_N = std::max(out.force_max_N, d);
    }
  if (count > 0) out.force_rms_N = std::sqrt(difference / count);
  if (difference > 0)
    out.force_rms_percent =
        size > 0 ? 100 * std::sqrt(difference / size) : std::numeric_limits<double>::quiet_NaN();
}

void StoreTraces(const std::vector<TrackedBody>& tracked, const Run& a, const Run& b, double interval,
                 Comparison& out) {
  out.traces.resize(tracked.size());
  for (std::size_t i = 0; i < std::min(a.samples.size(), b.samples.size()); ++i) {
    out.times_s.push_back(static_cast<double>(i) * interval);
    out.gap_reduced_mm.push_back(1e3 * a.samples[i].gap);
    out.gap_other_mm.push_back(1e3 * b.samples[i].gap);
    for (std::size_t k = 0; k < tracked.size(); ++k) {
      out.traces[k].body = tracked[k].name;
      out.traces[k].reduced_m.push_back(a.samples[i].X_WB[k].translation());
      out.traces[k].other_m.push_back(b.samples[i].X_WB[k].translation());
      out.traces[k].force_reduced_N.push_back(a.samples[i].force[k]);
      out.traces[k].force_other_N.push_back(b.samples[i].force[k]);
    }
  }
}

// Whether a switched closure acts at any time.
bool AnyIsSwitchedOn(const Scene& scene, const Simulation& start, const ControlTrack& track) {
  for (const MechanismDef& m : scene.mechanisms)
    for (const SwitchedClosureDef& closure : m.switched_closures) {
      const auto column = std::find(track.names.begin(), track.names.end(), closure.control);
      if (column == track.names.end() || track.rows.empty()) {
        if (SwitchedClosureDef::IsOn(start.controls()(start.FindControl(closure.control)))) return true;
        continue;
      }
      const auto at = static_cast<std::size_t>(column - track.names.begin());
      for (const std::vector<double>& row : track.rows)
        if (at < row.size() && SwitchedClosureDef::IsOn(row[at])) return true;
    }
  return false;
}

Scene WithoutSwitchedClosures(Scene scene) {
  for (MechanismDef& m : scene.mechanisms) m.switched_closures.clear();
  return scene;
}

// Of mechanisms whose switched closures are open: the reduced model has them in the solve of a step alone.
Expected<void> AddFrequencies(const Scene& scene, const Simulation& reduced, int keyframe, Comparison& out) {
  constexpr int kCount = 8;
  for (const MechanismDynamics& m : reduced.world().mechanisms())
    for (double hertz : ReducedFrequencies(m.model(), kCount)) out.frequencies_reduced_hz.push_back(hertz);
  FullSimulationOptions options;
  options.initial_keyframe = keyframe;
  options.dt = reduced.dt();
  options.interfaces = InterfaceNames(reduced);
  auto full = FullSimulation::Create(scene, options);
  if (!full) return tl::unexpected(full.error());
  for (int i = 0; i < full->num_mechanisms(); ++i)
    for (double hertz : full->Frequencies(i, kCount)) out.frequencies_full_hz.push_back(hertz);
  return {};
}

// Everything that follows from runs at one step and finer ones. `truth` is the other simulator at its finest.
void Summarise(const std::vector<TrackedBody>& tracked, const std::vector<Run>& reduced,
               const std::vector<Run>& other, const Run& base_other, const Run& truth, double interval,
               Comparison& out) {
  const Run& base = reduced.front();
  for (std::size_t k = 0; k < tracked.size(); ++k) {
    const Distance d = Between(base, base_other, k, k + 1);
    (tracked[k].is_interface || tracked[k].base_of >= 0 ? out.interface : out.free_bodies)
        .push_back({tracked[k].name, d.rms_mm, d.max_mm, d.rms_deg, d.max_deg});
  }
  CompareForces(tracked, base, base_other, out);
  out.gap_max_mm = 1e3 * LargestGap(base);
  out.gap_max_other_mm = 1e3 * LargestGap(base_other);
  out.energy_reduced = Drift(base);
  out.energy_other = Drift(base_other);
  out.wall_reduced_s = base.wall_s();
  out.wall_other_s = base_other.wall_s();
  out.wall_ratio = base.wall_s() > 0 ? base_other.wall_s() / base.wall_s() : 0;
  out.unconverged_reduced = base.unconverged;
  out.unconverged_other = base_other.unconverged;
  out.halved_other = base_other.halved;
  for (std::size_t i = 0; i < std::min(reduced.size(), other.size()); ++i) {
    const Distance d = Between(reduced[i], other[i], 0, tracked.size());
    out.equal_steps.push_back({reduced[i].dt, d.rms_mm, d.max_mm, reduced[i].wall_s(), other[i].wall_s()});
  }
  for (const auto* runs : {&reduced, &other})
    for (const Run& run : *runs) {
      if (&run == &truth) continue;
      const Distance d = Between(run, truth, 0, tracked.size());
      out.costs.push_back({run.simulator, run.dt, run.wall_s(), d.rms_mm, d.max_mm});
    }
  for (const Run* run : {&base, &base_other})
    for (const std::string& w : run->warnings)
      if (std::find(out.warnings.begin(), out.warnings.end(), w) == out.warnings.end())
        out.warnings.push_back(w);
  StoreTraces(tracked, base, base_other, interval, out);
}

Expected<void> CheckControls(const ControlTrack& track, const Simulation& simulation) {
  const auto missing = track.FindMissing(simulation);
  if (missing.empty()) return {};
  std::string known;
  for (const std::string& n : simulation.control_names()) known += (known.empty() ? "" : ", ") + n;
  return Fail(ErrorCode::kModel, "controls",
              fmt::format("'{}' is no control of this model; there are: {}", missing.front(),
                          known.empty() ? "none" : known));
}

// MuJoCo at the file's own step. A file may ask for a step that MuJoCo does not survive: then at the first of
// its halves that it does, with a warning.
Expected<Run> RunOwnStep(const std::string& path, const Scene& scene, const std::vector<TrackedBody>& tracked,
                         const RunOptions& options, std::vector<std::string>& warnings) {
  constexpr int kHalvings = 12;
  auto run = internal::RunMuJoCo(path, scene, tracked, 0, options);
  double step = scene.timestep;
  for (int i = 0; i < kHalvings && !run && run.error().code == ErrorCode::kNumerics; ++i) {
    const Error unstable = run.error();
    step /= 2;
    run = internal::RunMuJoCo(path, scene, tracked, step, options);
    if (run)
      warnings.push_back(
          fmt::format("{}; compared with {:.4g} s, the first half of the file's step that it survives",
                      unstable.Text(), step));
  }
  return run;
}

// "a and b, c and world (touched)": those that touched first, ten at most.
std::string PairList(std::vector<ContactPair> pairs) {
  constexpr std::size_t kMost = 10;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const ContactPair& a, const ContactPair& b) { return a.touched > b.touched; });
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, pairs.size()); ++i)
    text += fmt::format("{}'{}' and '{}'{}", i == 0 ? "" : ", ", pairs[i].body_a, pairs[i].body_b,
                        pairs[i].touched ? " (they did)" : "");
  if (pairs.size() > kMost) text += fmt::format(" and {} more pairs", pairs.size() - kMost);
  return text;
}

}  // namespace

std::string NameOf(Integrator integrator) { return Name(integrator); }
std::string NameOf(FullIntegrator integrator) {
  return integrator == FullIntegrator::kTwoStages ? "two-stages" : "euler";
}

std::string IntegratorsText(const Comparison& c) {
  return "reduced by " + NameOf(c.integrator) +
         (c.full_integrator ? ", full by " + NameOf(*c.full_integrator) : "");
}

std::vector<std::string> PairLines(const Comparison& c) {
  std::vector<std::string> lines;
  if (!c.pairs_only_other.empty())
    lines.push_back(fmt::format("may touch in {} alone: {}", c.other, PairList(c.pairs_only_other)));
  if (!c.pairs_only_reduced.empty())
    lines.push_back("may touch in the reduced model alone: " + PairList(c.pairs_only_reduced));
  return lines;
}

std::vector<std::string> DifferenceLines(const Comparison& c) {
  std::vector<std::string> lines = PairLines(c);
  lines.insert(lines.end(), c.laws.begin(), c.laws.end());
  constexpr std::size_t kMost = 10;
  for (std::size_t i = 0; i < std::min(kMost, c.dropped.size()); ++i)
    lines.push_back(c.other + " has, and the reduced model has not, " + c.dropped[i]);
  if (c.dropped.size() > kMost)
    lines.push_back(
        fmt::format("{} more elements of the file that the reduced model has not", c.dropped.size() - kMost));
  return lines;
}

Expected<Comparison> Compare(const ImportedScene& imported, const CompareOptions& options) {
  FORK1S_REQUIRE(options.time > 0 && options.refinements >= 0, options.time, options.refinements);
  const Scene& scene = imported.scene;
  const bool mujoco = options.against == Against::kMuJoCo;
  if (mujoco && imported.report.format != "MJCF")
    return Fail(
        ErrorCode::kUsage, options.model_path,
        "is not MJCF, which alone MuJoCo runs as the file says it; 'fork1s export' writes it as MJCF");
  RunOptions o;
  o.interval = options.dt > 0 ? options.dt : scene.timestep;
  o.samples = std::max(1, static_cast<int>(std::llround(options.time / o.interval)));
  o.recovery = options.recovery;
  o.integrator = options.integrator;
  o.initial_keyframe = imported.initial_keyframe;
  o.controls = &options.controls;
  if (!options.pushes.pushes.empty()) o.pushes = &options.pushes;
  o.mujoco_integrator = options.mujoco_integrator;
  if (!options.detail.entries.empty()) o.fidelity = &options.detail;

  auto probe = internal::MakeReduced(scene, o);
  if (!probe) return tl::unexpected(probe.error());
  o.integrator = probe->step_options().integrator;
  o.full_integrator = options.full_integrator.value_or(
      o.integrator == Integrator::kEuler ? FullIntegrator::kEuler : FullIntegrator::kTwoStages);
  if (auto ok = CheckControls(options.controls, *probe); !ok) return tl::unexpected(ok.error());
  if (const auto missing = options.pushes.FindMissing(*probe); !missing.empty())
    return Fail(ErrorCode::kModel, "pushes", fmt::format("the model has no body '{}'", missing.front()));
  std::vector<TrackedBody> tracked;
  for (std::size_t i = 0; i < probe->bodies().size(); ++i) {
    const SceneBody& b = probe->bodies()[i];
    const int index = static_cast<int>(i);
    if (b.is_interface || b.mechanism < 0)
      tracked.push_back({b.name, index, b.is_interface});
    else if (internal::IsFloatingBase(*probe, b))
      tracked.push_back({b.name, index, false, b.given});
  }
  Comparison out;
  out.scene = scene.name;
  out.other = mujoco ? "mujoco" : "full";
  out.integrator = o.integrator;
  if (!mujoco) out.full_integrator = o.full_integrator;
  out.dt_s = o.interval;
  out.time_s = o.samples * o.interval;
  // The full model has no switched closures, and needs none where all stay off.
  const Scene open = WithoutSwitchedClosures(scene);
  const Scene& full_scene = AnyIsSwitchedOn(scene, *probe, options.controls) ? scene : open;
  if (auto ok = AddFrequencies(mujoco ? open : full_scene, *probe, o.initial_keyframe, out); !ok)
    return tl::unexpected(ok.error());

  // Work is shared out by steps; a full one counts fifty times.
  double done = 0, all = mujoco ? 2.0 * 10 : 0;
  for (int k = 0; k <= options.refinements; ++k) all += (1 << k) * (mujoco ? 1 : 51);
  double weight = 1;
  o.progress = [&] {
    done += weight / o.samples;
    if (options.progress) options.progress(std::min(1.0, done / all));
  };
  std::vector<Run> reduced, other;
  std::optional<Run> own;
  const auto with_name = [&](Error error) {
    if (error.where == options.model_path && !options.model_name.empty()) error.where = options.model_name;
    return error;
  };
  if (mujoco) {
    // First, so that what MuJoCo cannot run is refused before anything is simulated.
    weight = 10;
    auto run = RunOwnStep(options.model_path, scene, tracked, o, out.warnings);
    if (!run) return tl::unexpected(with_name(run.error()));
    own = std::move(*run);
    // At our step it may well become unstable, and that is an answer.
    auto same = internal::RunMuJoCo(options.model_path, scene, tracked, o.interval, o);
    if (same)
      other.push_back(std::move(*same));
    else
      out.warnings.push_back(with_name(same.error()).Text());
  }
  for (int k = 0; k <= options.refinements; ++k) {
    o.substeps = 1 << k;
    weight = o.substeps;
    auto run = internal::RunReduced(scene, tracked, o);
    if (!run) return tl::unexpected(run.error());
    reduced.push_back(std::move(*run));
    if (mujoco) continue;
    weight = 50.0 * o.substeps;
    run = internal::RunFull(full_scene, tracked, o);
    if (!run) return tl::unexpected(run.error());
    other.push_back(std::move(*run));
  }
  if (!mujoco) {
    out.other_dt_s = o.interval;
    Summarise(tracked, reduced, other, other.front(), other.back(), o.interval, out);
    return out;
  }
  out.other_dt_s = own->dt;
  out.pairs_only_other = own->pairs_only_here;
  out.pairs_only_reduced = own->pairs_only_reduced;
  out.laws = own->laws;
  for (const ImportNote& note : imported.report.notes)
    if (note.kind == ImportNote::Kind::kDropped) out.dropped.push_back(note.where + ": " + note.message);
  Summarise(tracked, reduced, other, *own, *own, o.interval, out);
  return out;
}

}  // namespace fork1s
