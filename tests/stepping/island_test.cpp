// Islands of contact are solved as if each were alone.
#include <gtest/gtest.h>

#include <constraints/problems.hpp>

#include "world/island_solver.hpp"

namespace fork1s {
namespace {

using testing::Problem;

// The problems side by side: blocks one after another, contacts and limits dealt out in turn.
Problem Together(const std::vector<Problem>& problems) {
  Problem all;
  std::vector<int> offset;
  int size = 0;
  std::size_t most = 0;
  for (const Problem& p : problems) {
    offset.push_back(size);
    size += static_cast<int>(p.velocity.size());
    all.W.insert(all.W.end(), p.W.begin(), p.W.end());
    most = std::max({most, p.contacts.size(), p.limits.size()});
  }
  all.Finish();
  for (std::size_t k = 0; k < problems.size(); ++k)
    all.velocity.segment(offset[k], problems[k].velocity.size()) = problems[k].velocity;
  for (std::size_t i = 0; i < most; ++i)
    for (std::size_t k = 0; k < problems.size(); ++k) {
      if (i < problems[k].contacts.size()) {
        ContactConstraint& c = all.contacts.emplace_back(problems[k].contacts[i]);
        if (c.port_a >= 0) c.port_a += offset[k];
        if (c.port_b >= 0) c.port_b += offset[k];
      }
      if (i < problems[k].limits.size()) all.limits.emplace_back(problems[k].limits[i]).row += offset[k];
    }
  return all;
}

std::vector<Problem> RandomProblems(int count) {
  std::mt19937 random(11);
  std::vector<Problem> problems;
  for (int k = 0; k < count; ++k) {
    problems.push_back(testing::RandomProblem(random, 2, 0, 1 + k % 7, 0.5));
    LimitConstraint limit;
    limit.row = k % 12;
    limit.bias = -0.1;
    problems.back().limits.push_back(limit);
  }
  return problems;
}

TEST(Islands, GiveTheBitsOfEachAlone) {
  const std::vector<Problem> problems = RandomProblems(80);  // 320 contacts: several threads' worth
  Problem all = Together(problems);
  IslandSolver islands;
  const ContactSolverReport report =
      islands.Solve(all.blocks, all.contacts, all.limits, all.velocity, ContactSolverOptions{});
  int fallback = 0, newton = 0;
  Eigen::Index offset = 0;
  std::vector<Problem> solved;
  for (const Problem& given : problems) {
    Problem p = given;
    ContactSolver alone;
    const ContactSolverReport r = alone.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    fallback = std::max(fallback, r.fallback);
    newton = std::max(newton, r.newton_iterations);
    EXPECT_EQ(all.velocity.segment(offset, p.velocity.size()), p.velocity);
    offset += p.velocity.size();
    solved.push_back(std::move(p));
  }
  // All that a solve says, of every contact and limit.
  std::size_t contact = 0, limit = 0;
  for (std::size_t i = 0; limit < all.limits.size() || contact < all.contacts.size(); ++i)
    for (const Problem& p : solved) {
      if (i < p.contacts.size()) {
        const ContactConstraint& c = all.contacts[contact++];
        EXPECT_EQ(c.impulse, p.contacts[i].impulse);
        EXPECT_EQ(c.moment, p.contacts[i].moment);
        EXPECT_EQ(c.utilization, p.contacts[i].utilization);
      }
      if (i < p.limits.size()) {
        EXPECT_EQ(all.limits[limit++].impulse, p.limits[i].impulse);
      }
    }
  EXPECT_GE(islands.num_islands(), 80);
  EXPECT_EQ(report.fallback, fallback);
  EXPECT_EQ(report.newton_iterations, newton);
}

TEST(Islands, OneContactJoinsTwo) {
  Problem all = Together({testing::BoxOnPlane(1, 0.5), testing::BoxOnPlane(2, 0.5)});
  Problem joined = all;
  IslandSolver islands;
  islands.Solve(all.blocks, all.contacts, all.limits, all.velocity, ContactSolverOptions{});
  EXPECT_EQ(islands.num_islands(), 2);
  joined.contacts.push_back(
      testing::TouchAt(0, Vector3(0.1, 0, 0), 6, Vector3(-0.1, 0, 0), Vector3::UnitX(), 0.5));
  islands.Solve(joined.blocks, joined.contacts, joined.limits, joined.velocity, ContactSolverOptions{});
  EXPECT_EQ(islands.num_islands(), 1);
}

// Rows of boxes on a plane, each one's contact with the next deferred: those that are pushed at their neighbour by more
// than the gap join it, in turn where that one then closes the next. The answer is that of all together.
TEST(Islands, DeferredContacts_AreJoinedWhereTheyClose) {
  constexpr int kBoxes = 12;
  for (const double gap : {1e-3, 0.2, 10.0}) {
    std::vector<Problem> boxes;
    for (int k = 0; k < kBoxes; ++k) boxes.push_back(testing::BoxOnPlane(1, 0));
    Problem all = Together(boxes);
    for (int k = 0; k + 1 < kBoxes; ++k)
      all.contacts.push_back(
          testing::TouchAt(6 * k, Vector3(0.1, 0, 0), 6 * (k + 1), Vector3(-0.1, 0, 0), Vector3::UnitX(), 0));
    for (std::size_t i = all.contacts.size() - (kBoxes - 1); i < all.contacts.size(); ++i)
      all.contacts[i].bias[0] = gap;
    all.velocity[6 * 2 + 3] = 1;   // the third box runs at the fourth
    all.velocity[6 * 7 + 3] = -2;  // and the eighth at the seventh
    Problem together = all, apart = all;
    for (std::size_t i = all.contacts.size() - (kBoxes - 1); i < all.contacts.size(); ++i)
      apart.contacts[i].may_be_deferred = true;
    IslandSolver islands;
    ContactSolverOptions options;
    options.max_relative_regularization = 1;
    ASSERT_TRUE(islands.Solve(together.blocks, together.contacts, together.limits, together.velocity, options)
                    .converged);
    EXPECT_EQ(islands.num_islands(), 1);
    const ContactSolverReport report =
        islands.Solve(apart.blocks, apart.contacts, apart.limits, apart.velocity, options);
    EXPECT_TRUE(report.converged);
    int bearing = 0;
    for (std::size_t i = 0; i < all.contacts.size(); ++i) {
      // What four corners of a hard box bear each is told by the least compliance alone.
      EXPECT_LT((apart.contacts[i].impulse - together.contacts[i].impulse).norm(), 1e-6) << gap << ' ' << i;
      bearing += apart.contacts[i].impulse[0] > 0;
    }
    EXPECT_EQ(report.active, bearing);
    EXPECT_LT((apart.velocity - together.velocity).norm(), 1e-8) << gap;
    EXPECT_EQ(islands.num_islands() == kBoxes, gap > 2) << gap;
    for (int k = 0; k < kBoxes && gap > 2; ++k) {  // to the bit as if nothing were near
      Problem alone = testing::BoxOnPlane(1, 0);
      alone.velocity = all.velocity.segment(6 * k, 6);
      ContactSolver().Solve(alone.blocks, alone.contacts, alone.limits, alone.velocity, options);
      EXPECT_EQ(apart.velocity.segment(6 * k, 6), alone.velocity) << k;
    }
  }
}

// A whole step's result must not depend on what was solved on the same bench before.
TEST(Islands, HaveNoMemory) {
  const Problem first = Together(RandomProblems(20)), second = Together(RandomProblems(9));
  IslandSolver fresh, used;
  Problem a = second, b = second, c = first;
  used.Solve(c.blocks, c.contacts, c.limits, c.velocity, ContactSolverOptions{});
  used.Solve(a.blocks, a.contacts, a.limits, a.velocity, ContactSolverOptions{});
  fresh.Solve(b.blocks, b.contacts, b.limits, b.velocity, ContactSolverOptions{});
  EXPECT_EQ(a.velocity, b.velocity);
}

}  // namespace
}  // namespace fork1s
