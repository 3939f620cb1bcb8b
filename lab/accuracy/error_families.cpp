#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/sim/error_estimate.hpp>
#include <lab/error_families.hpp>

#include "study/runs.hpp"

namespace fork1s {
namespace {

using internal::RunOptions;
using internal::TrackedBody;

constexpr double kFamilyStep = 1.0 / 60;               // s
constexpr double kSmallError = 2e-4;                   // of the motion: below it nobody asks
constexpr double kToldLarge = 0.1, kTrueLarge = 0.05;  // of the motion, as in EstimateShare
// The truth may be off by this share of the error, so that told over true is known to a quarter.
constexpr double kKnownShare = 0.25;
// Runs whose differences fall by less than this order do not approach each other: their contacts differ.
constexpr double kLeastOrder = 0.5;
constexpr double kHighestOrder = 3;  // of extrapolation; the step's own is two
constexpr int kManyModes = 10000;

using Paths = std::vector<std::vector<Vector3>>;  // frame, body

Expected<Paths> PathsOf(const TransientCase& c, const std::vector<TrackedBody>& tracked, RunOptions options,
                        int substeps, ErrorTruth truth) {
  options.substeps = substeps;
  Scene scene = c.scene;
  if (truth == ErrorTruth::kAllModes)
    for (MechanismDef& def : scene.mechanisms) def.modes = kManyModes;
  auto run = truth == ErrorTruth::kFull ? internal::RunFull(scene, tracked, options)
                                        : internal::RunReduced(scene, tracked, options);
  if (!run) return tl::unexpected(run.error());
  Paths paths;
  for (const internal::Sample& sample : run->samples) {
    paths.emplace_back();
    for (const RigidTransform& X : sample.X_WB) paths.back().push_back(X.translation());
  }
  return paths;
}

}  // namespace

ErrorShares& ErrorShares::operator+=(const ErrorShares& other) {
  small += other.small;
  without_truth += other.without_truth;
  not_quantified += other.not_quantified;
  inside += other.inside;
  below += other.below;
  above += other.above;
  return *this;
}

Expected<ErrorCaseResult> MeasureErrorCase(const TransientCase& c, ErrorFamily family, unsigned seed,
                                           ErrorTruth truth) {
  RunOptions o;
  o.interval = kFamilyStep;
  o.samples = static_cast<int>(std::llround(c.time / kFamilyStep));
  o.controls = &c.controls;
  o.initial_keyframe = c.initial_keyframe;
  auto made = internal::MakeReduced(c.scene, o);
  if (!made) return tl::unexpected(made.error());
  Simulation& s = *made;
  c.controls.Start(s);
  auto created = ErrorEstimate::Create(s);
  if (!created) return tl::unexpected(created.error());
  ErrorEstimate& estimate = *created;
  std::vector<TrackedBody> tracked;
  for (const BodyError& b : estimate.bodies())
    tracked.push_back({b.body, s.FindBody(b.body), b.mechanism >= 0});
  Paths fine[3];
  for (int k = 0; k < 3; ++k) {
    auto paths = PathsOf(c, tracked, o, 8 << k, truth);
    if (!paths) return tl::unexpected(paths.error());
    fine[k] = std::move(*paths);
  }

  ErrorCaseResult result{family, seed, {}, {}};
  const auto frames = static_cast<std::size_t>(o.samples) + 1;
  const std::size_t count = tracked.size();
  // What is shown is the largest of this many frames.
  const auto window = static_cast<std::size_t>(std::lround(ErrorEstimateOptions{}.window / kFamilyStep)) - 1;
  std::vector<std::vector<double>> error(count, {0}), unknown(count, {0});
  std::vector<double> coarse(count, 0), last(count, 0), motion(count, 0);
  struct Frame {
    WorstEstimate told;
    double unknown;
  };
  std::vector<std::vector<Frame>> told(count);
  for (std::size_t i = 1; i < frames; ++i) {
    c.controls.Apply(s.time() + s.dt(), s);
    const StepReport report = s.Step();
    if (!report.finite) return Fail(ErrorCode::kNumerics, c.name, "gave numbers that are not finite");
    estimate.Follow(s, report);
    for (std::size_t b = 0; b < count; ++b) {
      const BodyError& e = estimate.bodies()[b];
      const std::size_t from = i > window ? i - window : 0;
      const auto most = [&](const std::vector<double>& all) {
        return *std::max_element(all.begin() + static_cast<std::ptrdiff_t>(from), all.end());
      };
      // The truth of this frame, by the order up to here.
      coarse[b] = std::max(coarse[b], (fine[1][i][b] - fine[0][i][b]).norm());
      last[b] = std::max(last[b], (fine[2][i][b] - fine[1][i][b]).norm());
      const double order = coarse[b] > 0 && last[b] > 0 ? std::log2(coarse[b] / last[b]) : kHighestOrder;
      const double share = 1 / (std::exp2(std::clamp(order, kLeastOrder, kHighestOrder)) - 1);
      const Vector3 step = share * (fine[2][i][b] - fine[1][i][b]), exact = fine[2][i][b] + step;
      error[b].push_back((exact - s.Pose(tracked[b].index).translation()).norm());
      unknown[b].push_back(step.norm());
      motion[b] = std::max(motion[b], (exact - fine[2][0][b]).norm());
      WorstEstimate now{family, seed, e.body, s.time(), e.shown, most(error[b]), motion[b]};
      now.interior = e.shown_interior;
      now.step = e.shown_time;
      now.order = order;
      told[b].push_back({now, most(unknown[b])});
    }
  }
  for (std::size_t b = 0; b < count; ++b) {
    WorstEstimate worst;
    double worst_by = 0;
    for (const Frame& f : told[b]) {
      const WorstEstimate& t = f.told;
      ErrorShares& shares = result.shares;
      if (std::max(t.shown, t.error) < kSmallError * motion[b]) {
        ++shares.small;
      } else if (f.unknown > kKnownShare * t.error && f.unknown > kSmallError * motion[b]) {
        ++shares.without_truth;
      } else if (t.shown > kToldLarge * t.motion && t.error > kTrueLarge * t.motion) {
        ++shares.not_quantified;
      } else {
        const double ratio = t.ratio();
        ++(ratio < 0.5 ? shares.below : ratio > 3 ? shares.above : shares.inside);
        const double by = ratio > 1 ? ratio / 3 : 0.5 / std::max(ratio, 1e-9);
        if (by > worst_by) {
          worst_by = by;
          worst = t;
        }
      }
    }
    if (worst_by > 1) result.worst.push_back(worst);
  }
  return result;
}

Expected<std::vector<ErrorCaseResult>> MeasureErrorFamilies(const std::vector<ErrorFamily>& families,
                                                            unsigned first, unsigned count,
                                                            ErrorTruth truth) {
  FORK1S_REQUIRE(!families.empty(), families.size());
  std::vector<ErrorCaseResult> results;
  for (unsigned k = 0; k < count; ++k) {
    const ErrorFamily family = families[k % families.size()];
    auto result = MeasureErrorCase(DrawErrorCase(family, first + k), family, first + k, truth);
    if (!result) return tl::unexpected(result.error());
    results.push_back(std::move(*result));
  }
  return results;
}

std::string ErrorFamiliesMarkdown(const std::vector<ErrorCaseResult>& results) {
  std::string text =
      "| family | motions | body-frames | within [0.5, 3] | below 0.5 | above 3 | not quantified | no truth |\n"
      "|---|---|---|---|---|---|---|---|\n";
  const auto row = [&](const char* name, int motions, const ErrorShares& s) {
    const auto percent = [](int part, int all) {
      return all > 0 ? fmt::format("{:.1f} %", 100.0 * part / all) : std::string("-");
    };
    const int told = s.told(), all = told + s.not_quantified + s.without_truth;
    text += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} |\n", name, motions, told,
                        percent(s.inside, told), percent(s.below, told), percent(s.above, told),
                        percent(s.not_quantified, all), percent(s.without_truth, all));
  };
  ErrorShares sum;
  for (const ErrorFamily family : kErrorFamilies) {
    ErrorShares of_family;
    int motions = 0;
    for (const ErrorCaseResult& r : results) {
      if (r.family != family) continue;
      of_family += r.shares;
      ++motions;
    }
    if (motions > 0) row(Name(family), motions, of_family);
    sum += of_family;
  }
  row("all", static_cast<int>(results.size()), sum);
  return text;
}

std::string WorstEstimatesCsv(const std::vector<ErrorCaseResult>& results) {
  std::vector<WorstEstimate> all;
  for (const ErrorCaseResult& r : results) all.insert(all.end(), r.worst.begin(), r.worst.end());
  const auto by = [](const WorstEstimate& w) {
    return w.ratio() > 1 ? w.ratio() / 3 : 0.5 / std::max(w.ratio(), 1e-9);
  };
  std::stable_sort(all.begin(), all.end(),
                   [&](const WorstEstimate& a, const WorstEstimate& b) { return by(a) > by(b); });
  std::string text =
      "family,seed,body,time_s,told_over_true,told_mm,true_mm,motion_mm,interior_mm,step_mm,"
      "truth_order\n";
  for (const WorstEstimate& w : all)
    text += fmt::format("{},{},{},{:.3f},{:.3g},{:.4g},{:.4g},{:.4g},{:.3g},{:.3g},{:.2f}\n", Name(w.family),
                        w.seed, w.body, w.time, w.ratio(), 1e3 * w.shown, 1e3 * w.error, 1e3 * w.motion,
                        1e3 * w.interior, 1e3 * w.step, w.order);
  return text;
}

}  // namespace fork1s
