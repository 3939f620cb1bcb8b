// The steps of a linearization one by one, for whoever measures something after each of them.
#pragma once

#include <fork1s/sim/linearize.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fork1s::internal {

/// While it lives the simulation is its own, but for looking; then it is put back as it was, bit by bit.
///
///     auto steps = Linearization::Begin(simulation, options);   // of which `outcome` is not called; an Expected
///     while (*(*steps)->Advance()) (*steps)->SetOutcome(...);   // or an error
///     LinearizedStep found = (*steps)->Finish();
class Linearization {
 public:
  /// Errors: those of Linearize.
  static Expected<std::unique_ptr<Linearization>> Begin(Simulation& simulation, LinearizeOptions options);
  ~Linearization();
  Linearization(const Linearization&) = delete;
  Linearization& operator=(const Linearization&) = delete;

  /// The simulation stands at the end of the next step that is needed. False where none is.
  Expected<bool> Advance();
  /// Of the step just taken. Throws std::invalid_argument where others had another number of them.
  void SetOutcome(const VectorX& outcome);
  /// When all steps are taken.
  LinearizedStep Finish();

 private:
  struct End {
    VectorX dx, outcome;
    StepReport report;
    std::vector<std::string> stuck;  // as LinearizedStep's
  };
  // A force that the next step starts from: of a contact by its component [force; moment] in the contact's axes, or of
  // dry friction by its place among those of a mechanism.
  struct Force {
    int contact = -1, mechanism = -1, at = 0;
    double change = 0;  // N, N·m or N·s
  };
  struct State {
    std::vector<LinearizedStep::Reference> mechanisms, free_bodies;
    std::vector<Force> forces;
    std::vector<ContactRecord> contacts;
    std::vector<WorldState::Rows> rows;
  };

  Linearization(Simulation& simulation, LinearizeOptions options);
  void ListCoordinates();
  void ListInputs();
  void ListBase(const std::string& name, double length, std::vector<double>& changes);
  std::string NameOf(Eigen::Index variable) const;
  void ListForces();
  std::string NameOf(const Force& force) const;
  std::vector<Force> ForcesOf(const WorldState& state) const;
  State StateAt(const Simulation::Snapshot& moment) const;
  VectorX PresentDeviation(const WorldState& present) const;
  std::vector<std::string> StuckFrictions(const WorldState& present) const;
  VectorX VariationOf(int step) const;
  void MoveTo(const VectorX& variation);
  void Restore(const Simulation::Snapshot& moment);
  void CompareSides(Eigen::Index variable);
  std::string WhatSwitched() const;
  double SizeOf(const VectorX& dx) const;
  void DifferentiateOutputs();

  Simulation& simulation_;
  const LinearizeOptions options_;
  const StepOptions given_;
  const Simulation::Snapshot start_, closed_start_;  // as it was, and with loops closed to rounding
  Simulation::Snapshot moved_;
  bool has_friction_ = false;      // of joints or tendons
  WorldState present_;             // then, after the step just taken
  std::vector<MatrixX> inverses_;  // per mechanism, of the rows of dq/dz of its independent joints
  Eigen::Index size_ = 0;          // N
  std::vector<Force> forces_;
  // Variables: δx [N + q], inputs [m], their starts [m]. By how much each is varied, and derivatives.
  VectorX change_;
  MatrixX next_, outcome_;
  int taken_ = 0;      // steps: at x*, to both sides of each variable, and along all of them
  State counts_from_;  // what deviations after a step count from
  End at_rest_, sides_[2];
  LinearizedStep out_;
};

}  // namespace fork1s::internal
