// The insides of a World: what it holds between steps, and the parts of a step.
#pragma once

#include <array>
#include <fork1s/world/island_solver.hpp>
#include <fork1s/world/world.hpp>
#include <memory>
#include <string>
#include <vector>

#include "bodies.hpp"
#include "contact_history.hpp"
#include "detection.hpp"
#include "impact.hpp"
#include "impulse_sums.hpp"
#include "part_clock.hpp"
#include "ports.hpp"
#include "rows.hpp"

namespace fork1s {

/// How well an implicit stage is solved at the pose found.
struct StageResidual {
  double ratio = 0;     // largest residual, in tolerances
  double largest = 0;   // m
  StepSubject subject;  // of the largest ratio
  // Every residual is: too small to matter, as the motion goes; within its tolerance or a share of the length
  // that noise may leave.
  bool is_negligible = true, is_small = true;
  bool is_slow = false;  // the iteration contracts so slowly that a new matrix is worth its cost
};

struct World::Detail {
  StepReport Step(const StepOptions& options);
  void Save(WorldState& out) const;
  void Restore(const WorldState& state);
  bool IsFinite(bool poses);
  StepSubject FindNotFinite() const;
  static void ForgetInputs(WorldState& state);
  StepReport UndoStep(WorldState& start, StepReport report);
  Expected<void> BuildCollision(const Scene& scene, const Options& options);
  bool PrepareContacts(const StepOptions& options, StepReport& report);
  // The step (stages.cpp).
  void BeginStep(double h);
  StepReport StepByStages(const StepOptions& options);
  enum class StageScheme { kFirstOfTwo, kSecondOfTwo, kBackwardEuler };
  // What may be met within a stage (reach.cpp).
  bool MayHavePassed();
  void RecordStageStart(bool of_step);
  bool PrepareContactsAtStageStart(const StepOptions& stage, StepReport& report);
  bool CoversMotion();
  bool PassesStop() const;
  HalvingCause SolveStage(const StepOptions& options, StageScheme scheme, StepReport& report);
  HalvingCause FindStageEvent(const StepOptions& options, StageScheme scheme, int iteration, StepReport& report) const;
  void MoveAllToStagePoses(double b, double time);
  StageResidual MoveAndComputeResiduals(const StepOptions& stage, StageScheme scheme, double time,
                                        bool is_first);
  bool ChangesSaturation(double b, StepReport& report);
  void StoreStage(double b, StageScheme scheme, StepReport& report);
  StepReport HalveOrUndo(const StepOptions& options, HalvingCause cause, const StepReport& attempt);
  StepReport FinishStep(const StepOptions& options, WorldState& start, StepReport report);
  void SumImpulses(double weight);
  void StartRows(double b);
  void Rebound(double h);
  // Impacts.
  ImpactView Impacts() const { return {detection_, history_, rows_, approaches_}; }
  void RecordStops(double h);
  void RecordStartGaps();
  void AssembleConstraints(const StepOptions& options);
  void AssembleContact(std::size_t contact, const StepOptions& options);
  void AssembleLimits(const StepOptions& options);
  void FillLimits(std::size_t mechanism, const StepOptions& options);
  void SolveContacts(const StepOptions& options, StepReport& report);
  bool UpdateSwitches(const StepOptions& options);
  void PredictAllAgain(double h);
  // Forces with bounds in the contact solve (bounded_forces.cpp).
  void AddBoundedForceRows(double h);
  void SolveWithSidesFound(double h);
  void AssembleBoundedForces(double h);
  void RecordContacts(double h);
  void GatherContactImpulses(std::size_t mechanism);
  void RefreshIfStale(std::size_t mechanism, double h);
  void CountRefreshes(StepReport& report) const;
  int WorthAThread() const;

  Bodies bodies_;
  Detection detection_;
  std::vector<std::string> warnings_;

  IslandSolver solver_;
  std::vector<ContactPoint> start_points_;  // of the start of the step
  std::vector<ContactRecord> contacts_;
  double contacts_h_ = 0;  // s, of the step that gave them their impulses
  ContactHistory history_;
  Approaches approaches_;
  bool in_stage_ = false;             // contacts and rows are those of the pose that a stage is linearised at
  bool is_backward_euler_ = false;    // the step at hand, or its part, is one stage
  bool all_stops_ = false;            // all stops are rows
  bool from_stage_start_ = false;     // rows are those of the pose where the stage starts
  // Of Newton's iteration, as measured last: [1] in the second of two stages, whose matrix is older, [0] in
  // others.
  std::array<double, 2> contraction_ = {1, 1};
  std::vector<StageChange> stage_changes_;  // of bodies_.mechanisms

  ConstraintRows rows_;
  std::vector<StopHistory> stops_;  // per mechanism
  // Of mechanisms: a new reference at the end of a step.
  struct Refresh {
    Matrix6X contact_impulses_R;  // of the last stage, 6 x bodies, about R's origin
    LinearizationDrift drift;     // for which there was one
    int result = 0;               // at the end of the last step: 1 done, -1 failed
  };
  std::vector<Refresh> refreshes_;
  std::vector<char> finite_;                       // per mechanism, by IsFinite
  std::vector<FreeBody::Velocity> free_velocity_;  // of free bodies before contact, where forces have bounds
  bool has_switches_ = false;
  WorldState before_;  // of the step at hand
  ImpulseSums sums_;  // of its stages and parts so far
  ContactSummation summation_;
  // A step that contains an event is halved up to this often (docs/decisions/001-time-stepping.md); the
  // shortest parts are one stage of backward Euler each. Where such a stage does not converge it is halved
  // further.
  static constexpr int kMaxEventHalvings = 3, kMaxHalvings = 6;
  struct Halving {
    WorldState start;  // of the step that is halved
    ImpulseSums sums;  // until then
  };
  std::array<Halving, kMaxHalvings + 1> halvings_;
  int depth_ = 0;  // halvings of the step at hand
  StepPartTimes* times_ = nullptr;
};

}  // namespace fork1s
