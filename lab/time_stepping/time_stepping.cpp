// The table that decides the time stepping scheme (docs/decisions/001-time-stepping.md).
//
//     build/release/lab/time_stepping [--only=PREFIX] [CSV]
#include <fmt/core.h>
#include <fmt/os.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cases.hpp"
#include "polar_bob.hpp"
#include "schemes.hpp"

namespace fork1s::lab {
namespace {

constexpr double kFrame = 1. / 60;   // errors are sampled at these times
constexpr int kReferenceSteps = 64;  // steps a frame of the reference

struct Run {
  std::vector<std::vector<Pose>> frames;
  State end;
  double energy_gain = 0;  // largest energy above the start [J]
  double energy_end = 0;
  double angular_drift = 0;  // largest change of angular momentum, relative
  Counts counts;
  double deepest = 0;
  double highest = 0;    // of the first body above its start [m]
  double overshoot = 0;  // of the first torsion spring beyond [0, 0.4], in shares of 0.4
  bool finite = true;
};

Run Simulate(const Case& c, const StepSettings& settings, int steps_a_frame) {
  Stepper stepper(c.system, c.start, settings);
  Run run;
  const double h = kFrame / steps_a_frame, E0 = Energy(c.system, c.start);
  const Vector3 L0 = AngularMomentum(c.system, c.start);
  const int frames = static_cast<int>(std::lround(c.duration / kFrame));
  run.frames.push_back(c.start.poses);
  for (int i = 0; i < frames * steps_a_frame; ++i) {
    if (c.input) c.input(i * h, stepper.system());
    stepper.Step(h);
    const State& state = stepper.state();
    if (!state.V.allFinite() || state.V.norm() > 1e8) {
      run.finite = false;
      break;
    }
    run.energy_gain = std::max(run.energy_gain, Energy(stepper.system(), state) - E0);
    run.angular_drift = std::max(run.angular_drift,
                                 (AngularMomentum(c.system, state) - L0).norm() / std::max(L0.norm(), 1e-9));
    run.highest = std::max(run.highest, state.poses[0].x.z() - c.start.poses[0].x.z());
    if (!c.system.torsions.empty()) {
      const double angle = HingeAngle(c.system.torsions[0], state);
      run.overshoot = std::max({run.overshoot, angle / 0.4 - 1, -angle / 0.4});
    }
    if ((i + 1) % steps_a_frame == 0) run.frames.push_back(state.poses);
  }
  run.end = stepper.state();
  run.energy_end = Energy(stepper.system(), run.end);
  run.counts = stepper.counts();
  run.deepest = stepper.deepest();
  return run;
}

// RMS over frames of the distance of all bodies' centres and turned lengths [m].
double Error(const Case& c, const Run& run, const Run& reference) {
  double sum = 0;
  if (!run.finite) return std::nan("");
  for (std::size_t i = 0; i < run.frames.size(); ++i)
    for (std::size_t k = 0; k < run.frames[i].size(); ++k) {
      const Vector6 d = Difference(run.frames[i][k], reference.frames[i][k]);
      sum += d.tail<3>().squaredNorm() + std::pow(c.system.size * d.head<3>().norm(), 2);
    }
  return std::sqrt(sum / static_cast<double>(run.frames.size()));
}

const char* Name(Scheme s) {
  switch (s) {
    case Scheme::kEuler:
      return "euler";
    case Scheme::kSdirk2:
      return "sdirk2";
    case Scheme::kTrBdf2:
      return "trbdf2";
    case Scheme::kBdf2:
      return "bdf2";
  }
  return "";
}

const char* Name(Newton n) {
  switch (n) {
    case Newton::kStart:
      return "a_start";
    case Newton::kPredicted:
      return "b_predicted";
    case Newton::kResidual:
      return "c_residual";
    case Newton::kDisplacement:
      return "d_displacement";
    case Newton::kDisplacementFromStart:
      return "e_displacement_from_start";
    case Newton::kMomentum:
      return "f_momentum";
    case Newton::kExtrapolated:
      return "g_extrapolated";
    case Newton::kExtrapolatedMomentum:
      return "h_extrapolated_momentum";
  }
  return "";
}

constexpr Scheme kSchemes[] = {Scheme::kEuler, Scheme::kSdirk2, Scheme::kTrBdf2, Scheme::kBdf2};
constexpr Newton kNewtons[] = {Newton::kStart,
                               Newton::kPredicted,
                               Newton::kResidual,
                               Newton::kDisplacement,
                               Newton::kDisplacementFromStart,
                               Newton::kMomentum,
                               Newton::kExtrapolated,
                               Newton::kExtrapolatedMomentum};

class Table {
 public:
  explicit Table(const std::string& path) {
    if (!path.empty()) file_.emplace(fmt::output_file(path));
    Put("case,parameter,scheme,newton,constraints,steps_per_second,error_mm,energy_left,energy_gain,"
        "iterations_per_stage,evaluations_per_step,impacts,unconverged,measure,value\n");
  }
  void Add(const Case& c, const StepSettings& s, int steps_a_frame, const Run& run, double error,
           const std::string& measure = "", double value = 0) {
    const double E0 = Energy(c.system, c.start), swing = std::max(E0 - c.lowest_energy, 1e-12);
    AddRow(c.name, c.parameter, s, steps_a_frame, error, (run.energy_end - c.lowest_energy) / swing,
           run.energy_gain / swing, run.counts, measure, value);
  }
  void AddRow(const std::string& name, const std::string& parameter, const StepSettings& s, int steps_a_frame,
              double error, double left, double gain, const Counts& counts, const std::string& measure = "",
              double value = 0) {
    const auto share = [](long a, long b) {
      return static_cast<double>(a) / static_cast<double>(std::max(1L, b));
    };
    const char* start_rate = s.scheme != Scheme::kTrBdf2               ? ""
                             : s.start_rate == StartRate::kAppliedAnew ? "_anew"
                             : s.start_rate == StartRate::kRestart     ? "_restart"
                                                                       : "";
    Put(fmt::format("{},{},{}{},{},{},{},{:.4g},{:.5f},{:.2e},{:.2f},{:.2f},{},{},{},{:.4g}\n", name,
                    parameter, Name(s.scheme), start_rate, Name(s.stage.newton),
                    s.stage.form == ConstraintForm::kRate ? "rate" : "position", 60 * steps_a_frame,
                    1e3 * error, left, gain, share(counts.iterations, counts.stages),
                    share(counts.evaluations, counts.steps), counts.impacts, counts.unconverged, measure,
                    value));
  }

