// Scenes of scenes/ as data, and a run that says what went wrong on the way.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>

namespace fork1s::examples {

inline ImportedScene Load(const std::string& name, const ImportOptions& options = {}) {
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/" + name + ".xml", options);
  if (!imported) throw std::runtime_error(imported.error().Text());
  return std::move(*imported);
}

inline Simulation Start(Scene scene, int keyframe = -1,
                        double refresh_angle = SimulationOptions{}.refresh_angle) {
  SimulationOptions options;
  options.dt = 1.0 / 60;
  options.initial_keyframe = keyframe;
  options.refresh_angle = refresh_angle;
  auto simulation = Simulation::Create(std::move(scene), options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

/// What a stretch of steps met.
struct Passage {
  bool finite = true;
  int unconverged = 0;
  int contacts = 0;        // at the last step
  double gap = 0;          // m, of any loop
  double penetration = 0;  // m
  double speed = 0;        // m/s, of the origin of any body
};

inline Passage Advance(Simulation& simulation, double seconds) {
  Passage run;
  const auto steps = static_cast<int>(seconds / simulation.dt() + 0.5);
  for (int i = 0; i < steps; ++i) {
    const StepReport report = simulation.Step();
    run.finite = run.finite && report.finite;
    run.unconverged += report.IsSolved() ? 0 : 1;
    run.contacts = report.contacts;
    run.gap = std::max(run.gap, simulation.ClosureGap());
    run.penetration = std::max(run.penetration, report.max_penetration);
    for (std::size_t b = 0; b < simulation.bodies().size(); ++b)
      run.speed = std::max(run.speed, simulation.Velocity(static_cast<int>(b)).tail<3>().norm());
  }
  return run;
}

}  // namespace fork1s::examples
