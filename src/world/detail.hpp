// The insides of a World: what it holds between steps, and the parts of a step.
#pragma once

#include <array>
#include <fork1s/world/world.hpp>
#include <memory>
#include <string>
#include <vector>

#include "adhesion.hpp"
#include "assembly.hpp"
#include "bodies.hpp"
#include "contact_history.hpp"
#include "detection.hpp"
#include "impact.hpp"
#include "impulse_sums.hpp"
#include "part_clock.hpp"
#include "ports.hpp"
#include "refresh.hpp"
#include "rows.hpp"
#include "stage_residual.hpp"
#include "switched_closures.hpp"
#include "world/island_solver.hpp"

namespace fork1s {

struct World::Detail {
  void Save(WorldState& out) const;
  void Restore(const WorldState& state);
  void RestoreContacts(const WorldState& state);
  bool IsFinite(bool poses);
  StepSubject FindNotFinite() const;
  StepReport UndoStep(WorldState& start, StepReport report);
  Expected<void> BuildCollision(const Scene& scene, const Options& options);
  bool PrepareContacts(const StepOptions& options, StepReport& report);
  // The step (stages.cpp).
  void SetInputsOfPart(const WorldState& start, double h, double share_start, double share_end);
  void BeginStep(double h);
  StepReport StepByStages(const StepOptions& options);
  // What may be met within a stage (reach.cpp).
  bool MayHavePassed(double h);
  void RecordStageStart(bool of_step);
  bool PrepareContactsAtStageStart(const StepOptions& stage, StepReport& report);
  bool CoversMotion();
  HalvingCause SolveStage(const StepOptions& options, StageScheme scheme, StepReport& report);
  HalvingCause FindStageEvent(const StepOptions& options, StageScheme scheme, int iteration,
                              StepReport& report) const;
  void MoveAllToStagePoses(double b, double time);
  void StoreStage(double b, StageScheme scheme, StepReport& report);
  double DampingOf(std::size_t mechanism) const;
  StepReport HalveOrUndo(const StepOptions& options, HalvingCause cause, const StepReport& attempt);
  StepReport FinishStep(const StepOptions& options, WorldState& start, StepReport report);
  void SumImpulses(double weight);
  // Impacts.
  ImpactView Impacts() const { return {detection_, history_, rows_, approaches_}; }
  void SolveContacts(const StepOptions& options, StepReport& report);
  bool UpdateActiveSet(const StepOptions& options);
  void PredictAllAgain(double h);
  void RecordContacts(double h);

  Bodies bodies_;
  Detection detection_;
  std::vector<std::string> warnings_;

  IslandSolver solver_;
  std::vector<ContactPoint> start_points_;  // of the start of the step
  std::vector<ContactRecord> contacts_;
  double contacts_h_ = 0;  // s, of the step that gave them their impulses
  ContactHistory history_;
  Approaches approaches_;
  StageAtHand stage_;
  NewtonIteration newton_;

  ConstraintRows rows_;
  std::vector<StopHistory> stops_;  // per mechanism
  std::vector<Adhesion> adhesions_;
  std::vector<SwitchedClosure> closures_;
  std::vector<SwitchedClosureRecord> closure_records_;
  std::vector<RefreshState> refreshes_;
  std::vector<char> finite_;  // per mechanism, by IsFinite
  struct {                    // forces with bounds and springs with slack
    bool any = false;
    std::vector<FreeBody::Velocity> free_velocity;  // of free bodies before contact
  } switches_;
  ImpulseSums sums_;  // of stages and parts of the step so far
  ContactSummation summation_;
  // A step that contains an event is halved up to this often (docs/decisions/001-time-stepping.md); the
  // shortest parts are one stage of backward Euler each. Where such a stage does not converge it is halved
  // further.
  static constexpr int kMaxEventHalvings = 3, kMaxHalvings = 6;
  struct Halving {
    struct Level {
      WorldState start;  // of the step that is halved
      ImpulseSums sums;  // until then
    };
    std::array<Level, kMaxHalvings + 1> levels;
    int depth = 0;      // halvings of the step at hand
    WorldState before;  // of the step at hand
    PredictedImpact predicted;
  };
  Halving halving_;
  const WorldState* step_start_ = nullptr;  // of `halving_`, where the last step began
  StepPartTimes* times_ = nullptr;
};

}  // namespace fork1s
