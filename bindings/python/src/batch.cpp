#include "batch.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fork1s/importer/file_state.hpp>
#include <fork1s/sim/control_move.hpp>
#include <optional>

#include "errors.hpp"
#include "parallel/parallel_for.hpp"
#include "sim/restart.hpp"

namespace fork1s::python {
namespace {

// A few at a time, so that threads share the work evenly though some hold contacts and others fall.
constexpr int kAtATime = 4;

// A member takes memory for contacts as it meets them: reserving it for the most that a member may ever have
// would be the larger part of a batch.
SimulationOptions WithoutReserve(SimulationOptions options) {
  options.reserved_contacts = 0;
  return options;
}
SimulationOptions MemberOptions(const Model& model, const RunOptions& given) {
  return WithoutReserve(OptionsOf(model, given));
}

void TakeGiven(const MemberDifferences& differences, std::size_t i, SceneFactors& factors) {
  double* const all[3] = {&factors.stiffness, &factors.friction, &factors.mass};
  for (std::size_t k = 0; k < 3; ++k)
    if (!differences.given[k].empty()) *all[k] = differences.given[k][i];
}

}  // namespace

bool Batch::OnThreads(ReleasedGil& gil, const std::function<bool(int)>& work) const {
  std::vector<char> done(static_cast<std::size_t>(count_));
  do {
    WithThreads(threads_, [&] {
      ParallelFor(0, size(), kAtATime, [&](int begin, int end) {
        for (int i = begin; i < end && !gil.IsPauseDue(); ++i)
          if (char& is_done = done[static_cast<std::size_t>(i)]; !is_done) is_done = work(i);
      });
    });
    if (std::find(done.begin(), done.end(), 0) == done.end()) return true;
  } while (!gil.Pause());
  return false;
}

bool Batch::MakeOnThreads(ReleasedGil& gil, const std::function<void(int)>& make) const {
  std::vector<char> done(static_cast<std::size_t>(count_));
  do {
    WithThreads(threads_, [&] {
      ParallelForFixedShares(0, size(), [&](int i) {
        char& is_done = done[static_cast<std::size_t>(i)];
        if (is_done || gil.IsPauseDue()) return;
        make(i);
        is_done = true;
      });
    });
    if (std::find(done.begin(), done.end(), 0) == done.end()) return true;
  } while (!gil.Pause());
  return false;
}

Batch::Batch(std::shared_ptr<const Model> model, int count, MemberDifferences differences,
             const RunOptions& options, int threads)
    : model_(std::move(model)),
      count_(count),
      threads_(threads),
      has_seeds_(!differences.seeds.empty()),
      options_(MemberOptions(*model_, options)),
      starts_(ValueOrThrow(Starts::Create(model_->scene(), options_, differences.ranges.start),
                           model_->origin())),
      ranges_(differences.ranges),
      seeds_(differences.seeds),
      times_(differences.seeds.size(), 0),
      drawn_(static_cast<std::size_t>(count)),
      sensors_(static_cast<std::size_t>(count)) {
  ReleasedGil gil;
  for (std::size_t i = 0; i < drawn_.size(); ++i) {
    drawn_[i].start = VectorX::Zero(static_cast<Eigen::Index>(ranges_.start.size()));
    if (!seeds_.empty()) drawn_[i] = Draw(ranges_, seeds_[i]);
    TakeGiven(differences, i, drawn_[i].factors);
  }
  Begin(gil);
}

void Batch::Begin(ReleasedGil& gil) {
  std::vector<std::optional<Expected<Simulation>>> made(drawn_.size());
  MakeOnThreads(gil, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    made[at] = starts_.Begin(drawn_[at]);
  });
  gil.ThrowIfInterrupted();
  simulations_.reserve(made.size());
  for (auto& m : made) simulations_.push_back(ValueOrThrow(std::move(*m), model_->origin()));
  control_names_ = simulations_.front().control_names();
}

Batch::Batch(std::shared_ptr<const Model> model, Content content)
    : model_(std::move(model)),
      count_(static_cast<int>(content.drawn.size())),
      threads_(content.threads),
      has_seeds_(!content.seeds.empty()),
      options_(WithoutReserve(content.simulations.options)),
      starts_(
          ValueOrThrow(Starts::Create(model_->scene(), options_, content.ranges.start), model_->origin())),
      ranges_(std::move(content.ranges)),
      seeds_(std::move(content.seeds)),
      times_(std::move(content.times)),
      drawn_(std::move(content.drawn)),
      sensors_(drawn_.size()) {
  ReleasedGil gil;
  Begin(gil);
  for (std::size_t i = 0; i < simulations_.size(); ++i) {
    Simulation::Snapshot& moment = content.simulations.snapshots[i];
    ValueOrThrow(CompleteSnapshot(simulations_[i], "pickle of Batch", moment));
    ValueOrThrow(simulations_[i].Restore(moment), model_->origin());
  }
}

