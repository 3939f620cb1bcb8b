// The error estimate of a run: gathered step by step, told at its end.
#pragma once

#include <fork1s/sim/error_estimate.hpp>
#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <string>
#include <vector>

#include "output.hpp"

namespace fork1s::app {

class ErrorWatch {
 public:
  /// Before Simulation::Step.
  void Begin(const Simulation& simulation);
  void End(const Simulation& simulation, const StepReport& report);
  /// The simulation was built anew: what it missed before is forgotten.
  void Forget();

  /// Of all bodies [m].
  struct Largest {
    double total = 0, interior = 0, time = 0, motion = 0;
    bool finite = true;
  };
  Largest largest() const;

  /// `error_estimate_mm` and `error_estimate_percent`.
  void AddTo(Json& summary) const;
  /// Sentences where the figure is none.
  std::vector<std::string> Warnings() const;

 private:
  struct Body {
    std::string name;
    bool is_interface = true;
    double total = 0, interior = 0, time = 0;  // m, largest
    double last = 0, motion = 0;               // m
  };
  void Keep();

  std::optional<ErrorEstimate> estimate_;
  std::vector<Body> bodies_;
  bool forgot_ = false, failed_ = false;
  std::string refused_;  // why there is no estimate
};

/// The lines that `run` prints for the keys of AddTo.
void PrintErrorEstimate(const Json& summary);

}  // namespace fork1s::app
