// Every scene by three simulators in one process, MuJoCo with two integrators: what a step costs, how long it
// may be, how far it strays.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

/// One scene by one simulator. Stable: as study/stability.hpp says, beside the full run at 1/60 s.
struct SceneRow {
  std::string scene;
  std::string simulator;  // "reduced", "full", "mujoco" with the file's integrator, "mujoco_discrete"
  int interface_bodies = 0;
  int bodies = 0;                  // of the scene that may move, the free ones and a driven base included
  int coordinates = 0;             // velocities that a step solves for, constraints not taken off
  double time_s = 0;               // simulated: the control table's length, at most the limit
  double dt_s = 0;                 // of the run that was timed: the largest stable step, at most 1/60 s
  double step_us = 0;              // median over that run
  double real_time_factor = 0;     // simulated over spent in steps, at dt_s
  double largest_stable_dt_s = 0;  // of 1/60 s and its halves; 0: none was
  // Reduced only: stable at 1/60 s with 100 times the stiffness, held against the full run of that stiffness;
  // none where that one does not survive.
  std::optional<bool> stable_stiff;
  /// Origins of the interface bodies against the full run at 1/60 s: the reduced run at the same step, MuJoCo
  /// at its own. The full row has its own distance from half that step, as a measure of what a step is worth.
  double rms_mm = 0, max_mm = 0;
  double step_ratio = 0;  // step_us over the reduced one's
  double cost_ratio = 0;  // time spent on a simulated second over the reduced one's
};

/// Runs `folder`/`name`.xml, with `folder`/`controls`.csv (empty: `name`.csv) as controls where that exists.
/// Errors: as of LoadMechanism, ReadControls, Simulation::Create; kNumerics where the full run does not
/// survive 1/60 s.
Expected<std::vector<SceneRow>> MeasureScene(const std::string& folder, const std::string& name,
                                             double time_limit_s = 6, const std::string& controls = "");

std::string SceneTableCsv(const std::vector<SceneRow>& rows);
/// One line a scene, its four rows beside each other.
std::string SceneTableMarkdown(const std::vector<SceneRow>& rows);
/// One line a simulator.
std::string ScenePageMarkdown(const std::vector<SceneRow>& rows_of_scene);

/// Puts `text` between the lines <!-- table: begin --> and <!-- table: end --> of a file. Errors: kFile;
/// kFormat for a file without them.
Expected<void> ReplaceTable(const std::string& path, const std::string& text);

}  // namespace fork1s
