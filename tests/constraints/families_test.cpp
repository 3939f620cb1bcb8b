// Problems as scenes pose them, drawn at random: heaps, stacks, wedges, grasps with redundant points, and
// jams that no scene poses.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include <draws.hpp>
#include "random_problems.hpp"

namespace fork1s {
namespace {

using testing::Family;
using testing::Problem;

class Families : public ::testing::TestWithParam<std::pair<Family, int>> {};

TEST_P(Families, AreSolvedAndObeyTheLaw) {
  const auto [family, all] = GetParam();
  const int count = testing::Draws(all);
  std::mt19937 random(11);
  ContactSolver solver;
  ContactSolverOptions options;
  options.max_relative_regularization = 1;  // as given: impacts are made no harder
  int unsolved = 0;
  for (int i = 0; i < count; ++i) {
    Problem p = testing::DrawFamily(random, family);
    testing::GiveDefaultMaterial(p);
    for (ContactConstraint& c : p.contacts) c.hardening_speed = std::numeric_limits<double>::infinity();
    const VectorX start = p.velocity;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, options);
    ASSERT_TRUE(p.velocity.allFinite()) << i;
    unsolved += !report.converged;
    // The residual is 1e-12 of what contact changes, weighed by inertia: a light body's velocity is that of
    // 1e6 times its mass off by a thousand times as much.
    if (report.converged) {
      EXPECT_LT(testing::LawViolation(p, start, p.velocity), 1e-6) << i;
    }
  }
  RecordProperty("unsolved", unsolved);
  EXPECT_LE(unsolved, family == Family::kJam ? std::max(1, count / 100) : 0);
}

// From the impulses of a problem that was a little another one, as those of the last step are: few points are
// on another mode then, and are solved by themselves.
TEST_P(Families, TakeFewFactorsWarm) {
  std::mt19937 random(12);
  ContactSolver solver;
  std::vector<int> factors;
  const int count = testing::Draws(GetParam().first == Family::kJam ? 51 : 1000);
  for (int i = 0; i < count; ++i) {
    Problem p = testing::DrawFamily(random, GetParam().first);
    testing::GiveDefaultMaterial(p);
    const VectorX start = p.velocity;
    solver.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    p.velocity = start;
    for (double& v : p.velocity) v *= 1 + 1e-3 * testing::Uniform(random, -1, 1);
    factors.push_back(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity).newton_iterations);
  }
  const auto middle = factors.begin() + count / 2;
  std::nth_element(factors.begin(), middle, factors.end());
  // Of wedges half take one or two, half four and more: fewer draws do not tell.
  if (testing::Draws(10) == 10) {
    EXPECT_LE(*middle, 3);
  }
}

// Some of what line search does not solve is, from the associated law on; none takes more than the paths may, twice and
// what lies before them.
TEST(Jams, AreFollowedFromTheAssociatedLawAndEnd) {
  std::mt19937 random(7);
  ContactSolver solver;
  int by_dilatancy = 0;
  for (int i = 0; i < 250; ++i) {
    Problem p = testing::DrawFamily(random, Family::kJam);
    testing::GiveDefaultMaterial(p);
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    by_dilatancy += report.fallback == 1 && report.converged;
    EXPECT_LT(report.newton_iterations, 12000) << i;
  }
  EXPECT_GE(by_dilatancy, 3);
}

// Jams that the solver leaves unsolved, and says so: even then nothing pulls, friction keeps its bound, and
// impulses do no work. (They did: a block that was jammed between kerb, boards and an excavator's bucket went
// off at 300 m/s.)
TEST(Unsolved, ImpulsesStayWithinTheirConesAndGiveNoEnergy) {
  ContactSolver solver;
  // 47 stays unsolved today; it takes minutes with sanitizers, which watch the first alone, in a ninth of the time.
  constexpr unsigned kSeeds[] = {194, 169, 114, 47};
  for (int i = 0; i < std::max(1, testing::Draws(4)); ++i) {
    SCOPED_TRACE(kSeeds[i]);
    std::mt19937 random(kSeeds[i]);
    Problem p = testing::DrawFamily(random, Family::kJam);
    testing::GiveDefaultMaterial(p);
    const VectorX start = p.velocity;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    double size = 0, work = 0, taken = 0;
    for (const ContactConstraint& c : p.contacts) size = std::max(size, c.impulse.norm());
    // Bounds hold to rounding; where it is solved after all, to the solver's tolerance.
    const double tolerance = (report.converged ? 1e-6 : 1e-12) * size;
    for (const ContactConstraint& c : p.contacts) {
      EXPECT_GE(c.impulse[0], -tolerance);
      EXPECT_LE(c.impulse.tail<2>().norm(), c.friction * c.impulse[0] + tolerance);
      // By the mean velocity of its two sides.
      const double part = 0.5 * c.impulse.dot(p.RowsOf(c) * (start + p.velocity));
      work += part;
      taken += std::abs(part);
    }
    EXPECT_LE(work, 1e-9 * taken);
  }
}

INSTANTIATE_TEST_SUITE_P(Random, Families,
                         ::testing::Values(std::pair(Family::kJam, 100), std::pair(Family::kHeap, 60),
                                           std::pair(Family::kStack, 500), std::pair(Family::kWedge, 1000),
                                           std::pair(Family::kGrasp, 400)),
                         [](const auto& drawn) { return std::string(testing::NameOf(drawn.param.first)); });

}  // namespace
}  // namespace fork1s
