// The largest stable time step of simulators on a model, against its stiffness.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// The largest stable step of one simulator at one stiffness.
///
/// A run is *stable* if it reaches its end with finite numbers (MuJoCo: without its warnings of bad
/// positions, speeds and accelerations) and if between two samples, 1/60 s apart, no interface or free body
/// ever
///   - moves more than three times as fast as the fastest of them in the full run at 1/60 s, plus 1 m/s,
///   - turns more than three times as fast as the fastest of them there, plus 30 rad/s,
///   - is farther from its place in that run than the diagonal of the box around all paths of that run.
/// Energy itself does not decide: MuJoCo's leaves out what servos hold, and motors put some in.
struct StabilityRow {
  std::string simulator;  // "fork1s" (two stages), "fork1s euler", "MuJoCo discrete", "MuJoCo implicitfast"
  double stiffness_scale = 1;
  double largest_stable_dt_s = 0;  // of 1/60 s and its halves down to 1/15360; 0: none was
};

/// With springs, servos and springy loops `scales` times as stiff and their dampers by the root, each factor
/// in a run of `time_s`. Errors: as of LoadMechanism and Simulation::Create; kModel for an unknown control.
Expected<std::vector<StabilityRow>> MeasureStability(const std::string& path, const ControlTrack& controls,
                                                     double time_s, const std::vector<double>& scales);

}  // namespace fork1s
