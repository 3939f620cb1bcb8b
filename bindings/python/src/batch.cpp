#include "batch.hpp"

#include <chrono>
#include <fork1s/parallel/parallel_for.hpp>
#include <optional>

#include "errors.hpp"

namespace fork1s::python {
namespace {

// A few at a time, so that threads share the work evenly though some hold contacts and others fall.
constexpr int kAtATime = 4;

}  // namespace

void Batch::OnThreads(const std::function<void(int)>& work) const {
  WithThreads(threads_, [&] {
    ParallelFor(0, size(), kAtATime, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) work(i);
    });
  });
}

Expected<Simulation> Batch::Begin(const SceneFactors& factors) const {
  return Simulation::Create(Vary(model_->scene(), factors), OptionsOf(*model_, options_));
}

Batch::Batch(std::shared_ptr<const Model> model, std::vector<SceneFactors> factors, const RunOptions& options,
             int threads)
    : model_(std::move(model)), options_(options), threads_(threads), factors_(std::move(factors)) {
  std::vector<std::optional<Expected<Simulation>>> made(factors_.size());
  OnThreads([&](int i) {
    const auto at = static_cast<std::size_t>(i);
    made[at] = Begin(factors_[at]);
  });
  simulations_.reserve(made.size());
  for (auto& m : made) simulations_.push_back(Take(std::move(*m), model_->origin()));
  control_names_ = simulations_.front().control_names();
}

BatchReport Batch::Step(const double* controls, int steps) {
  const auto count = factors_.size();
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

void Batch::Reset(const std::vector<char>& mask, const std::vector<SceneFactors>& factors) {
  const std::lock_guard lock(mutex_);
  std::vector<std::optional<Expected<Simulation>>> made(factors_.size());
  OnThreads([&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (mask[at]) made[at] = Begin(factors[at]);
  });
  // All or none: a scene that cannot be begun leaves everything as it was.
  for (const auto& m : made)
    if (m && !*m) throw Refused{m->error()};
  for (std::size_t i = 0; i < made.size(); ++i)
    if (made[i]) {
      simulations_[i] = std::move(**made[i]);
      factors_[i] = factors[i];
    }
}

void Batch::ForAll(const std::function<void(int, const Simulation&)>& f) const {
  const std::lock_guard lock(mutex_);
  OnThreads([&](int i) { f(i, simulations_[static_cast<std::size_t>(i)]); });
}

}  // namespace fork1s::python
