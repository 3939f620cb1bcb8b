// What a FullSimulation holds.
#pragma once

#include <fork1s/mechanism/base_path.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "contact_set.hpp"
#include "free_body.hpp"
#include "full_mechanism.hpp"

namespace fork1s {

struct FullSimulation::Detail {
  Scene scene;
  FullSimulationOptions options;
  double dt = 0;
  std::int64_t steps = 0;
  std::vector<internal::FullMechanism> mechanisms;
  std::vector<internal::FullFreeBody> free_bodies;
  internal::ContactSet contact_set;
  std::vector<FullContact> contacts;
  std::vector<FullBody> bodies;
  std::vector<std::string> control_names, warnings;
  VectorX controls, control_lower, control_upper;
  std::vector<RigidTransform> base_start;

  Expected<void> AddMechanisms(const KeyframeDef* key);
  Expected<void> AddFreeBodies(const KeyframeDef* key);
  Expected<std::vector<std::vector<int>>> Interfaces() const;
  void AddControls(const KeyframeDef* key);
  void PassControls();
  FullStepReport Step();
  /// Solves a step or stage that `begin` opens; false where it does not come to an end with numbers that are
  /// finite.
  bool Solve(const std::function<bool()>& begin, FullStepReport& report);
  /// Newton on the whole step from the guess at hand; false where numbers are no longer finite.
  bool Iterate(bool stiffening, FullStepReport& report);

  // Of steps of two stages (two_stages.cpp). `from` and `to` are shares of the step.
  struct Saved {
    std::vector<internal::FullMechanism::State> mechanisms;
    std::vector<internal::FullFreeBody> free_bodies;
    internal::ContactSet::Memory contacts;
    std::vector<FullContact> told;
  };
  enum class Outcome { kDone, kMeets, kUnsolved };
  VectorX controls_before;
  VectorX activation;                       // as controls, of those with dynamics, at the start of a step
  std::vector<const ControlDef*> dynamics;  // of each control, null: none
  double ActivationAfter(Eigen::Index control, double share) const;
  // Driven bases, one a mechanism: poses at both ends of the step, the rate at its end where it is known, and the path.
  std::vector<RigidTransform> base_now, base_next;
  std::vector<std::optional<Vector6>> base_rate_next;
  std::vector<BaseHistory> base_history;
  std::vector<BasePath> base_path;
  VectorX base_rates;  // as Simulation::base_rates()
  void StartBasePaths();
  Saved Save() const;
  void Restore(const Saved& saved);
  FullStepReport StepByStages();
  bool OneStage(double from, double to, FullStepReport& report);
  bool Advance(double from, double to, int halvings, FullStepReport& report);
  Outcome TwoStages(double from, double to, FullStepReport& report);
  Outcome Stage(double from, double to, double end, bool second, FullStepReport& report);
  /// m/s; what comes no faster in a part of this length is no impact.
  double Slow(double part) const;
  void SetInputs(double share);
  void AddForces(double share, const std::vector<FullContact>& stage);
};

}  // namespace fork1s
