#include <cmath>
#include <lab/accuracy.hpp>

#include "study/runs.hpp"

namespace fork1s {
namespace {

using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

// Positions of all tracked bodies at all samples after the start, in m.
using Path = std::vector<Vector3>;

Path PathOf(const Run& run) {
  Path path;
  for (std::size_t i = 1; i < run.samples.size(); ++i)
    for (const RigidTransform& X : run.samples[i].X_WB) path.push_back(X.translation());
  return path;
}

double Rms(const Path& a, const Path& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

Path Extrapolated(const Path& fine, const Path& coarse) {
  Path out;
  for (std::size_t i = 0; i < fine.size(); ++i) out.emplace_back(2 * fine[i] - coarse[i]);
  return out;
}

}  // namespace

Expected<TransientCurve> MeasureTransient(const TransientCase& c, int halvings) {
  FORK1S_REQUIRE(halvings >= 1, halvings);
  RunOptions o;
  o.interval = 1.0 / 60;
  o.samples = static_cast<int>(std::llround(c.time / o.interval));
  o.controls = &c.controls;
  o.integrator = Integrator::kEuler;
  o.full_integrator = FullIntegrator::kEuler;  // Extrapolated() takes errors of first order
  auto probe = internal::MakeReduced(c.scene, o);
  if (!probe) return tl::unexpected(probe.error());
  std::vector<TrackedBody> tracked;
  for (std::size_t i = 0; i < probe->bodies().size(); ++i) {
    const SceneBody& b = probe->bodies()[i];
    if (b.is_interface || b.mechanism < 0) tracked.push_back({b.name, static_cast<int>(i), b.is_interface});
  }
  std::vector<Path> reduced, two_stage, full;
  Path start;
  for (int k = 0; k <= halvings + 1; ++k) {
    o.substeps = 1 << k;
    auto run = internal::RunFull(c.scene, tracked, o);
    if (!run) return tl::unexpected(run.error());
    full.push_back(PathOf(*run));
    if (k == 0)
      for (int i = 0; i < o.samples; ++i)
        for (const RigidTransform& X : run->samples[0].X_WB) start.push_back(X.translation());
    if (k > halvings) break;
    run = internal::RunReduced(c.scene, tracked, o);
    if (!run) return tl::unexpected(run.error());
    reduced.push_back(PathOf(*run));
    o.integrator = Integrator::kTwoStage;
    run = internal::RunReduced(c.scene, tracked, o);
    o.integrator = Integrator::kEuler;
    if (!run) return tl::unexpected(run.error());
    two_stage.push_back(PathOf(*run));
  }
  const auto last = full.size() - 1;
  const Path truth = Extrapolated(full[last], full[last - 1]);
  TransientCurve curve;
  curve.name = c.name;
  const double motion = Rms(truth, start);
  curve.motion_mm = 1e3 * motion;
  curve.truth_percent = 100 * Rms(truth, Extrapolated(full[last - 1], full[last - 2])) / motion;
  for (std::size_t k = 0; k < reduced.size(); ++k)
    curve.points.push_back({o.interval / (1 << k), 100 * Rms(reduced[k], truth) / motion,
                            100 * Rms(full[k], truth) / motion, 100 * Rms(reduced[k], full[k]) / motion,
                            100 * Rms(two_stage[k], truth) / motion});
  return curve;
}

}  // namespace fork1s
