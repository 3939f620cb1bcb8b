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

Starts StartsOf(const Model& model, const SimulationOptions& options, const Randomisation& ranges) {
  return ValueOrThrow(Starts::Create(model.scene(), options, ranges.start), model.origin());
}

void TakeGiven(const MemberDifferences& differences, std::size_t i, SceneFactors& factors) {
  for (const auto& [key, of_members] : differences.given) SetFactor(key, of_members[i], factors);
}

bool ScalesNothing(SceneFactors factors) {
  std::erase_if(factors.named, [](const auto& named) { return named.second == 1; });
  return factors == SceneFactors{};
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
      ranges_(differences.ranges),
      seeds_(differences.seeds),
      times_(differences.seeds.size(), 0),
      drawn_(static_cast<std::size_t>(count)),
      members_(StartsOf(*model_, options_, ranges_), drawn_.size()) {
  ReleasedGil gil;
  for (std::size_t i = 0; i < drawn_.size(); ++i) {
    drawn_[i].start = VectorX::Zero(static_cast<Eigen::Index>(ranges_.start.size()));
    if (!seeds_.empty()) drawn_[i] = Draw(ranges_, seeds_[i]);
    TakeGiven(differences, i, drawn_[i].factors);
  }
  Begin(gil);
}

void Batch::Begin(ReleasedGil& gil) {
  std::vector<Expected<void>> begun(drawn_.size());
  MakeOnThreads(gil, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    begun[at] = members_.Begin(at, drawn_[at]);
  });
  gil.ThrowIfInterrupted();
  for (Expected<void>& one : begun) ValueOrThrow(std::move(one), model_->origin());
  members_.Read(0, [&](const Simulation& simulation) { control_names_ = simulation.control_names(); });
}

Batch::Batch(std::shared_ptr<const Model> model, Content content)
    : model_(std::move(model)),
      count_(static_cast<int>(content.drawn.size())),
      threads_(content.threads),
      has_seeds_(!content.seeds.empty()),
      options_(WithoutReserve(content.simulations.options)),
      ranges_(std::move(content.ranges)),
      seeds_(std::move(content.seeds)),
      times_(std::move(content.times)),
      drawn_(std::move(content.drawn)),
      members_(StartsOf(*model_, options_, ranges_), drawn_.size()) {
  ReleasedGil gil;
  Begin(gil);
  for (std::size_t i = 0; i < drawn_.size(); ++i) {
    Simulation::Snapshot& moment = content.simulations.snapshots[i];
    if (!moment.made_of) ValueOrThrow(CompleteSnapshot(members_.Moment(i), "pickle of Batch", moment));
    ValueOrThrow(members_.Restore(i, moment, drawn_[i].factors), model_->origin());
  }
}

