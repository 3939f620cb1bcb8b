// A simulation that viewers watch and touch: commands in, snapshots out. No network, no clock.
#pragma once

#include <fork1s/sim/error_estimate.hpp>
#include <fork1s/sim/push.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/command.hpp"
#include "server/full_ghost.hpp"
#include "server/live_settings.hpp"
#include "server/model_file.hpp"
#include "server/past.hpp"
#include "server/snapshot.hpp"
#include "server/wire.hpp"

namespace fork1s {

/// Why a command was not carried out, for the viewer who asked.
struct Refusal {
  std::string sentence;
  bool passing = false;  // nothing is wrong with the model or the request; it only came at a bad time
};

/// What stopped by itself, for all viewers. `about`: "run" or "ghost", as in docs/wire.md.
struct LiveFault {
  std::string about, sentence;
};

/// A message for one viewer, or with viewer 0 for all, once.
struct LiveReply {
  int viewer = 0;
  std::string message;  // JSON, as in docs/wire.md
};

class InterpenetrationMonitor;

class LiveSimulation {
 public:
  /// `title` is shown on the page. Errors as of Simulation::Create.
  static Expected<LiveSimulation> Create(Scene scene, const SimulationOptions& options,
                                         const std::string& title, ModelFile file = {});

  /// From the start on, and from every reset, set-points follow the table and pushes act, as those of a run
  /// do; options given to Create have controls_move. A set-point that a viewer changes leaves the table until
  /// the next reset. Names that the simulation does not have are skipped. Before the first step.
  void Play(ControlTrack controls, PushTrack pushes);
  /// Carries out a command. Returns why not if it cannot be, and changes nothing then.
  std::optional<Refusal> Handle(const Command& command);
  /// Goes on with another model from its start: the file read again, say. Viewers, pause and speed stay, as do
  /// the counts of messages; settings are those of `next`.
  void Replace(LiveSimulation next);
  /// What is wrong with the model's file as it now is, for all viewers, until Replace; empty: nothing.
  void SetFileProblem(const std::string& sentence);
  /// One frame of 1/60 s times the speed, unless paused. Stops early when `wall_budget` [s] is spent.
  void Advance(double wall_budget);
  bool paused() const { return paused_; }
  const Simulation& simulation() const { return simulation_; }
  const LiveSettings& settings() const { return settings_; }
  /// The full simulation beside it; null before it was first switched on.
  const FullGhost* ghost() const { return ghost_.get(); }
  /// Pulls and pushes of the last step.
  const std::vector<ShownPull>& pulls() const { return shown_; }
  /// What stopped by itself, once.
  std::vector<LiveFault> PopFaults();
  /// What was written, what was found: to be sent.
  std::vector<LiveReply> PopReplies();

  /// The newest of everything. Without viewers the full simulation beside it is switched off.
  Snapshot Capture(int viewers);

 private:
  struct Pull {
    int viewer, body;
    Vector3 point_B, target_W;
    Vector3 reached_W;  // target at the end of the last step
  };
  struct Push {
    int body;
    Vector3 point_B, force_W;
    int steps_left;
  };

  explicit LiveSimulation(Simulation simulation) : simulation_(std::move(simulation)) {}
  Expected<void> Rebuild(LiveSettings settings, const KeyframeDef* state);
  Expected<void> ChangeFidelity(const LiveSettings& settings);
  KeyframeDef PresentState() const;
  KeyframeDef SetDown(KeyframeDef state) const;
  std::optional<Refusal> HandleSet(const Command& command);
  std::optional<Refusal> HandleHold();
  std::optional<Refusal> HandleInterfaces(const Command& command);
  std::optional<Refusal> HandleShape(const Command& command);
  std::optional<Refusal> HandleWrite(const Command& command);
  std::optional<Refusal> HandleResume(const Command& command);
  std::optional<Refusal> OrSay(const Expected<void>& done);
  bool StepOnce();
  void ApplyPulls();
  void ShowPull();
  void ApplyTargets();
  void StartTargets();
  void FollowTable(double time);
  void RemoveFromTable(Eigen::Index control);
  void ShowShapes(std::uint32_t version);
  void AfterBuild();
  void EncodeChangedMaps();
  void SwitchGhost(bool on);
  void BeginGhost();
  void StepGhost();
  void CaptureGhost(int viewers);
  // live_file.cpp, live_past.cpp, live_fidelity.cpp
  std::string TuningMessage() const;
  void ShowTuning();
  void StoreMoment();
  void ClearError();
  void BeginError();
  void EndError(const StepReport& report);
  void StoreAccuracy();
  void FindInterpenetrations();
  std::string SceneMessage() const;
  void PublishSettings();  // to every viewer
  std::string SettingsMessage() const;

  Scene original_;
  SimulationOptions options_;
  std::string title_;
  LiveSettings settings_;
  Simulation simulation_;
  VectorX targets_;  // controls as the sliders stand; a driven base moves there at a bounded speed
  std::vector<RigidTransform> base_origin_;  // per mechanism: pose from which its base sliders count
  std::vector<RigidTransform> base_start_;   // and from which this simulation's base controls do
  ControlTrack table_, played_;  // of Play, and what of it viewers have left to it; names of others are empty
  PushTrack table_pushes_;
  bool targets_moved_ = false;          // since the last settings told of the table
  double time_offset_ = 0, carry_ = 0;  // s
  double steps_before_ = 0;
  std::optional<Pull> pull_;
  std::vector<Push> pushes_;
  std::vector<ShownPull> shown_;
  bool paused_ = false, step_requested_ = false;
  std::vector<LiveFault> faults_;
  std::unique_ptr<FullGhost> ghost_;
  bool ghost_on_ = false;
  std::int64_t ghost_steps_ = -1;       // that the last message told
  std::vector<GhostStep::Load> loads_;  // of the step under way

  ModelFile file_;
  Past past_;
  std::vector<LiveReply> replies_;
  std::unique_ptr<ErrorEstimate> error_;
  std::shared_ptr<InterpenetrationMonitor> interpenetration_;  // of the present model
  std::string advised_;
  std::uint32_t chosen_at_ = 0;     // sequence of the last choice for the wanted accuracy
  double first_dt_ = 0;             // s
  std::vector<ServoShare> servos_;  // as the settings have them
  std::vector<double> signals_;     // of the frame under way

  FrameScalars scalars_;
  double real_time_share_ = 1;
  double simulated_ = 0, wanted_ = 0;  // s, of late
  double advanced_at_ = 0;             // s, wall clock; 0: not going on
  Snapshot latest_;
  std::vector<VectorX> encoded_reference_;
};

}  // namespace fork1s
