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

// The equation of a muscle by the rule of fourth order in steps of a 20,000th, in which a kink costs 1e-9.
double MuscleInSmallSteps(const ControlDef& c, double a, double u, double rate, double t) {
  const auto slope = [&](double x, double s) {
    const double input = std::clamp(u + rate * s, 0.0, 1.0), gap = input - x,
                 f = 0.5 + 1.5 * std::clamp(x, 0.0, 1.0);
    const double y = std::clamp(c.smoothing > 0 ? gap / c.smoothing + 0.5 : gap > 0 ? 1.0 : 0.0, 0.0, 1.0);
    const double share = y * y * y * (10 - 15 * y + 6 * y * y);
    return gap / (share * c.time_constant * f + (1 - share) * c.deactivation_time / f);
  };
  constexpr int kSteps = 20000;
  const double h = t / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const double s = i * h, k1 = slope(a, s), k2 = slope(a + h / 2 * k1, s + h / 2),
                 k3 = slope(a + h / 2 * k2, s + h / 2), k4 = slope(a + h * k3, s + h);
    a = std::clamp(a + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), c.activation_lower, c.activation_upper);
  }
  return a;
}

// At the shortest times that a mechanism takes.
TEST(MuscleActivation, ShortestTimes_FollowTheInput) {
  ControlDef c;
  c.dynamics = ControlDynamics::kMuscle;
  c.time_constant = c.deactivation_time = 1e-5;
  for (const double smoothing : {0.0, 0.1}) {
    c.smoothing = smoothing;
    // Held for 1700 and more of these times: what is left is exp(-800) or less.
    EXPECT_NEAR(AdvanceActivation(c, 0.2, 0.9, 0, 1.0 / 60), 0.9, 1e-12);
    EXPECT_NEAR(AdvanceActivation(c, 0.9, 0.2, 0, 1.0 / 60), 0.2, 1e-12);
  }
}

TEST(MuscleActivation, FollowsItsEquation) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(0, 1);
  double largest_held = 0, largest = 0;
  for (int trial = 0; trial < 300; ++trial) {
    ControlDef c;
    c.dynamics = ControlDynamics::kMuscle;
    c.time_constant = 0.002 + 0.02 * uniform(random);
    c.deactivation_time = 0.002 + 0.06 * uniform(random);
    if (trial % 2) c.smoothing = 0.05 + uniform(random);
    if (trial % 5 == 0) c.activation_lower = 0.2, c.activation_upper = 0.7;
    const double a = std::clamp(uniform(random), c.activation_lower, c.activation_upper),
                 u = 1.6 * uniform(random) - 0.3, rate = trial % 3 ? 200 * (uniform(random) - 0.5) : 0,
                 t = 0.03 * uniform(random);
    const double error = std::abs(AdvanceActivation(c, a, u, rate, t) - MuscleInSmallSteps(c, a, u, rate, t));
    double& most = rate == 0 && c.smoothing == 0 ? largest_held : largest;
    most = std::max(most, error);
    EXPECT_LT(error, 1e-7) << trial;  // the bound that mechanism/activation.cpp states
  }
  RecordProperty("largest error", std::to_string(largest));
  EXPECT_LT(largest_held, 1e-9);  // that of the small steps where a bound is met
}

}  // namespace
}  // namespace fork1s::internal
