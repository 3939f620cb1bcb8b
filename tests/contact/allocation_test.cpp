// Solve must not touch the heap once Reserve has been told the size.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "problems.hpp"

namespace {
std::atomic<long> allocations{0};
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
// Every road to the heap ends here, Eigen's and operator new's alike.
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
#endif

namespace fork1s {
namespace {

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
  options.max_sweeps = 5;  // so that Newton runs too
  options.tolerance = 1e-7;
  int newton = 0;
  const long before = allocations.load();
  for (testing::Problem& p : problems) {
    newton += solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, options).newton_iterations;
  }
  EXPECT_EQ(allocations.load(), before);
  EXPECT_GT(newton, 0);
}

}  // namespace
}  // namespace fork1s
