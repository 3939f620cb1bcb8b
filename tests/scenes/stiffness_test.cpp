// Every scene at its own stiffness and far above it: bounded, closed, and no step gains energy.
#include <draws.hpp>
#include <vector>

#include "run.hpp"

namespace fork1s::examples {
namespace {

struct Stiff {
  const char* scene;
  double stiffness;
  double time;  // s
};
std::ostream& operator<<(std::ostream& out, const Stiff& c) { return out << c.scene << " x" << c.stiffness; }

class Stiffness : public ::testing::TestWithParam<Stiff> {};

TEST_P(Stiffness, NoStepGainsEnergy) {
  SceneRun run(GetParam().scene, GetParam().stiffness);
  const Course course = run.Until(GetParam().time);
  EXPECT_TRUE(course.finite);
  EXPECT_GT(course.contacts_max, 0);
  EXPECT_LT(course.gap, 1e-5);
  const bool driven = run.simulation().scene().mechanisms[0].base == BaseKind::kDriven;
  if (driven) {
    // The motor that moves the palm may do any work. Hand and object of 0.6 kg follow it at up to 0.5 m/s.
    EXPECT_LT(course.kinetic_max, 0.15);
    return;
  }
  // Set-points and torques have done their work when the step begins. Penetration is pushed out again by a
  // fifth a step, against at most the largest contact force. The rest is rounding of the energy guard's
  // bisection.
  const double pushed_out = 0.2 * course.penetration * course.force_max;
  EXPECT_LT(course.rise_max, pushed_out + 1e-6 * course.kinetic_max);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, Stiffness,
    ::testing::Values(Stiff{"firemen", 1, 3}, Stiff{"firemen", 100, 3}, Stiff{"firemen", 1e3, 3},
                      Stiff{"vehicle", 1, 6}, Stiff{"vehicle", 100, 6}, Stiff{"vehicle", 1e3, 6},
                      Stiff{"hexapod_terrain", 1, 6}, Stiff{"hexapod_terrain", 100, 6},
                      Stiff{"hexapod_terrain", 1e3, 6}, Stiff{"hammer", 1, 4}, Stiff{"hammer", 100, 4},
                      Stiff{"hammer", 1e3, 4}, Stiff{"peg_in_hole", 1, 5}, Stiff{"peg_in_hole", 100, 5},
                      Stiff{"peg_in_hole", 1e3, 5}, Stiff{"excavator", 100, 5}, Stiff{"excavator", 1e3, 5},
                      Stiff{"beam_walkers", 1, 8}, Stiff{"beam_walkers", 1e3, 8},
                      Stiff{"grasp_sphere", 100, 6}, Stiff{"grasp_sphere", 1e3, 6},
                      Stiff{"grasp_box", 100, 6}, Stiff{"grasp_mug", 100, 6}, Stiff{"grasp_mug", 1e3, 6}));

// Cylinders of up to 1e12 N/m give 1.2 to 2e5 N at most: they come to their bounds and away from them in many
// steps, from far beyond what they can hold.
class StiffCylinders : public ::testing::TestWithParam<std::tuple<Integrator, double>> {};

TEST_P(StiffCylinders, HoldAtTheirBounds) {
  const auto [integrator, stiffness] = GetParam();
  SceneRun run("excavator", stiffness);
  run.simulation().step_options().integrator = integrator;
  const Course course = run.Until(12);
  EXPECT_TRUE(course.finite);
  EXPECT_LT(course.gap, 1e-9);
  // 5 t at 6 m/s: its cylinders and its fall would not make it quicker.
  EXPECT_LT(course.kinetic_max, 1e5);
  if (integrator != Integrator::kEuler) {
    EXPECT_LT(course.rise_max, 1);
  }
}

// Each a run of 12 s by both integrators.
std::vector<double> Stiffnesses() {
  const std::vector<double> all = {1e5, 1e3, 1e4, 1e2};
  return {all.begin(), all.begin() + fork1s::testing::Seeds(2, 4)};
}

INSTANTIATE_TEST_SUITE_P(Scenes, StiffCylinders,
                         ::testing::Combine(::testing::Values(Integrator::kEuler, Integrator::kTwoStage),
                                            ::testing::ValuesIn(Stiffnesses())));

}  // namespace
}  // namespace fork1s::examples
