// The full-coordinate simulation beside the live one, on a thread of its own.
//
// It starts where the live simulation stands and then takes the same inputs, step by step: controls, gravity,
// and the forces of pulls and pushes on the same points of the bodies. What it cannot do in real time it does
// later, and says how far behind it is; nobody waits for it.
#pragma once

#include <fork1s/reference/full_simulation.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

struct GhostStart {
  Scene scene;                    // as the live simulation has it, its present state among the keyframes
  FullSimulationOptions options;  // names that keyframe
  /// Per mechanism the pose from which controls of a driven base count in the live simulation.
  std::vector<RigidTransform> base_start;
  std::vector<Vector3> p_WB;  // origins of all bodies
  double time = 0;            // s, of the live simulation
};

/// One step of the live simulation.
struct GhostStep {
  struct Load {
    int body = -1;  // place in Simulation::bodies()
    Vector3 point_B, force_W;
    Vector3 moment_W = Vector3::Zero();
  };
  VectorX controls;  // in the order of Simulation::control_names()
  Vector3 gravity_W;
  std::vector<Load> loads;
  std::vector<Vector3> p_WB;  // origins of all bodies after the step, to measure distances from
};

/// Where the full simulation has got to.
struct GhostView {
  std::vector<RigidTransform> X_WB;  // in the order of Simulation::bodies()
  double time = 0;                   // s
  double behind = 0;                 // s after the live simulation
  double distance = 0;               // m between the origins of the worst body, both at `time`
  int body = -1;                     // which one
  std::int64_t steps = 0;            // since the start
};

class FullGhost {
 public:
  /// Further behind than `most_behind` [s] it gives up, so that what it still has to do stays bounded.
  explicit FullGhost(double most_behind = 30);
  /// Waits for the step under way.
  ~FullGhost();
  FullGhost(const FullGhost&) = delete;
  FullGhost& operator=(const FullGhost&) = delete;

  /// Starts; whatever ran before is dropped. Returns at once, as do all others here.
  void Begin(GhostStart start);
  void End();
  bool on() const;
  void Push(GhostStep step);
  /// None before the full simulation is built.
  std::optional<GhostView> Newest() const;
  /// Why it ended by itself, once.
  std::optional<std::string> PopFault();

 private:
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
