// Time stepping schemes made of one implicit stage (multibody.hpp).
#pragma once

#include "multibody.hpp"

namespace fork1s::lab {

enum class Scheme { kEuler, kSdirk2, kTrBdf2, kBdf2 };

/// What the explicit half of TR-BDF2 takes as the rate of momentum at the start of a step: that of the last
/// stage, that with applied forces evaluated again, which sees inputs that have jumped, or that of the last
/// stage while it is that of the start: the first step, and those after an impact or a jump of inputs, are
/// steps of SDIRK2.
enum class StartRate { kLastStage, kAppliedAnew, kRestart };

struct StepSettings {
  Scheme scheme = Scheme::kSdirk2;
  StageSettings stage;
  StartRate start_rate = StartRate::kLastStage;
  bool substep_impacts = true;  // four backward Euler stages where something is met at more than g h/8
};

class Stepper {
 public:
  Stepper(const System& system, const State& state, const StepSettings& settings);
  void Step(double h);

  System& system() { return system_; }
  const State& state() const { return state_; }
  const Counts& counts() const { return counts_; }
  double deepest() const { return deepest_; }  // of all contacts at the end of all stages [m]

 private:
  StageInput BaseAtState(double b) const;
  void Solve(const StageInput& input);
  void TakeScheme(double h);
  void TakeSdirk2(double h);
  void TakeEuler(double h, const VectorX& restitution_speed = {});
  void UpdateClosed();

  System system_, system_before_;  // with the inputs of this step and of the last
  State state_, previous_;
  StepSettings settings_;
  Counts counts_;
  bool has_rate_ = false, has_previous_ = false;
  std::vector<char> loaded_;  // contacts that carried load in any stage of the step
  double deepest_ = 0;
};

}  // namespace fork1s::lab
