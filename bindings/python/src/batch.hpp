// Many simulations of one model, stepped together on threads.
#pragma once

#include <fork1s/sim/vary.hpp>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "runner.hpp"

namespace fork1s::python {

/// What a step tells of every simulation, an entry each.
struct BatchReport {
  std::vector<int> contacts;  // in the last step
  std::vector<double> max_penetration, residual;
  std::vector<int> unconverged;
  std::vector<char> finite;
  double wall = 0;  // s, of all steps together
};

/// The members never share anything that moves, so results do not depend on the number of threads.
class Batch {
 public:
  /// One simulation for each of the factors. threads: 0 for all cores. Throws Refused.
  Batch(std::shared_ptr<const Model> model, std::vector<SceneFactors> factors, const RunOptions& options,
        int threads);

  int size() const { return static_cast<int>(factors_.size()); }
  int threads() const { return threads_; }
  const std::shared_ptr<const Model>& model() const { return model_; }
  const std::vector<SceneFactors>& factors() const { return factors_; }
  const std::vector<std::string>& control_names() const { return control_names_; }

  /// controls: size() rows of control_names(), or null: as they are.
  BatchReport Step(const double* controls, int steps);
  /// Simulations whose entry of `mask` is set begin anew, with these factors.
  void Reset(const std::vector<char>& mask, const std::vector<SceneFactors>& factors);
  /// f(i, simulation) for all, on threads; f writes to what is its own.
  void ForAll(const std::function<void(int, const Simulation&)>& f) const;

 private:
  void OnThreads(const std::function<void(int)>& work) const;
  Expected<Simulation> Begin(const SceneFactors& factors) const;

  std::shared_ptr<const Model> model_;
  RunOptions options_;
  int threads_ = 0;
  std::vector<SceneFactors> factors_;
  std::vector<std::string> control_names_;
  mutable std::mutex mutex_;
  std::vector<Simulation> simulations_;
};

}  // namespace fork1s::python
