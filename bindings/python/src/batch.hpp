// Many simulations of one model, stepped together on threads.
#pragma once

#include <cstdint>
#include <fork1s/sim/randomisation.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "released_gil.hpp"
#include "runner.hpp"
#include "sensor_values.hpp"
#include "sim/member_pool.hpp"

namespace fork1s::python {

/// What a step tells of every simulation, an entry each.
struct BatchReport {
  std::vector<int> contacts;  // in the last step
  std::vector<double> max_penetration, residual;
  std::vector<int> unconverged;
  std::vector<char> finite;
  double wall = 0;  // s, of all steps together
};

/// How the members differ.
struct MemberDifferences {
  Randomisation ranges;                              // what seeds draw from
  std::vector<std::uint64_t> seeds;                  // one each; empty: nothing is drawn
  std::map<std::string, std::vector<double>> given;  // factors, one each, by the key of SetFactor
};

/// A force on a point that moves with a body, its origin, through all steps of a call.
struct MemberPushes {
  int body = 0;              // place in Simulation::bodies()
  std::vector<Vector6> F_W;  // of each member [moment; force], N·m and N, world axes
};

/// A moment of a batch to come back to.
struct BatchSnapshot {
  double dt = 0;  // s
  std::vector<Simulation::Snapshot> simulations;
  std::vector<Drawn> drawn;
};

/// Members share worlds but no state (fork1s::internal::MemberPool), so results do not depend on the number of threads.
///
/// Methods that work on the members release the GIL before they lock them, and end within 0.1 s of a signal
/// whose handler raises, or after the step at hand of a member if that is longer; they throw what it raised.
class Batch {
 public:
  /// threads: 0 for all cores. A factor that is given counts in place of the one that is drawn. Throws
  /// Refused.
  Batch(std::shared_ptr<const Model> model, int count, MemberDifferences differences,
        const RunOptions& options, int threads);

  /// All that a batch goes on from.
  struct Content {
    BatchContent simulations;
    int threads = 0;
    Randomisation ranges;
    std::vector<std::uint64_t> seeds, times;
    std::vector<Drawn> drawn;
  };
  Content GetContent() const;
  /// Goes on from there with the same bits. Throws Refused.
  Batch(std::shared_ptr<const Model> model, Content content);

  int size() const { return count_; }
  int threads() const { return threads_; }
  const std::shared_ptr<const Model>& model() const { return model_; }
  const Randomisation& ranges() const { return ranges_; }
  bool has_seeds() const { return has_seeds_; }
  const std::vector<std::string>& control_names() const { return control_names_; }

  /// controls: size() rows of control_names(), or null: as they are. A call that a signal ends leaves members
  /// that have made different numbers of these steps.
  /// move: as Runner::Step.
  BatchReport Step(const double* controls, int steps, bool move, const std::vector<MemberPushes>& pushes);
  BatchSnapshot Save() const;
  /// Members whose entry of `mask` is set go to the moment of the member that `sources` names, with its factors; their
  /// seeds stay. Throws Refused for a moment of another model or dt.
  void Restore(const BatchSnapshot& moment, const std::vector<char>& mask, const std::vector<int>& sources);
  /// The same, to a moment of a simulation of the model. Throws Refused where a member has other factors than 1.
  void Restore(const Runner::Snapshot& moment, const std::vector<char>& mask);
  /// Members whose entry of `mask` is set go on from these positions and velocities of the joints of the file, rows of
  /// all members; null: as they are. Throws Refused, and then leaves all as they were.
  void SetState(const std::vector<char>& mask, const double* qpos, const double* qvel);
  /// Simulations whose entry of `mask` is set begin again: with what their seed draws next, or, where seeds
  /// are given, draws first. Without any seed they keep their factors, but for those that are given.
  void Reset(const std::vector<char>& mask, const MemberDifferences& differences);
  /// What the members were drawn as, and by which seeds.
  std::vector<Drawn> Draws() const;
  std::vector<std::uint64_t> Seeds() const;
  /// f(i, simulation) for all, on threads; f writes to what is its own.
  void ForAll(const std::function<void(int, const Simulation&)>& f) const;
  /// f(simulation) for the first, where all are alike.
  void ForFirst(const std::function<void(const Simulation&)>& f) const;
  /// Of all members at their present states.
  SensorValues ReadSensors();

 private:
  /// Makes the members, each by what was drawn.
  void Begin(ReleasedGil& gil);
  // work(i) on threads for all members whose entry of `mask` is set, where check() succeeds. Throws the first error as
  // Refused.
  void ForChosen(const std::vector<char>& mask, const std::function<Expected<void>()>& check,
                 const std::function<Expected<void>(std::size_t)>& work);
  void ResetInTurn(ReleasedGil& gil, const std::vector<char>& mask, const MemberDifferences& differences);
  // Calls work(i) of every member on threads until it returns true: it ends early, at a whole step, where a
  // pause is due. False after an interruption, which leaves members out.
  bool OnThreads(ReleasedGil& gil, const std::function<bool(int)>& work) const;
  // Likewise, for work that makes members.
  bool MakeOnThreads(ReleasedGil& gil, const std::function<void(int)>& make) const;

  const std::shared_ptr<const Model> model_;
  const int count_, threads_;
  const bool has_seeds_;
  const SimulationOptions options_;  // of each, before starts are drawn
  const Randomisation ranges_;
  // Below: with mutex_ held.
  std::vector<std::uint64_t> seeds_, times_;  // of each, and how often it has begun before; empty: none
  std::vector<Drawn> drawn_;
  mutable fork1s::internal::MemberPool members_;
  mutable CallMutex mutex_;
  std::vector<std::string> control_names_;  // of all, from the start
};

}  // namespace fork1s::python
