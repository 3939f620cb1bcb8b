// How far the simulation is from the truth, estimated while it runs.
//
// docs/method.md, section 8. After every step the equations of motion of all coordinates are asked what is
// missing at the poses that the step found; a linear companion in all coordinates turns that into
// displacements.
#pragma once

#include <fork1s/base/index.hpp>
#include <fork1s/base/types.hpp>
#include <fork1s/world/world.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

struct ErrorEstimateOptions {
  double window = 0.25;        // s: what is shown is the largest of this time, since errors swing
  int refresh_every = 10;      // steps between tangents, at most
  double refresh_turn = 0.05;  // rad: tangents anew when a joint has turned by this since
};

/// By how much a body is estimated to be off. Displacements of the body's origin, truth minus simulation.
struct BodyError {
  std::string body;
  int mechanism = -1;                   // -1: a free body
  int index = 0;                        // body of the mechanism, or free body
  Vector3 interior = Vector3::Zero();   // m, world axes: of what the reduction leaves out
  Vector3 nonlinear = Vector3::Zero();  // m: of what bends past the pose that forces were linearised at
  Vector3 time = Vector3::Zero();       // m: of the time step
  double shown = 0;                     // m, largest |interior + nonlinear + time| within the window
  double shown_interior = 0, shown_nonlinear = 0, shown_time = 0;  // m, each part's own largest
  double motion = 0;                                               // m, largest way from the start so far
};

/// Watches a world. Begin before World::Step and End after it; nothing of the world changes by it.
class ErrorEstimate {
 public:
  ErrorEstimate(const World& world, const ErrorEstimateOptions& options = {});
  ~ErrorEstimate();
  ErrorEstimate(ErrorEstimate&&) noexcept;
  ErrorEstimate& operator=(ErrorEstimate&&) noexcept;

  void Begin(const World& world);
  void End(const World& world, const StepOptions& options, const StepReport& report);

  /// Interface bodies of all mechanisms, then free bodies. They speak of the pose one step ago.
  const std::vector<BodyError>& bodies() const;

 private:
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
