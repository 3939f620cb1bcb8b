// What a step of the full-coordinate simulator errs by, implicit Euler beside two stages, on whole scenes.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

namespace fork1s {

struct StepOrderRow {
  std::string scene;
  double time_s = 0;
  double motion_mm = 0;  // RMS displacement from the start, of interface and free bodies
  /// RMS distance of their origins from the truth, in percent of the motion, at 1/60 s and at 1/240 s.
  double euler_percent[2] = {0, 0};      // full
  double two_percent[2] = {0, 0};        // full, by two stages
  double two_stage_percent[2] = {0, 0};  // reduced, by Integrator::kTwoStage
  int halved[2] = {0, 0};                // steps of two stages in which something was met
  int steps[2] = {0, 0};
  double truth_percent = 0;  // two stages at 1/960 s from those at 1/1920 s, the truth
};

/// Runs `folder`/`name`.xml for `time_s`, with `folder`/`name`.csv as controls where that exists. Errors: as
/// of LoadMechanism, ReadControls, Simulation::Create and FullSimulation::Create; kNumerics.
Expected<StepOrderRow> MeasureStepOrder(const std::string& folder, const std::string& name, double time_s);

std::string StepOrderMarkdown(const std::vector<StepOrderRow>& rows);

}  // namespace fork1s