Batch::Content Batch::GetContent() const {
  Content content;
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] {
    content = {{options_, {}}, threads_, ranges_, seeds_, times_, drawn_};
    for (const Simulation& simulation : simulations_) {
      content.simulations.snapshots.push_back(simulation.Save());
      // Members have the detail that they began with, so the scene is the one that is drawn again.
      content.simulations.snapshots.back().made_of.reset();
    }
  });
  return content;
}

BatchReport Batch::Step(const double* controls, int steps, bool move,
                        const std::vector<MemberPushes>& pushes) {
  const auto count = static_cast<std::size_t>(count_);
  const auto width = static_cast<Eigen::Index>(control_names_.size());
  BatchReport all{std::vector<int>(count), std::vector<double>(count), std::vector<double>(count),
                  std::vector<int>(count), std::vector<char>(count)};
  const auto start = std::chrono::steady_clock::now();
  ReleasedGil gil;
  // Of each member, across pauses.
  std::vector<internal::StepTotals> reports(count);
  std::vector<std::optional<ControlMove>> moves(count);
  std::vector<int> made(count);
  WithCallMutex(mutex_, "Batch", [&] {
    for (std::size_t i = 0; i < count; ++i) {
      if (controls)
        simulations_[i].SetControls(
            Eigen::Map<const VectorX>(controls + static_cast<Eigen::Index>(i) * width, width));
      if (move && steps > 0) moves[i].emplace(simulations_[i], steps);
    }
    OnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      Simulation& simulation = simulations_[at];
      internal::StepTotals& report = reports[at];
      for (; made[at] < steps && report.finite; ++made[at]) {
        if (gil.IsPauseDue()) return false;
        for (const MemberPushes& push : pushes)
          simulation.ApplyWrench(push.body, push.F_W[at].tail<3>(), push.F_W[at].head<3>(),
                                 simulation.Pose(push.body).translation());
        report.Add(moves[at] ? moves[at]->Step(simulation) : simulation.Step(), simulation.world());
      }
      return true;
    });
  });
  for (std::size_t i = 0; i < count; ++i) {
    all.contacts[i] = reports[i].contacts;
    all.max_penetration[i] = reports[i].max_penetration;
    all.residual[i] = reports[i].residual;
    all.unconverged[i] = reports[i].unconverged;
    all.finite[i] = reports[i].finite;
  }
  gil.ThrowIfInterrupted();
  all.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return all;
}

void Batch::Reset(const std::vector<char>& mask, const MemberDifferences& differences) {
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] { ResetInTurn(gil, mask, differences); });
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
      sensors_[at].reset();
      simulations_[at] = std::move(*next);
    } else {
      errors[at] = next.error();
      failed = true;
    }
  });
  if (failed || !complete) {
    for (std::size_t i = 0; i < replaced.size(); ++i) {
      if (!replaced[i]) continue;
      simulations_[i] = ValueOrThrow(starts_.Begin(drawn_[i]), model_->origin());
      sensors_[i].reset();
      ValueOrThrow(simulations_[i].Restore(*replaced[i]), model_->origin());
    }
    for (std::optional<Error>& error : errors)
      if (error) throw Refused{std::move(*error)};
    return;
  }
  seeds_ = std::move(seeds);
  times_ = std::move(times);
  drawn_ = std::move(drawn);
}

BatchSnapshot Batch::Save() const {
  BatchSnapshot moment;
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] {
    moment.dt = simulations_.front().dt();
    moment.drawn = drawn_;
    for (const Simulation& simulation : simulations_) moment.simulations.push_back(simulation.Save());
  });
  return moment;
}

void Batch::ForChosen(const std::vector<char>& mask, const MemberWork& check, const MemberWork& work) {
  ReleasedGil gil;
  std::vector<std::optional<Error>> errors(static_cast<std::size_t>(count_));
  WithCallMutex(mutex_, "Batch", [&] {
    for (std::size_t at = 0; at < mask.size(); ++at)
      if (mask[at]) ValueOrThrow(check(at));
    OnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      if (!mask[at]) return true;
      sensors_[at].reset();
      if (auto done = work(at); !done) errors[at] = done.error();
      return true;
    });
  });
  gil.ThrowIfInterrupted();
  for (std::optional<Error>& error : errors)
    if (error) throw Refused{std::move(*error)};
}