Batch::Content Batch::GetContent() const {
  Content content;
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] {
    content = {{options_, {}}, threads_, ranges_, seeds_, times_, drawn_};
    for (std::size_t i = 0; i < members_.size(); ++i) {
      content.simulations.snapshots.push_back(members_.Moment(i));
      // What has the detail that it began with is of the scene that is drawn again.
      if (!members_.HasOwnWorld(i)) content.simulations.snapshots.back().made_of.reset();
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
  std::vector<char> begun(count);
  const auto of_member = [&](std::size_t i) {
    return Eigen::Map<const VectorX>(controls + static_cast<Eigen::Index>(i) * width, width);
  };
  WithCallMutex(mutex_, "Batch", [&] {
    // Before the first is changed: what SetControls refuses.
    for (std::size_t i = 0; controls && i < count; ++i)
      if (const auto row = of_member(i); !row.allFinite())
        members_.Change(i, [&](Simulation& simulation) { simulation.SetControls(row); });
    OnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      bool complete = false;
      members_.Change(at, [&](Simulation& simulation) {
        if (!begun[at]) {
          if (controls) simulation.SetControls(of_member(at));
          if (move && steps > 0) moves[at].emplace(simulation, steps);
          begun[at] = true;
        }
        internal::StepTotals& report = reports[at];
        for (; made[at] < steps && report.finite; ++made[at]) {
          if (gil.IsPauseDue()) return;
          for (const MemberPushes& push : pushes)
            simulation.ApplyWrench(push.body, push.F_W[at].tail<3>(), push.F_W[at].head<3>(),
                                   simulation.Pose(push.body).translation());
          report.Add(moves[at] ? moves[at]->Step(simulation) : simulation.Step(), simulation.world());
        }
        complete = true;
      });
      return complete;
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
  // All or none: what is replaced already when one cannot begin, or a signal comes, goes back to where it was.
  std::vector<std::optional<Simulation::Snapshot>> replaced(drawn.size());
  std::vector<std::optional<Error>> errors(drawn.size());
  std::atomic<bool> failed = false;
  const bool complete = MakeOnThreads(gil, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (!mask[at] || failed) return;
    Simulation::Snapshot before = members_.Moment(at);
    if (auto begun = members_.Begin(at, drawn[at])) {
      replaced[at] = std::move(before);
    } else {
      errors[at] = begun.error();
      failed = true;
    }
  });
  if (failed || !complete) {
    WithThreads(threads_, [&] {
      ParallelForFixedShares(0, size(), [&](int i) {
        const auto at = static_cast<std::size_t>(i);
        if (replaced[at])
          ValueOrThrow(members_.Restore(at, *replaced[at], drawn_[at].factors), model_->origin());
      });
    });
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
    members_.Read(0, [&](const Simulation& simulation) { moment.dt = simulation.dt(); });
    moment.drawn = drawn_;
    for (std::size_t i = 0; i < members_.size(); ++i) moment.simulations.push_back(members_.Moment(i));
  });
  return moment;
}

void Batch::ForChosen(const std::vector<char>& mask, const std::function<Expected<void>()>& check,
                      const std::function<Expected<void>(std::size_t)>& work) {
  ReleasedGil gil;
  std::vector<std::optional<Error>> errors(static_cast<std::size_t>(count_));
  WithCallMutex(mutex_, "Batch", [&] {
    ValueOrThrow(check());
    OnThreads(gil, [&](int i) {
      const auto at = static_cast<std::size_t>(i);
      if (!mask[at]) return true;
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
  const auto check = [&] {
    Expected<void> fits;
    members_.Read(0, [&](const Simulation& simulation) { fits = FitsStep(moment.dt, simulation); });
    return fits;
  };
  ForChosen(mask, check, [&](std::size_t at) -> Expected<void> {
    const auto from = static_cast<std::size_t>(sources[at]);
    auto restored = members_.Restore(at, moment.simulations[from], moment.drawn[from].factors);
    if (restored) drawn_[at] = moment.drawn[from];
    return restored;
  });
}

void Batch::Restore(const Runner::Snapshot& moment, const std::vector<char>& mask) {
  const auto check = [&]() -> Expected<void> {
    Expected<void> fits;
    if (!moment.pushes.empty())
      return Fail(
          ErrorCode::kUsage, "restore",
          "the moment has pushes for the next call, which a batch takes by step(push=...); save it before "
          "Simulation.push");
    for (std::size_t at = 0; at < mask.size(); ++at)
      if (mask[at] && !ScalesNothing(drawn_[at].factors))
        return Fail(ErrorCode::kUsage, "restore",
                    "member " + std::to_string(at) +
                        " has factors of its own, with which the moment of a simulation is none of its; "
                        "use set_state, or a batch without seeds and factors");
    const auto first = static_cast<std::size_t>(std::find(mask.begin(), mask.end(), 1) - mask.begin());
    if (first == mask.size()) return fits;
    members_.Read(first, [&](const Simulation& simulation) {
      fits = FitsStep(moment.dt, simulation);
      if (fits) fits = FitsStiffness(moment, simulation);
    });
    return fits;
  };
  ForChosen(mask, check, [&](std::size_t at) { return members_.Restore(at, moment.simulation, {}); });
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
      members_.Read(at, [&](const Simulation& simulation) {
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
        next[at] = restarted->simulation.Save();
        // The member steps by the model of its world, which is that of all members with its factors, and not by
        // one of its own.
        for (MechanismState& mechanism : next[at]->world.mechanisms) mechanism.step_model.reset();
      });
    });
    for (std::optional<Error>& error : errors)
      if (error) throw Refused{std::move(*error)};
    if (!complete) return;
    for (std::size_t i = 0; i < next.size(); ++i) {
      if (next[i]) ValueOrThrow(members_.Restore(i, *next[i], drawn_[i].factors));
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

void Batch::ForFirst(const std::function<void(const Simulation&)>& f) const {
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] { members_.Read(0, f); });
}

void Batch::ForAll(const std::function<void(int, const Simulation&)>& f) const {
  ReleasedGil gil;
  WithCallMutex(mutex_, "Batch", [&] {
    OnThreads(gil, [&](int i) {
      members_.Read(static_cast<std::size_t>(i), [&](const Simulation& simulation) { f(i, simulation); });
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
      members_.ReadSensors(at, [&](const Sensors& sensors) {
        std::copy_n(sensors.values().data(), width,
                    read.values.begin() + static_cast<std::ptrdiff_t>(at * width));
        if (at > 0) return;
        for (std::size_t k = 0; k < read.reasons.size(); ++k)
          read.reasons[k] = sensors.definition(static_cast<int>(k)).reason;
      });
      return true;
    });
  });
  gil.ThrowIfInterrupted();
  return read;
}

}  // namespace fork1s::python
