#include "study/stability.hpp"
#include "stable_runs.hpp"

#include <algorithm>

namespace fork1s {
namespace internal {
namespace {

// What a stable run keeps to.
struct Bounds {
  double speed = 0;     // m a sample
  double turn = 0;      // rad a sample
  double distance = 0;  // m from the same body in the reference
};

double Turn(const RigidTransform& X, const RigidTransform& Y) {
  return LogRotation(X.rotation().transpose() * Y.rotation()).norm();
}

Bounds BoundsOf(const Run& run) {
  Bounds b;
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < run.samples.size(); ++i)
    for (std::size_t k = 0; k < run.samples[i].X_WB.size(); ++k) {
      const RigidTransform& X = run.samples[i].X_WB[k];
      box.extend(X.translation());
      if (i == 0) continue;
      const RigidTransform& before = run.samples[i - 1].X_WB[k];
      b.speed = std::max(b.speed, (X.translation() - before.translation()).norm());
      b.turn = std::max(b.turn, Turn(before, X));
    }
  b.speed = 3 * b.speed + 1 * kLargestStep;
  b.turn = 3 * b.turn + 30 * kLargestStep;
  b.distance = box.diagonal().norm();
  return b;
}

}  // namespace

bool IsStable(const Run& run, const Run& reference) {
  const Bounds bounds = BoundsOf(reference);
  for (std::size_t i = 1; i < run.samples.size(); ++i)
    for (std::size_t k = 0; k < run.samples[i].X_WB.size(); ++k) {
      const RigidTransform &X = run.samples[i].X_WB[k], &before = run.samples[i - 1].X_WB[k];
      const double off = (X.translation() - reference.samples[i].X_WB[k].translation()).norm();
      // Written so that numbers that are not finite fail.
      if (!((X.translation() - before.translation()).norm() <= bounds.speed)) return false;
      if (!(Turn(before, X) <= bounds.turn)) return false;
      if (!(off <= bounds.distance)) return false;
    }
  return true;
}

Expected<std::optional<Run>> FirstStable(const Run& reference,
                                         const std::function<Expected<Run>(int halvings)>& simulate) {
  for (int k = 0; k <= kHalvings; ++k) {
    Expected<Run> run = simulate(k);
    if (!run && run.error().code != ErrorCode::kNumerics) return tl::unexpected(run.error());
    if (run && IsStable(*run, reference)) return std::optional<Run>(std::move(*run));
  }
  return std::optional<Run>();
}

}  // namespace internal

using internal::FirstStable;
using internal::Run;
using internal::RunOptions;
using internal::TrackedBody;

Expected<std::vector<StabilityRow>> MeasureStability(const std::string& path, const ControlTrack& controls,
                                                     double time_s, const std::vector<double>& scales) {
  std::vector<StabilityRow> rows;
  for (const double scale : scales) {
    ImportOptions import;
    import.stiffness_scale = scale;
    auto imported = LoadMechanism(path, import);
    if (!imported) return tl::unexpected(imported.error());
    const Scene& scene = imported->scene;
    RunOptions o;
    o.interval = internal::kLargestStep;
    o.samples = std::max(1, static_cast<int>(std::llround(time_s / internal::kLargestStep)));
    o.initial_keyframe = imported->initial_keyframe;
    o.controls = &controls;
    o.energy = false;
    o.mujoco_stiffness = scale;
    auto probe = internal::MakeReduced(scene, o);
    if (!probe) return tl::unexpected(probe.error());
    if (const auto missing = controls.FindMissing(*probe); !missing.empty())
      return Fail(ErrorCode::kModel, path, "has no control '" + missing.front() + "'");
    const std::vector<TrackedBody> tracked = internal::TrackedBodies(*probe);
    const auto truth = internal::RunFull(scene, tracked, o);
    if (!truth && truth.error().code == ErrorCode::kNumerics) continue;  // nothing to hold runs against
    if (!truth) return tl::unexpected(truth.error());
    const auto add = [&](const char* simulator, auto simulate) -> Expected<void> {
      auto run = FirstStable(*truth, simulate);
      if (!run) return tl::unexpected(run.error());
      rows.push_back({simulator, scale, *run ? (*run)->dt : 0});
      return {};
    };
    Expected<void> added;
    for (const auto& [simulator, integrator] :
         {std::pair{"fork1s", Integrator::kTwoStage}, {"fork1s euler", Integrator::kEuler}})
      if (added)
        added = add(simulator, [&](int k) {
          RunOptions at = o;
          at.substeps = 1 << k;
          at.integrator = integrator;
          return internal::RunReduced(scene, tracked, at);
        });
    for (const auto& [simulator, integrator] : {std::pair{"MuJoCo discrete", MuJoCoIntegrator::kDiscrete},
                                                {"MuJoCo implicitfast", MuJoCoIntegrator::kImplicitFast}})
      if (added)
        added = add(simulator, [&](int k) {
          RunOptions at = o;
          at.mujoco_integrator = integrator;
          return internal::RunMuJoCo(path, scene, tracked, internal::kLargestStep / (1 << k), at);
        });
    if (!added) return tl::unexpected(added.error());
  }
  return rows;
}

}  // namespace fork1s
