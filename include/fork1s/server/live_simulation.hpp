// A simulation that viewers watch and touch: commands in, snapshots out. No network, no clock.
#pragma once

#include <fork1s/server/command.hpp>
#include <fork1s/server/live_settings.hpp>
#include <fork1s/server/snapshot.hpp>
#include <fork1s/server/wire.hpp>
#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

class LiveSimulation {
 public:
  /// `title` is shown on the page. Errors as of Simulation::Create.
  static Expected<LiveSimulation> Create(Scene scene, const SimulationOptions& options,
                                         const std::string& title);

  /// Carries out a command. Returns a sentence for the viewer who asked if it cannot be, and changes nothing
  /// then.
  std::optional<std::string> Handle(const Command& command);
  /// One frame of 1/60 s times the speed, unless paused. Stops early when `wall_budget` [s] is spent.
  void Advance(double wall_budget);
  bool paused() const { return paused_; }
  const Simulation& simulation() const { return simulation_; }
  const LiveSettings& settings() const { return settings_; }
  /// Pulls and pushes of the last step.
  const std::vector<ShownPull>& pulls() const { return shown_; }
  /// Sentence on why the simulation stopped by itself, once.
  std::optional<std::string> TakeFault();

  Snapshot Capture(int viewers);

 private:
  struct Pull {
    int viewer, body;
    Vector3 point_B, target_W;
    Vector3 force_W = Vector3::Zero();
  };
  struct Push {
    int body;
    Vector3 point_B, force_W;
    int steps_left;
  };

  explicit LiveSimulation(Simulation simulation) : simulation_(std::move(simulation)) {}
  Expected<void> Rebuild(const LiveSettings& settings, bool keep_state);
  KeyframeDef PresentState() const;
  std::optional<std::string> HandleSet(const Command& command);
  std::optional<std::string> HandleInterfaces(const Command& command);
  bool StepOnce();
  void ApplyPulls();
  void ApplyTargets();
  void AfterBuild();
  void EncodeChangedMaps();
  std::string SceneMessage() const;
  std::string SettingsMessage() const;

  Scene original_;
  SimulationOptions options_;
  std::string title_;
  LiveSettings settings_;
  Simulation simulation_;
  VectorX targets_;  // controls as the sliders stand; a driven base moves there at a bounded speed
  std::vector<RigidTransform> base_origin_;  // per mechanism: pose from which its base sliders count
  std::vector<RigidTransform> base_start_;   // and from which this simulation's base controls do
  double time_offset_ = 0, carry_ = 0;       // s
  double steps_before_ = 0;
  std::optional<Pull> pull_;
  std::vector<Push> pushes_;
  std::vector<ShownPull> shown_;
  bool paused_ = false, step_requested_ = false;
  std::optional<std::string> fault_;

  FrameScalars scalars_;
  double real_time_share_ = 1;
  Snapshot latest_;
  std::vector<VectorX> encoded_reference_;
};

}  // namespace fork1s
