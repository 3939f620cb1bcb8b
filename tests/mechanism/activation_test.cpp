// The activation of a control against its differential equation, integrated in small steps.
#include "mechanism/activation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

namespace fork1s::internal {
namespace {

double InSmallSteps(const ControlDef& c, double a, double u, double rate, double t) {
  constexpr int kSteps = 20000;
  const double h = t / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const double input = u + rate * (i + 0.5) * h;
    const double slope = c.dynamics == ControlDynamics::kLag ? (input - a) / c.time_constant : input;
    a = std::clamp(a + h * slope, c.activation_lower, c.activation_upper);
  }
  return a;
}

TEST(Activation, FollowsItsEquationAndStopsAtItsBounds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const ControlDynamics dynamics : {ControlDynamics::kLag, ControlDynamics::kIntegrator})
    for (const bool bounded : {false, true})
      for (int trial = 0; trial < 50; ++trial) {
        ControlDef c;
        c.dynamics = dynamics;
        c.time_constant = 0.1 + 0.5 * std::abs(uniform(random));
        if (bounded) c.activation_lower = -0.2, c.activation_upper = 0.3;
        const double a = std::clamp(0.5 * uniform(random), c.activation_lower, c.activation_upper),
                     u = uniform(random), rate = trial % 3 == 0 ? 0 : 3 * uniform(random);
        // Euler's error of one unit over 20,000 steps of at most a tenth of the time constant's inverse.
        EXPECT_NEAR(AdvanceActivation(c, a, u, rate, 1), InSmallSteps(c, a, u, rate, 1), 2e-3) << trial;
        // A step is the sum of its parts.
        const double half = AdvanceActivation(c, a, u, rate, 0.4);
        EXPECT_NEAR(AdvanceActivation(c, half, u + 0.4 * rate, rate, 0.6),
                    AdvanceActivation(c, a, u, rate, 1), 1e-13)
            << trial;
      }
}

}  // namespace
}  // namespace fork1s::internal
