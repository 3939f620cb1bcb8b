// How the contact solver fares on problems drawn at random, cold and warm.
//
//     build/release/benchmarks/contact_problems PROBLEMS_A_FAMILY [FAMILY...] > FILE.csv
//
// Cold: no impulses known. Warm: the same again with velocities a thousandth off. `stage` counts what helped
// (ContactSolverReport); `law` is the largest violation of Coulomb's law, recomputed from its definition, of
// those that the solver calls solved, as a share of the fastest contact velocity.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <random_problems.hpp>
#include <string>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::contact_problems {
namespace {
using namespace fork1s::testing;

struct Tally {
  std::vector<int> iterations;
  std::array<int, 5> fallbacks{};
  int unsolved = 0;

  void Add(const ContactSolverReport& report) {
    iterations.push_back(report.newton_iterations);
    ++fallbacks[static_cast<std::size_t>(report.fallback)];
    unsolved += !report.converged;
  }
  int At(double share) {
    std::sort(iterations.begin(), iterations.end());
    return iterations[static_cast<std::size_t>(share * static_cast<double>(iterations.size() - 1))];
  }
};

void Print(Family family, int count) {
  using Clock = std::chrono::steady_clock;
  std::mt19937 random(7);
  ContactSolver solver;
  Tally cold, warm;
  std::size_t most = 0, points = 0;
  double seconds = 0, law = 0;
  for (int i = 0; i < count; ++i) {
    Problem p = DrawFamily(random, family);
    GiveDefaultMaterial(p);
    most = std::max(most, p.contacts.size());
    points += p.contacts.size();
    const VectorX start = p.velocity;
    const auto begin = Clock::now();
    const ContactSolverReport first = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    cold.Add(first);
    p.velocity = start;
    for (double& v : p.velocity) v *= 1 + 1e-3 * Uniform(random, -1, 1);
    warm.Add(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity));
    // The law itself, on what the problem gives: no impacts made harder.
    ContactSolverOptions as_given;
    as_given.max_relative_regularization = 1;
    for (ContactConstraint& c : p.contacts) c.hardening_speed = std::numeric_limits<double>::infinity();
    p.velocity = start;
    if (solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, as_given).converged)
      law = std::max(law, LawViolation(p, start, p.velocity));
  }
  fmt::print("{},{},{},{:.1f},{},{},{},{},{},{},{},{},{},{},{},{:.1e},{:.2f}\n", NameOf(family), count, most,
             static_cast<double>(points) / count, cold.At(0.5), cold.At(0.99), cold.fallbacks[1],
             cold.fallbacks[2], cold.fallbacks[3], cold.fallbacks[4], cold.unsolved, warm.At(0.5),
             warm.At(0.99), count - warm.fallbacks[0], warm.unsolved, law, 1e3 * seconds / count);
  std::fflush(stdout);
}

}  // namespace

int Main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 0;
  if (count <= 0) {
    fmt::print(stderr, "usage: contact_problems PROBLEMS_A_FAMILY [jam heap stack wedge grasp]\n");
    return 2;
  }
  const std::vector<std::string> wanted(argv + 2, argv + argc);
  fmt::print(
      "family,problems,contacts_most,contacts_mean,cold_median,cold_p99,cold_dilatancy,cold_frozen,cold_softer,"
      "cold_path,cold_unsolved,warm_median,warm_p99,warm_helped,warm_unsolved,law,cold_ms\n");
  for (Family family : kFamilies)
    if (wanted.empty() || std::find(wanted.begin(), wanted.end(), NameOf(family)) != wanted.end())
      Print(family, count);
  return 0;
}

}  // namespace fork1s::benchmarks::contact_problems