void Batch::Restore(const BatchSnapshot& moment, const std::vector<char>& mask,
                    const std::vector<int>& sources) {
  const auto check = [&](std::size_t at) { return FitsStep(moment.dt, simulations_[at]); };
  ForChosen(mask, check, [&](std::size_t at) -> Expected<void> {
    const auto from = static_cast<std::size_t>(sources[at]);
    if (!(drawn_[at].factors == moment.drawn[from].factors)) {
      Expected<Simulation> next = starts_.Begin(moment.drawn[from]);
      if (!next) return tl::unexpected(next.error());
      simulations_[at] = std::move(*next);
    }
    drawn_[at] = moment.drawn[from];
    return simulations_[at].Restore(moment.simulations[from]);
  });
}

void Batch::Restore(const Runner::Snapshot& moment, const std::vector<char>& mask) {
  const auto check = [&](std::size_t at) -> Expected<void> {
    if (auto fits = FitsStep(moment.dt, simulations_[at]); !fits) return fits;
    if (!(drawn_[at].factors == SceneFactors{}))
      return Fail(ErrorCode::kUsage, "restore",
                  "member " + std::to_string(at) +
                      " has factors of its own, with which the moment of a simulation is none of its; "
                      "use set_state, or a batch without seeds and factors");
    return FitsStiffness(moment, simulations_[at]);
  };
  ForChosen(mask, check, [&](std::size_t at) { return simulations_[at].Restore(moment.simulation); });
}

void Batch::SetState(const std::vector<char>& mask, const double* qpos, const double* qvel) {
  const std::vector<FileJoint>& joints = model_->joints();
  const Eigen::Index positions = model_->NumPositions(), velocities = model_->NumVelocities();
  ReleasedGil gil;
  std::vector<std::optional<Simulation::Snapshot>> next(static_cast<std::size_t>(count_));
  std::vector<std::optional<Error>> errors(static_cast<std::size_t>(count_));
  WithCallMutex(mutex_, "Batch", [&] {
    const bool complete = MakeOnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      if (!mask[at]) return;
      const Simulation& simulation = simulations_[at];
      KeyframeDef state = simulation.State();
      FileState file = ComputeFileState(joints, simulation.scene(), state);
      if (qpos) file.positions = Eigen::Map<const VectorX>(qpos + i * positions, positions);
      if (qvel) file.velocities = Eigen::Map<const VectorX>(qvel + i * velocities, velocities);
      if (auto done = ApplyFileState(joints, simulation.scene(), file, state); !done) {
        errors[at] = done.error();
        return;
      }
      auto restarted = fork1s::internal::RestartAt(simulation, state, model_->scene().keyframes.size());
      if (!restarted) {
        errors[at] = restarted.error();
        return;
      }
      // In the member's own scene, which has no keyframe more.
      const Simulation::Snapshot own = simulation.Save();
      next[at] = restarted->simulation.Save();
      next[at]->made_of = own.made_of;
      next[at]->keyframe = own.keyframe;
    });
    for (std::optional<Error>& error : errors)
      if (error) throw Refused{std::move(*error)};
    if (!complete) return;
    for (std::size_t i = 0; i < next.size(); ++i) {
      if (!next[i]) continue;
      ValueOrThrow(simulations_[i].Restore(*next[i]));
      sensors_[i].reset();
    }
  });
  gil.ThrowIfInterrupted();
}

std::vector<Drawn> Batch::Draws() const {
  std::vector<Drawn> now;
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] { now = drawn_; });
  return now;
}

std::vector<std::uint64_t> Batch::Seeds() const {
  std::vector<std::uint64_t> now;
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] { now = seeds_; });
  return now;
}

void Batch::ForAll(const std::function<void(int, const Simulation&)>& f) const {
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] {
    OnThreads(gil, [&](int i) {
      f(i, simulations_[static_cast<std::size_t>(i)]);
      return true;
    });
  });
  gil.ThrowIfInterrupted();
}

SensorValues Batch::ReadSensors() {
  SensorValues read;
  read.members = static_cast<std::size_t>(count_);
  read.first.push_back(0);
  for (const SensorDef& sensor : model_->scene().sensors) {
    read.names.push_back(sensor.name);
    read.reasons.emplace_back();
    read.first.push_back(read.first.back() + static_cast<std::size_t>(sensor.size));
  }
  const std::size_t width = read.first.back();
  read.values.resize(static_cast<std::size_t>(count_) * width);
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] {
    OnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      std::optional<Sensors>& sensors = sensors_[at];
      if (sensors)
        sensors->Update(simulations_[at]);
      else
        sensors.emplace(simulations_[at]);
      std::copy_n(sensors->values().data(), width,
                  read.values.begin() + static_cast<std::ptrdiff_t>(at * width));
      return true;
    });
    if (sensors_.front())
      for (std::size_t k = 0; k < read.reasons.size(); ++k)
        read.reasons[k] = sensors_.front()->definition(static_cast<int>(k)).reason;
  });
  gil.ThrowIfInterrupted();
  return read;
}

}  // namespace fork1s::python
