// The same in bodies' coordinates: the reference knows no spanning tree, joints are equations between bodies.
#include <gtest/gtest.h>

#include <fork1s/reference/full_simulation.hpp>
#include <iostream>

#include "compare.hpp"
#include "random_linkage.hpp"

namespace fork1s::linkages {
namespace {

FullSimulation InFullCoordinates(const Written& linkage) {
  Scene scene;
  scene.mechanisms.push_back(linkage.mechanism->definition());
  auto simulation = FullSimulation::Create(std::move(scene));
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(Bodies, ComplianceAndFrequencies) {
  int compared = 0, vibrating = 0;
  double worst = 0;
  for (unsigned seed = 0; seed < 400; ++seed) {
    Sketch s = RandomLinkage(seed);
    s = Scaled(WithRoot(s, RandomPose(seed, s.size)), 1 / s.size);
    const Methods methods(s, {.seed = seed});
    if (!methods.plain.well_posed) continue;
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " " << s.family);
    const FullSimulation full = InFullCoordinates(methods.linkage);

    const MatrixX C = full.Compliance(0, methods.linkage.interfaces);
    if (methods.plain.interface_free > 0) {
      EXPECT_EQ(C.size(), 0);
    } else if (methods.plain.free == 0 && methods.plain.elastic > 0) {
      const double floor = methods.plain.interface_rank > 0 ? 0 : 1e-4 * methods.plain.open_compliance;
      const double difference = RelativeDifference(C, methods.plain.C, s.size, floor);
      worst = std::max(worst, difference);
      EXPECT_LT(difference, kSame);
      ++compared;
    }

    // Squares of frequencies are right to 1e-15 of the largest times the conditioning of the loops: those
    // within 1e-2 of the largest to eight digits.
    const std::vector<double> found = full.Frequencies(0, 1000);
    if (methods.frequencies.empty() || found.empty()) {
      EXPECT_EQ(found.size(), methods.frequencies.size());
      continue;
    }
    for (std::size_t i = 0; i < std::min(found.size(), methods.frequencies.size()); ++i) {
      const double a = found[found.size() - 1 - i],
                   b = methods.frequencies[methods.frequencies.size() - 1 - i];
      if (b < 1e-2 * methods.frequencies.back()) break;
      EXPECT_NEAR(a, b, kSame * b) << i << " from the highest";
      ++vibrating;
    }
  }
  std::cout << compared << " compliances, worst " << worst << ", " << vibrating << " frequencies\n";
  EXPECT_GT(compared, 200);
  EXPECT_GT(vibrating, 300);
}

}  // namespace
}  // namespace fork1s::linkages
