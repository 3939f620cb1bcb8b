// A hand closes on a box by set-points, lifts it by its driven palm, is shaken, and rests: the demo and a
// test.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::examples {

/// s, when the rest begins: a second after the shaking, for what swings to come to rest.
inline constexpr double kHandRestStart = 5.7;
struct HandScenario {
  double friction = 0.8;       // of every surface
  double object_mass = 0.2;    // kg
  double stiffness_scale = 1;  // of all joints
  double dt = 1.0 / 60;        // s
  Integrator integrator = Integrator::kTwoStage;
  bool shake = true;
  double rest = 5;           // s
  std::string controls_csv;  // where to write the set-points of every step, for `fork1s run --controls`;
                             // empty: nowhere
};

struct HandMeasurement {
  int steps = 0;
  std::vector<double> step_us;
  int contacts_max = 0;
  double penetration_max = 0;   // m
  int unconverged_closing = 0;  // steps whose contact solve missed its tolerance before the rest
  int unconverged_rest = 0;     // and during it
  int max_newton_iterations = 0;
  int refreshes = 0;
  bool finite = true;
  double lift_height = 0;    // m, that the object rose with the palm by the end of the lift
  double sway_in_shake = 0;  // m, largest excursion of the object against the palm, elastic for the most part
  double slip_by_shake = 0;  // m, what of it stayed
  double drift_at_rest = 0;  // m, object against palm over the rest, largest excursion
  double weight = 0;         // N
  double load_error = 0;     // largest |contact force + weight| / weight over the last second of the rest
  double grip_force = 0;     // N, normal force of the thumb at the end
  double max_speed_at_rest = 0;  // m/s, of any fingertip
  double final_height = 0;       // m, of the object's centre
};

/// The scene with the scenario's stiffness, friction and mass, and the open hand as its only keyframe.
/// Errors: those of loading it.
Expected<Scene> LoadHandScene(const std::string& scene_path, const HandScenario& scenario);

/// Controls by name for a step that ends at t [s].
std::vector<std::pair<std::string, double>> HandSetPoints(double t, const HandScenario& scenario);

/// Runs the scenario on scenes/hand.xml. Errors: those of loading the scene.
Expected<HandMeasurement> RunHandScenario(const std::string& scene_path, const HandScenario& scenario);

/// Skin that cannot carry the box.
HandScenario SlipperyHand();

/// A row of what ./demo prints; `promise` is empty where nothing is promised.
struct HandRow {
  std::string what, measured, promise;
  bool kept = true;
};
/// Of the default scenario and of SlipperyHand.
std::vector<HandRow> HandTable(const HandMeasurement& held, const HandMeasurement& dropped);

}  // namespace fork1s::examples
