#include "batch.hpp"

#include <chrono>
#include <fork1s/parallel/parallel_for.hpp>
#include <optional>

#include "errors.hpp"

namespace fork1s::python {
namespace {

// A few at a time, so that threads share the work evenly though some hold contacts and others fall.
constexpr int kAtATime = 4;

void TakeGiven(const MemberDifferences& differences, std::size_t i, SceneFactors& factors) {
  double* const all[3] = {&factors.stiffness, &factors.friction, &factors.mass};
  for (std::size_t k = 0; k < 3; ++k)
    if (!differences.given[k].empty()) *all[k] = differences.given[k][i];
}

}  // namespace

void Batch::OnThreads(const std::function<void(int)>& work) const {
  WithThreads(threads_, [&] {
    ParallelFor(0, size(), kAtATime, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) work(i);
    });
  });
}

Batch::Batch(std::shared_ptr<const Model> model, int count, MemberDifferences differences,
             const RunOptions& options, int threads)
    : model_(std::move(model)),
      threads_(threads),
      starts_(Take(Starts::Create(model_->scene(), OptionsOf(*model_, options), differences.ranges.start),
                   model_->origin())),
      ranges_(differences.ranges),
      seeds_(differences.seeds),
      times_(differences.seeds.size(), 0),
      drawn_(static_cast<std::size_t>(count)) {
  for (std::size_t i = 0; i < drawn_.size(); ++i) {
    drawn_[i].start = VectorX::Zero(static_cast<Eigen::Index>(ranges_.start.size()));
    if (!seeds_.empty()) drawn_[i] = Draw(ranges_, seeds_[i]);
    TakeGiven(differences, i, drawn_[i].factors);
  }
  std::vector<std::optional<Expected<Simulation>>> made(drawn_.size());
  OnThreads([&](int i) {
    const auto at = static_cast<std::size_t>(i);
    made[at] = starts_.Begin(drawn_[at]);
  });
  simulations_.reserve(made.size());
  for (auto& m : made) simulations_.push_back(Take(std::move(*m), model_->origin()));
  control_names_ = simulations_.front().control_names();
}

BatchReport Batch::Step(const double* controls, int steps) {
  const auto count = drawn_.size();
  const auto width = static_cast<Eigen::Index>(control_names_.size());
  BatchReport all{std::vector<int>(count), std::vector<double>(count), std::vector<double>(count),
                  std::vector<int>(count), std::vector<char>(count)};
  const auto start = std::chrono::steady_clock::now();
  const std::lock_guard lock(mutex_);
  OnThreads([&](int i) {
    const auto at = static_cast<std::size_t>(i);
    Simulation& simulation = simulations_[at];
    if (controls) simulation.SetControls(Eigen::Map<const VectorX>(controls + i * width, width));
    StepsReport report;
    for (int n = 0; n < steps && report.finite; ++n) report.Add(simulation.Step());
    all.contacts[at] = report.contacts;
    all.max_penetration[at] = report.max_penetration;
    all.residual[at] = report.residual;
    all.unconverged[at] = report.unconverged;
    all.finite[at] = report.finite;
  });
  all.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return all;
}

void Batch::Reset(const std::vector<char>& mask, const MemberDifferences& differences) {
  const std::lock_guard lock(mutex_);
  std::vector<std::uint64_t> seeds = seeds_, times = times_;
  std::vector<Drawn> drawn = drawn_;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    if (!mask[i]) continue;
    if (!seeds.empty()) {
      times[i] = differences.seeds.empty() ? times[i] + 1 : 0;
      if (!differences.seeds.empty()) seeds[i] = differences.seeds[i];
      drawn[i] = Draw(ranges_, seeds[i], times[i]);
    }
    TakeGiven(differences, i, drawn[i].factors);
  }
  std::vector<std::optional<Expected<Simulation>>> made(drawn.size());
  OnThreads([&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (mask[at]) made[at] = starts_.Begin(drawn[at]);
  });
  // All or none: a scene that cannot be begun leaves everything as it was.
  for (const auto& m : made)
    if (m && !*m) throw Refused{m->error()};
  for (std::size_t i = 0; i < made.size(); ++i)
    if (made[i]) simulations_[i] = std::move(**made[i]);
  seeds_ = std::move(seeds);
  times_ = std::move(times);
  drawn_ = std::move(drawn);
}

void Batch::ForAll(const std::function<void(int, const Simulation&)>& f) const {
  const std::lock_guard lock(mutex_);
  OnThreads([&](int i) { f(i, simulations_[static_cast<std::size_t>(i)]); });
}

}  // namespace fork1s::python
