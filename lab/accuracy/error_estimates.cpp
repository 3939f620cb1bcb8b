// The live error estimate against the error itself.
#include <algorithm>
#include <cmath>
#include <fork1s/sim/error_estimate.hpp>
#include <lab/accuracy.hpp>

#include "study/runs.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

constexpr double kFrame = 1.0 / 60;  // s

using BodyPlaces = std::vector<std::vector<Vector3>>;  // frame, body

Expected<BodyPlaces> TruePath(const Scene& scene, const std::vector<TrackedBody>& tracked, RunOptions options,
                              int substeps) {
  BodyPlaces path;
  for (int k = 1; k <= 2; ++k) {
    options.substeps = k * substeps;
    auto run = internal::RunFull(scene, tracked, options);
    if (!run) return tl::unexpected(run.error());
    path.resize(run->samples.size(), std::vector<Vector3>(tracked.size(), Vector3::Zero()));
    for (std::size_t i = 0; i < path.size(); ++i)
      for (std::size_t b = 0; b < tracked.size(); ++b)
        path[i][b] += (k == 1 ? -1 : 2) * run->samples[i].X_WB[b].translation();
  }
  return path;
}

}  // namespace

Expected<std::vector<ErrorEstimateCurve>> MeasureErrorEstimate(const TransientCase& c,
                                                               const std::vector<Integrator>& integrators,
                                                               int substeps) {
  FORK1S_REQUIRE(substeps >= 1, substeps);
  RunOptions o;
  o.interval = kFrame;
  o.samples = static_cast<int>(std::llround(c.time / kFrame));
  o.controls = &c.controls;
  o.full_integrator = FullIntegrator::kEuler;  // TruePath() extrapolates errors of first order
  o.initial_keyframe = c.initial_keyframe;
  std::vector<ErrorEstimateCurve> curves;
  std::vector<TrackedBody> tracked;
  BodyPlaces truth;
  for (const Integrator integrator : integrators) {
    o.integrator = integrator;
    o.substeps = 1;
    auto made = internal::MakeReduced(c.scene, o);
    if (!made) return tl::unexpected(made.error());
    Simulation& s = *made;
    c.controls.Start(s);
    auto created = ErrorEstimate::Create(s);
    if (!created) return tl::unexpected(created.error());
    ErrorEstimate& estimate = *created;
    const std::size_t count = estimate.bodies().size(), first = curves.size();
    if (truth.empty()) {
      for (const BodyError& b : estimate.bodies())
        tracked.push_back({b.body, s.FindBody(b.body), b.mechanism >= 0});
      auto path = TruePath(c.scene, tracked, o, substeps);
      if (!path) return tl::unexpected(path.error());
      truth = std::move(*path);
    }
    for (const TrackedBody& b : tracked) curves.push_back({c.name, b.name, integrator, {}});
    std::vector<std::vector<double>> error(count, {0});  // m
    std::vector<double> motion(count, 0);
    for (std::size_t i = 1; i < truth.size(); ++i) {
      c.controls.Apply(s.time() + s.dt(), s);
      const StepReport report = s.Step();
      if (!report.finite) return Fail(ErrorCode::kNumerics, c.name, "gave numbers that are not finite");
      estimate.Follow(s, report);
      for (std::size_t b = 0; b < count; ++b) {
        error[b].push_back((truth[i][b] - s.Pose(tracked[b].index).translation()).norm());
        motion[b] = std::max(motion[b], (truth[i][b] - truth[0][b]).norm());
        const auto window = static_cast<std::size_t>(std::lround(ErrorEstimateOptions{}.window / kFrame));
        const auto from = error[b].end() - static_cast<std::ptrdiff_t>(std::min(error[b].size(), window));
        curves[first + b].points.push_back({static_cast<double>(i) * kFrame, 1e3 * estimate.bodies()[b].shown,
                                            1e3 * *std::max_element(from, error[b].end()), 1e3 * motion[b]});
      }
    }
  }
  return curves;
}

EstimateShare ShareInside(const ErrorEstimateCurve& curve) {
  EstimateShare share;
  const double whole = curve.points.empty() ? 0 : curve.points.back().motion_mm;
  for (const auto& p : curve.points) {
    if (std::max(p.shown_mm, p.true_mm) < 2e-4 * whole) continue;
    ++share.all;
    const bool told_large = p.shown_mm > 0.1 * p.motion_mm && p.true_mm > 0.05 * p.motion_mm;
    share.inside += told_large || (p.shown_mm >= 0.5 * p.true_mm && p.shown_mm <= 3 * p.true_mm) ? 1 : 0;
  }
  return share;
}

}  // namespace fork1s
