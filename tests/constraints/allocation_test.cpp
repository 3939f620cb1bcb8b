// Solve must not touch the heap once Reserve has been told the size.
#include <gtest/gtest.h>
#include <allocation_counter.hpp>

#include "problems.hpp"

namespace fork1s {
namespace {

using testing::allocations;

TEST(ContactAllocation, NoneAfterReserve) {
  std::mt19937 random(11);
  std::vector<testing::Problem> problems;
  for (int k = 0; k < 40; ++k) {
    problems.push_back(testing::RandomProblem(random, 5, 1 + k % 3, 1 + k % 12, 0.7));
    problems.back().limits.push_back({k % 30, 1, 0, 0});
  }
  ContactSolver solver;
  solver.Reserve(12, 1, 48);
  ContactSolverOptions options;
  int newton = 0;
  const long before = allocations.load();
  EXPECT_EQ(before > 0, testing::kCountsAllocations);
  for (testing::Problem& p : problems) {
    newton += solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, options).newton_iterations;
  }
  EXPECT_EQ(allocations.load(), before);
  EXPECT_GT(newton, 0);
}

}  // namespace
}  // namespace fork1s
