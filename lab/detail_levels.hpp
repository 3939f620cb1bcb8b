// One scene at every level of detail: what a step costs, how far it strays from the full model.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/sim/fidelity.hpp>
#include <string>
#include <vector>

namespace fork1s {

struct DetailRow {
  Fidelity fidelity;
  int modes = 0;  // kept, of all mechanisms
  int interface_bodies = 0;
  int coordinates = 0;   // velocities that a step solves for
  double switch_ms = 0;  // from the level before; 0 where the run began with it
  double step_us = 0;    // median, from the switch on
  /// Origins of the scene's interface and free bodies against the full run at the same step, from `from_s`
  /// on.
  double rms_mm = 0, max_mm = 0;
  double motion_mm = 0;     // RMS over the same samples of how far the full run has them from its start
  int refreshes = 0;        // from the switch on
  double joint_gap_mm = 0;  // largest, on the recovered poses
};

/// Runs `folder`/`name`.xml with `folder`/`name`.csv, if there is one, at 1/60 s for `time_s`, once for every
/// one of `levels`. Each run goes as the file says until `from_s` and takes the level then, so that something
/// is held for DetailLevel::kObject. Errors: as of LoadMechanism, ReadControls, Simulation::Create and
/// SetFidelity.
Expected<std::vector<DetailRow>> MeasureDetail(const std::string& folder, const std::string& name,
                                               double from_s, double time_s,
                                               const std::vector<Fidelity>& levels);

std::string DetailCsv(const std::string& scene, const std::vector<DetailRow>& rows);
std::string DetailMarkdown(const std::vector<DetailRow>& rows);
/// The same by recovery, a scene after the other.
std::string RecoveryMarkdown(const std::vector<std::pair<std::string, std::vector<DetailRow>>>& scenes);

}  // namespace fork1s
