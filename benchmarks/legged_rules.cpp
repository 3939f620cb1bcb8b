// How far machines on their legs are from a run of short steps within 1.5 s, by either integrator
// (docs/method.md, section 5).
//
//     build/release/benchmarks/legged_rules [MODELS]
//
// MODELS: folder of the robots that are no part of the project (../shared/models unless told); where it is
// missing, the hexapod alone. Prints a CSV: RMS and largest distance of feet and trunk [mm] at 1/60 s by
// backward Euler, by it at half the step, by two stages; the truth is two stages at a 64th of the step, and
// what backward Euler there is off from it is what the truth is worth. Some ten seconds.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <legged.hpp>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::legged_rules {
namespace {
using namespace fork1s::examples;

constexpr double kStep = 1.0 / 60;  // s
constexpr int kSamples = 90, kFine = 64;

std::vector<Vector3> Run(const LeggedScene& legged, Integrator integrator, int substeps) {
  SimulationOptions options = StandingOptions(legged);
  options.dt = kStep / substeps;
  options.step.integrator = integrator;
  auto simulation = Simulation::Create(legged.imported.scene, options);
  std::vector<Vector3> places;
  for (int k = 0; simulation && k < kSamples; ++k) {
    for (int i = 0; i < substeps; ++i) simulation->Step();
    for (const FootPoint& foot : legged.feet) places.push_back(simulation->Pose(foot.body) * foot.p_B);
    places.push_back(simulation->Pose(legged.trunk).translation());
  }
  return places;
}

std::string Apart(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double sum = 0, most = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    sum += (a[i] - b[i]).squaredNorm();
    most = std::max(most, (a[i] - b[i]).norm());
  }
  return fmt::format("{:.4f},{:.4f}",
                     1e3 * std::sqrt(sum / std::max<double>(1, static_cast<double>(a.size()))), 1e3 * most);
}

}  // namespace

int Main(int argc, char** argv) {
  LeggedOptions options;
  options.scenes = FORK1S_SOURCE "/scenes";
  options.models = argc > 1 ? argv[1] : FORK1S_SOURCE "/../shared/models";
  fmt::print(
      "machine,ground,gains,euler_rms,euler_max,euler_half_rms,euler_half_max,two_stage_rms,two_stage_max,"
      "truth_rms,truth_max\n");
  for (const LeggedRobot robot :
       {LeggedRobot::kHexapod, LeggedRobot::kAnymal, LeggedRobot::kCassie, LeggedRobot::kDigit})
    for (const LeggedGround ground : {LeggedGround::kFlat, LeggedGround::kUneven})
      for (const double gains : {1.0, 100.0}) {
        options.ground = ground;
        options.gain_scale = gains;
        const auto legged = LoadLegged(robot, options);
        if (!legged) {
          fmt::print(stderr, "legged_rules: {}\n", legged.error().Text());
          continue;
        }
        const auto truth = Run(*legged, Integrator::kTwoStage, kFine);
        fmt::print("{},{},{},{},{},{},{}\n", Name(robot), Name(ground), gains,
                   Apart(Run(*legged, Integrator::kEuler, 1), truth),
                   Apart(Run(*legged, Integrator::kEuler, 2), truth),
                   Apart(Run(*legged, Integrator::kTwoStage, 1), truth),
                   Apart(Run(*legged, Integrator::kEuler, kFine), truth));
      }
  return 0;
}

}  // namespace fork1s::benchmarks::legged_rules