 private:
  void Put(const std::string& line) {
    fmt::print("{}", line);
    std::fflush(stdout);
    if (file_) file_->print("{}", line);
  }
  std::optional<fmt::ostream> file_;
};

StepSettings Settings(Scheme scheme, Newton newton, ConstraintForm form = ConstraintForm::kRate) {
  StepSettings s;
  s.scheme = scheme;
  s.stage.newton = newton;
  s.stage.form = form;
  return s;
}

using Measure = std::function<double(const Run&)>;

// All schemes and ways of Newton at the given steps; errors to the scheme `reference` at h/64.
void Compare(Table& table, const Case& c, Scheme reference, const std::vector<int>& steps,
             const std::string& measure = "", const Measure& value = {},
             const std::vector<ConstraintForm>& forms = {ConstraintForm::kRate}, bool start_rates = false) {
  const Run truth = Simulate(c, Settings(reference, Newton::kResidual), kReferenceSteps);
  table.Add(c, Settings(reference, Newton::kResidual), kReferenceSteps, truth, 0, measure,
            value ? value(truth) : 0);
  const auto add = [&](const StepSettings& s) {
    for (const int n : steps) {
      const Run run = Simulate(c, s, n);
      table.Add(c, s, n, run, Error(c, run, truth), measure, value ? value(run) : 0);
    }
  };
  for (const Scheme scheme : kSchemes)
    for (const Newton newton : kNewtons)
      for (const ConstraintForm form : forms)
        if (form == ConstraintForm::kRate || c.system.num_rows() > 0) add(Settings(scheme, newton, form));
  if (!start_rates) return;
  for (const Newton newton : {Newton::kResidual, Newton::kExtrapolatedMomentum})
    for (const StartRate rate : {StartRate::kAppliedAnew, StartRate::kRestart}) {
      StepSettings s = Settings(Scheme::kTrBdf2, newton);
      s.start_rate = rate;
      add(s);
    }
}

// Growth of energy of undamped random trees and loops over 300 steps of 1/60 s.
void CompareRandomTrees(Table& table, double factor, const StepSettings& settings) {
  constexpr unsigned kMechanisms = 24;
  std::vector<double> left;
  Counts sum;
  int grew = 0;
  double growth = 0;
  for (unsigned seed = 0; seed < kMechanisms; ++seed) {
    const Case c = RandomTree(seed, factor);
    const Run run = Simulate(c, settings, 1);
    const double start = KineticEnergy(c.system, c.start);
    const double gain = run.finite ? run.energy_gain / start : 1e300;
    left.push_back(run.finite ? (run.energy_end - c.lowest_energy) / start : 1e300);
    growth = std::max(growth, gain);
    grew += gain > 1e-6;
    sum.steps += run.counts.steps;
    sum.stages += run.counts.stages;
    sum.iterations += run.counts.iterations;
    sum.evaluations += run.counts.evaluations;
    sum.unconverged += run.counts.unconverged;
  }
  std::sort(left.begin(), left.end());
  table.AddRow("random_trees", fmt::format("factor={:g}", factor), settings, 1, 0, left[kMechanisms / 2],
               growth, sum, "grew_of_24", grew);
}

// The bob in joint coordinates.
void ComparePolarBob(Table& table, double k, double amplitude) {
  const int frames = 600;
  const PolarRun truth =
      SimulatePolarBob(k, amplitude, Scheme::kTrBdf2, kFrame / kReferenceSteps, frames * kReferenceSteps);
  for (const Scheme scheme : kSchemes) {
    const PolarRun run = SimulatePolarBob(k, amplitude, scheme, kFrame, frames);
    double sum = 0;
    for (int i = 0; i <= frames; ++i)
      sum += (run.positions[static_cast<std::size_t>(i)] -
              truth.positions[static_cast<std::size_t>(i * kReferenceSteps)])
                 .squaredNorm();
    Counts counts;
    counts.stages = 100;
    counts.iterations = std::lround(100 * run.iterations_per_stage);
    table.AddRow("bob_joint_coordinates", fmt::format("k={:g} a={:g}", k, amplitude),
                 Settings(scheme, Newton::kResidual), 1, std::sqrt(sum / (frames + 1)), run.energy_left,
                 run.energy_gain, counts);
  }
}

}  // namespace

int Main(int argc, char** argv) {
  std::string only, path;
  for (int i = 1; i < argc; ++i) {
    if (std::strncmp(argv[i], "--only=", 7) == 0)
      only = argv[i] + 7;
    else
      path = argv[i];
  }
  Table table(path);
  const auto wanted = [&](const char* name) { return std::string(name).starts_with(only); };
  const std::vector<int> all{1, 2, 4};
  const std::vector<ConstraintForm> both{ConstraintForm::kRate, ConstraintForm::kPosition};
  if (wanted("bob"))
    for (const double a : {0.1, 0.8})
      for (const double k : {2e3, 2e4, 1e6, 1e8}) Compare(table, Bob(k, a), Scheme::kTrBdf2, all);
  if (wanted("bob_joint"))
    for (const double a : {0.1, 0.8})
      for (const double k : {2e3, 2e4, 1e6, 1e8}) ComparePolarBob(table, k, a);
  if (wanted("pendulum"))
    for (const double a : {0.1, 0.8}) Compare(table, Pendulum(a), Scheme::kTrBdf2, all, "", {}, both);
  if (wanted("double")) Compare(table, DoublePendulum(), Scheme::kTrBdf2, all, "", {}, both);
  if (wanted("four")) Compare(table, FourBar(), Scheme::kTrBdf2, all, "", {}, both);
  if (wanted("rolling"))
    Compare(table, RollingBall(), Scheme::kTrBdf2, all, "deepest_mm",
            [](const Run& r) { return 1e3 * r.deepest; });
  if (wanted("tray"))
    for (const double k : {1e4, 1e6, 1e8}) Compare(table, Tray(k), Scheme::kTrBdf2, all);
  const Measure deepest = [](const Run& r) { return 1e3 * r.deepest; };
  if (wanted("standing"))
    for (const double a : {0.1, 0.2})
      Compare(table, StandingLeg(a), Scheme::kSdirk2, all, "deepest_mm", deepest);
  if (wanted("oscillator"))
    for (const double f : {1., 3., 8.}) Compare(table, Oscillator(f), Scheme::kTrBdf2, {1});
  const std::vector<ConstraintForm> rate{ConstraintForm::kRate};
  if (wanted("servo"))
    for (const double k : {1e2, 1e4, 1e6})
      Compare(
          table, Servo(k), Scheme::kSdirk2, all, "overshoot", [](const Run& r) { return r.overshoot; }, rate,
          true);
  if (wanted("overlap"))
    for (const double depth : {1e-4, 1e-3})
      Compare(
          table, Overlap(depth), Scheme::kSdirk2, all, "height_mm",
          [](const Run& r) { return 1e3 * r.highest; }, rate, true);
  if (wanted("random"))
    for (const double factor : {1., 1e3, 1e6})
      for (const Scheme scheme : kSchemes)
        for (const Newton newton : kNewtons) {
          StepSettings s = Settings(scheme, newton);
          CompareRandomTrees(table, factor, s);
          if (scheme != Scheme::kTrBdf2) continue;
          s.start_rate = StartRate::kRestart;
          CompareRandomTrees(table, factor, s);
        }
  if (wanted("bouncing")) Compare(table, BouncingBall(), Scheme::kSdirk2, all, "deepest_mm", deepest);
  if (wanted("sliding"))
    Compare(table, SlidingBall(), Scheme::kTrBdf2, all, "sideways_mm",
            [](const Run& r) { return 1e3 * std::abs(r.end.poses[0].x.y()); });
  if (wanted("stack"))
    Compare(table, Stack(), Scheme::kSdirk2, {1}, "drift_mm", [](const Run& r) {
      const std::size_t from = r.frames.size() > 60 ? 60 : 0;
      double drift = 0;
      for (std::size_t i = 0; i < r.end.poses.size(); ++i)
        drift = std::max(drift, (r.end.poses[i].x - r.frames[from][i].x).norm());
      return 1e3 * drift;
    });
  if (wanted("grasp"))
    Compare(table, Grasp(), Scheme::kSdirk2, all, "drift_mm", [](const Run& r) {
      return 1e3 * (r.end.poses[0].x - r.frames[r.frames.size() > 60 ? 60 : 0][0].x).norm();
    });
  if (wanted("tumbling"))
    Compare(table, Tumbling(), Scheme::kTrBdf2, all, "angular_momentum",
            [](const Run& r) { return r.angular_drift; });
  if (wanted("landing"))
    for (const double k : {1e3, 1e4, 1e6})
      Compare(table, Landing(k), Scheme::kSdirk2, all, "deepest_mm", deepest, rate, true);
  if (wanted("landing_whole"))  // without substeps of impacts
    for (const double k : {1e3, 1e4})
      for (const Scheme scheme : kSchemes)
        for (const int n : all) {
          Case c = Landing(k);
          c.name = "landing_whole";
          StepSettings s = Settings(scheme, Newton::kResidual);
          s.substep_impacts = false;
          const Run truth = Simulate(c, Settings(Scheme::kSdirk2, Newton::kResidual), kReferenceSteps);
          const Run run = Simulate(c, s, n);
          table.Add(c, s, n, run, Error(c, run, truth), "deepest_mm", 1e3 * run.deepest);
        }
  return 0;
}

}  // namespace fork1s::lab

int main(int argc, char** argv) { return fork1s::lab::Main(argc, argv); }
