#include "batch.hpp"

#include <chrono>
#include <fork1s/parallel/parallel_for.hpp>
#include <fork1s/sim/control_move.hpp>
#include <optional>

#include "errors.hpp"

namespace fork1s::python {
namespace {

// A few at a time, so that threads share the work evenly though some hold contacts and others fall.
constexpr int kAtATime = 4;

// A member takes memory for contacts as it meets them: reserving it for the most that a member may ever have
// would be the larger part of a batch.
SimulationOptions MemberOptions(const Model& model, const RunOptions& given) {
  SimulationOptions options = OptionsOf(model, given);
  options.reserved_contacts = 0;
  return options;
}

void TakeGiven(const MemberDifferences& differences, std::size_t i, SceneFactors& factors) {
  double* const all[3] = {&factors.stiffness, &factors.friction, &factors.mass};
  for (std::size_t k = 0; k < 3; ++k)
    if (!differences.given[k].empty()) *all[k] = differences.given[k][i];
}

}  // namespace

// Calls work() alone. Throws Refused in a signal handler that runs within such work of the same thread.
template <class Work>
void Batch::InTurn(const Work& work) const {
  const std::thread::id self = std::this_thread::get_id();
  if (thread_at_work_ == self)
    throw Refused{{ErrorCode::kUsage, "Batch",
                   "a signal handler cannot use a batch whose `step` or `reset` it interrupts; use it after "
                   "that call"}};
  const std::lock_guard lock(mutex_);
  thread_at_work_ = self;
  struct AtEnd {
    std::atomic<std::thread::id>& thread;
    ~AtEnd() { thread = std::thread::id(); }
  } const at_end{thread_at_work_};
  work();
}

// False after an interruption, which leaves members out.
bool Batch::OnThreads(ReleasedGil& gil, const std::function<void(int)>& work) const {
  WithThreads(threads_, [&] {
    ParallelFor(0, size(), kAtATime, [&](int begin, int end) {
      for (int i = begin; i < end && !gil.IsInterrupted(); ++i) work(i);
    });
  });
  return !gil.IsInterrupted();
}

bool Batch::MakeOnThreads(ReleasedGil& gil, const std::function<void(int)>& make) const {
  WithThreads(threads_, [&] {
    ParallelForFixedShares(0, size(), [&](int i) {
      if (!gil.IsInterrupted()) make(i);
    });
  });
  return !gil.IsInterrupted();
}

Batch::Batch(std::shared_ptr<const Model> model, int count, MemberDifferences differences,
             const RunOptions& options, int threads)
    : model_(std::move(model)),
      threads_(threads),
      starts_(Take(Starts::Create(model_->scene(), MemberOptions(*model_, options), differences.ranges.start),
                   model_->origin())),
      ranges_(differences.ranges),
      seeds_(differences.seeds),
      times_(differences.seeds.size(), 0),
      drawn_(static_cast<std::size_t>(count)) {
  ReleasedGil gil;
  for (std::size_t i = 0; i < drawn_.size(); ++i) {
    drawn_[i].start = VectorX::Zero(static_cast<Eigen::Index>(ranges_.start.size()));
    if (!seeds_.empty()) drawn_[i] = Draw(ranges_, seeds_[i]);
    TakeGiven(differences, i, drawn_[i].factors);
  }
  std::vector<std::optional<Expected<Simulation>>> made(drawn_.size());
  MakeOnThreads(gil, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    made[at] = starts_.Begin(drawn_[at]);
  });
  gil.ThrowIfInterrupted();
  simulations_.reserve(made.size());
  for (auto& m : made) simulations_.push_back(Take(std::move(*m), model_->origin()));
  control_names_ = simulations_.front().control_names();
}

BatchReport Batch::Step(const double* controls, int steps, bool move) {
  const auto count = drawn_.size();
  const auto width = static_cast<Eigen::Index>(control_names_.size());
  BatchReport all{std::vector<int>(count), std::vector<double>(count), std::vector<double>(count),
                  std::vector<int>(count), std::vector<char>(count)};
  const auto start = std::chrono::steady_clock::now();
  ReleasedGil gil;
  InTurn([&] {
    OnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      Simulation& simulation = simulations_[at];
      if (controls) simulation.SetControls(Eigen::Map<const VectorX>(controls + i * width, width));
      StepsReport report;
      std::optional<ControlMove> moving;
      if (move && steps > 0) moving.emplace(simulation, steps);
      for (int n = 0; n < steps && report.finite && !gil.IsInterrupted(); ++n)
        report.Add(moving ? moving->Step(simulation) : simulation.Step(), simulation.world());
      all.contacts[at] = report.contacts;
      all.max_penetration[at] = report.max_penetration;
      all.residual[at] = report.residual;
      all.unconverged[at] = report.unconverged;
      all.finite[at] = report.finite;
    });
  });
  gil.ThrowIfInterrupted();
  all.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return all;
}

void Batch::Reset(const std::vector<char>& mask, const MemberDifferences& differences) {
  ReleasedGil gil;
  InTurn([&] { ResetInTurn(gil, mask, differences); });
  gil.ThrowIfInterrupted();
}

void Batch::ResetInTurn(ReleasedGil& gil, const std::vector<char>& mask,
                        const MemberDifferences& differences) {
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
  // One after the other in place, so that no memory is taken beside that of the members. All or none: what is
  // replaced already when one cannot begin, or a signal comes, is made again as it was.
  std::vector<std::optional<Simulation::Snapshot>> replaced(drawn.size());
  std::vector<std::optional<Error>> errors(drawn.size());
  std::atomic<bool> failed = false;
  const bool complete = MakeOnThreads(gil, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (!mask[at] || failed) return;
    Expected<Simulation> next = starts_.Begin(drawn[at]);
    if (next) {
      replaced[at] = simulations_[at].Save();
      simulations_[at] = std::move(*next);
    } else {
      errors[at] = next.error();
      failed = true;
    }
  });
  if (failed || !complete) {
    for (std::size_t i = 0; i < replaced.size(); ++i) {
      if (!replaced[i]) continue;
      simulations_[i] = Take(starts_.Begin(drawn_[i]), model_->origin());
      Take(simulations_[i].Restore(*replaced[i]), model_->origin());
    }
    for (std::optional<Error>& error : errors)
      if (error) throw Refused{std::move(*error)};
    return;
  }
  seeds_ = std::move(seeds);
  times_ = std::move(times);
  drawn_ = std::move(drawn);
}

void Batch::ForAll(const std::function<void(int, const Simulation&)>& f) const {
  ReleasedGil gil;
  InTurn([&] { OnThreads(gil, [&](int i) { f(i, simulations_[static_cast<std::size_t>(i)]); }); });
  gil.ThrowIfInterrupted();
}

}  // namespace fork1s::python
