#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <string>

#include <draws.hpp>
#include "linalg/cholesky.hpp"
#include "plain_sweeps.hpp"
#include "random_problems.hpp"

namespace fork1s {
namespace {

using testing::AsGiven;
using testing::LawViolation;
using testing::Problem;
using testing::RandomProblem;
using testing::Uniform;

struct Shape {
  int ports, free, contacts;
};

Problem Draw(std::mt19937& random, int trial) {
  constexpr Shape kShapes[] = {{1, 0, 1}, {2, 1, 4}, {5, 1, 8}, {0, 3, 6}, {5, 5, 20}, {1, 0, 5}};
  const Shape& s = kShapes[trial % 6];
  const double mu = trial % 7 == 0 ? 0 : Uniform(random, 0.1, 1.2);
  Problem p = RandomProblem(random, s.ports, s.free, s.contacts, mu);
  // 1e6 N/m at 1/60 s, beside inverse masses of 1 to 30; equal, so that the solver makes none stiffer than
  // others.
  for (ContactConstraint& c : p.contacts) c.compliance_normal = c.compliance_tangent = 7e-4;
  if (trial % 3 == 0 && s.ports > 0) {
    // Each its own row: opposite limits of one row may ask for what no velocity can do.
    std::uniform_int_distribution<int> row(0, 2 * s.ports - 1);
    for (int k = 0; k < 3; ++k) {
      p.limits.push_back({3 * row(random) + k, k % 2 ? 1.0 : -1.0, Uniform(random, -0.5, 0.5), 0});
    }
  }
  return p;
}

TEST(ContactProperties, CoulombLawHolds) {
  std::mt19937 random(1);
  ContactSolver solver;
  int failures = 0, helped = 0;
  const int trials = testing::Draws(3000);
  for (int trial = 0; trial < trials; ++trial) {
    Problem p = Draw(random, trial);
    const VectorX start = p.velocity;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    helped += report.fallback > 0;
    ASSERT_TRUE(p.velocity.allFinite()) << trial;
    if (!report.converged) {
      ++failures;
      continue;
    }
    // 1e-12 of what contact changes, weighed by inertia, as one point of bodies 1 : 30 sees it; rows that
    // give nothing among them, whose impulses rounding of velocities would change by 1e-5.
    EXPECT_LT(LawViolation(p, start, p.velocity), 1e-8) << trial;
  }
  RecordProperty("failures", failures);
  RecordProperty("helped", helped);
  EXPECT_LE(failures, trials / 200);
}

// Points with moments, solved by themselves on the factor of all: from impulses nearby as from none.
TEST(ContactProperties, MomentsFromNearbyAreThoseFromNothing) {
  std::mt19937 random(13);
  ContactSolver solver;
  int few = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Problem p = RandomProblem(random, 2, 3, 1 + trial % 8, 0.2);
    for (ContactConstraint& c : p.contacts) {
      c.torsion = 0.02;
      c.rolling = trial % 2 == 0 ? 0.01 : 0;
      c.compliance_normal = c.compliance_tangent = 1e-2;
    }
    const VectorX start = p.velocity;
    ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) << trial;
    VectorX near = start;
    for (double& v : near) v *= 1 + 0.1 * testing::Uniform(random, -1, 1);
    Problem cold = p;
    for (ContactConstraint& c : cold.contacts) c.impulse = c.moment = Vector3::Zero();
    VectorX by_warm = near, by_cold = near;
    const ContactSolverReport warm = solver.Solve(p.blocks, p.contacts, p.limits, by_warm, AsGiven());
    ASSERT_TRUE(warm.converged) << trial;
    ASSERT_TRUE(solver.Solve(p.blocks, cold.contacts, p.limits, by_cold, AsGiven()).converged) << trial;
    EXPECT_LT((by_warm - by_cold).norm(), 1e-8 * (1 + near.norm())) << trial;
    few += warm.newton_iterations == 1;
  }
  EXPECT_GT(few, 100);
}

// A second method to the same law, where its answer is unique.
TEST(ContactProperties, PlainSweepsAgree) {
  std::mt19937 random(2);
  ContactSolver solver;
  int compared = 0;
  for (int trial = 0; trial < testing::Draws(300); ++trial) {
    Problem p = Draw(random, trial);
    for (ContactConstraint& c : p.contacts) {
      c.friction = std::min(c.friction, 0.3);
      c.compliance_normal = c.compliance_tangent = 1e-2;
    }
    for (LimitConstraint& l : p.limits) l.compliance = 1e-2;
    const Problem given = p;
    ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) << trial;
    const testing::SweepResult plain = testing::SweepPlainly(given, 1e-11, 20000);
    if (!plain.settled) continue;
    ++compared;
    EXPECT_LT((plain.velocity - p.velocity).norm(), 1e-6 * (1 + p.velocity.norm())) << trial;
  }
  EXPECT_GT(compared, testing::Draws(250));
}

// With zero bias impulses take energy away: ½ v⁺ᵀW⁻¹v⁺ ≤ ½ v*ᵀW⁻¹v*.
TEST(ContactProperties, ImpulsesDoNoPositiveWork) {
  std::mt19937 random(3);
  ContactSolver solver;
  for (int trial = 0; trial < testing::Draws(500); ++trial) {
    Problem p = Draw(random, trial);
    p.limits.clear();
    const VectorX start = p.velocity;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    if (!report.converged) continue;
    const SymmetricFactor W(p.FullW());
    const double before = start.dot(W.Solve(start).col(0)),
                 after = p.velocity.dot(W.Solve(p.velocity).col(0));
    EXPECT_LE(after, before * (1 + 1e-4)) << trial;
  }
}

// Two limits that ask one row to move both ways: what they give meets in the middle.
TEST(ContactProperties, LimitsThatContradictShareTheWay) {
  std::mt19937 random(8);
  ContactSolver solver;
  int failures = 0;
  for (int trial = 0; trial < testing::Draws(300); ++trial) {
    Problem p = Draw(random, 6 * trial + 2);
    p.limits.clear();
    p.limits.push_back({4, 1.0, -0.3, 0});
    p.limits.push_back({4, -1.0, -0.3, 0});
    for (LimitConstraint& l : p.limits) l.compliance = 1e-3;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    ASSERT_TRUE(p.velocity.allFinite());
    failures += report.converged ? 0 : 1;
    EXPECT_TRUE(!report.converged || std::abs(p.velocity[4]) < 0.05) << trial;
  }
  EXPECT_LE(failures, 2);
}

// Dry friction of the joints of an arm: hard rows, some slide fast and others hardly move. What a row that
// sticks bears is found to the rounding of what the others do to it, and the solver knows that.
TEST(ContactProperties, DryFrictionOfManyJointsTakesFewIterations) {
  std::mt19937 random(9);
  ContactSolver solver;
  for (int trial = 0; trial < 500; ++trial) {
    Problem p = RandomProblem(random, 1, 0, 0, 0);
    for (int row = 0; row < 6; ++row) {
      p.velocity[row] = Uniform(random, -1, 1) * (row % 2 == 0 ? 0.3 : 1e-6);
      LimitConstraint friction;
      friction.row = row;
      friction.upper = 0.1 * std::pow(10, Uniform(random, -3, 0));
      friction.lower = -friction.upper;
      p.limits.push_back(friction);
    }
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    EXPECT_TRUE(report.converged) << trial << ": " << report.residual;
    EXPECT_EQ(report.fallback, 0) << trial;
    EXPECT_LE(report.newton_iterations, 12) << trial;
  }
}

// Where the solution is unique (contacts on distinct bodies, little friction) the order cannot matter.
// Contacts that wait are found where the others close them, however badly they were guessed. With friction an
// answer need not be the only one; without it is.
TEST(ContactProperties, DeferralChangesNoAnswer) {
  std::mt19937 random(9);
  std::bernoulli_distribution is_deferred(0.7);
  ContactSolver solver;
  ContactSolverOptions options;
  options.max_relative_regularization = 1;
  int closed = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Problem p = RandomProblem(random, 4, 0, 3, 0.3);
    for (ContactConstraint& c : p.contacts) c.friction = 0;
    Problem q;
    q.W = p.W;
    q.Finish();
    q.velocity = p.velocity;
    q.contacts = p.contacts;
    for (ContactConstraint& c : q.contacts) c.may_be_deferred = is_deferred(random);
    ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, options).converged);
    ASSERT_TRUE(solver.Solve(q.blocks, q.contacts, q.limits, q.velocity, options).converged);
    EXPECT_LT((p.velocity - q.velocity).norm(), 1e-7 * (1 + p.velocity.norm())) << trial;
    for (std::size_t k = 0; k < q.contacts.size(); ++k) {
      EXPECT_LT((p.contacts[k].impulse - q.contacts[k].impulse).norm(), 1e-6) << trial;
      closed += q.contacts[k].may_be_deferred && q.contacts[k].impulse[0] > 0;
    }
  }
  EXPECT_GT(closed, 200);  // waiting was wrong that often
}

// What may be deferred and bore something in a solve before this one, as where servos change sides in between, is not left out with
// its impulse standing: bodies end with what all impulses make of their velocities.
TEST(ContactProperties, DeferralKeepsNoOldImpulse) {
  std::mt19937 random(11);
  for (int trial = 0; trial < testing::Draws(50); ++trial) {
    Problem p = testing::DrawFamily(random, testing::kFamilies[static_cast<std::size_t>(trial) % 5]);
    const VectorX start = p.velocity;
    ContactSolver solver;
    solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    for (ContactConstraint& c : p.contacts) c.may_be_deferred = true;
    const VectorX other = -start;  // what closed parts
    p.velocity = other;
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) continue;
    VectorX pushes = VectorX::Zero(start.size());
    for (const ContactConstraint& c : p.contacts) {
      if (c.port_a >= 0) pushes.segment<6>(c.port_a) += c.ImpulseOn(c.J_a);
      if (c.port_b >= 0) pushes.segment<6>(c.port_b) += c.ImpulseOn(c.J_b);
    }
    VectorX expected = other;
    for (std::size_t b = 0; b < p.W.size(); ++b)
      expected.segment(p.blocks[b].offset, p.blocks[b].size) +=
          p.W[b] * pushes.segment(p.blocks[b].offset, p.blocks[b].size);
    // Jams of masses a million apart sum pushes that cancel to nine digits.
    EXPECT_LT((p.velocity - expected).norm(), 1e-7 * (other.norm() + p.velocity.norm())) << trial;
  }
}

TEST(ContactProperties, OrderDoesNotMatter) {
  std::mt19937 random(4);
  ContactSolver solver;
  ContactSolverOptions options;
  options.tolerance = 1e-10;
  options.max_relative_regularization = 1;
  for (int trial = 0; trial < 200; ++trial) {
    Problem p = RandomProblem(random, 4, 0, 3, 0.3);
    Problem q;
    q.W = p.W;
    q.Finish();
    q.velocity = p.velocity;
    std::vector<std::size_t> order(p.contacts.size());
    std::iota(order.begin(), order.end(), 0u);
    std::shuffle(order.begin(), order.end(), random);
    for (std::size_t k : order) q.contacts.push_back(p.contacts[k]);
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, options).converged) continue;
    ASSERT_TRUE(solver.Solve(q.blocks, q.contacts, q.limits, q.velocity, options).converged);
    EXPECT_LT((p.velocity - q.velocity).norm(), 1e-7 * (1 + p.velocity.norm())) << trial;
    for (std::size_t k = 0; k < order.size(); ++k) {
      EXPECT_LT((p.contacts[order[k]].impulse - q.contacts[k].impulse).norm(), 1e-6) << trial;
    }
  }
}

TEST(ContactProperties, WarmStartAtSteadyState) {
  std::mt19937 random(5);
  ContactSolver solver;
  int slow = 0;
  for (int trial = 0; trial < 300; ++trial) {
    Problem p = Draw(random, trial);
    const VectorX start = p.velocity;
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).converged) continue;
    p.velocity = start;
    const ContactSolverReport again = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    EXPECT_TRUE(again.converged) << trial;
    slow += again.newton_iterations > 2 ? 1 : 0;
    EXPECT_LT(testing::LawViolation(p, start, p.velocity), 1e-4) << trial;
  }
  EXPECT_LE(slow, 3);  // on the edge of a cone two modes may take turns
  // A box at rest: the answer of the step before is the answer.
  Problem p = testing::BoxOnPlane(1, 0.5);
  const VectorX start = p.velocity;
  solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
  p.velocity = start;
  EXPECT_LE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven()).newton_iterations, 1);
}

TEST(ContactProperties, SameInputSameBits) {
  for (int trial = 0; trial < testing::Draws(100); ++trial) {
    std::mt19937 random_a(static_cast<unsigned>(trial)), random_b(static_cast<unsigned>(trial));
    Problem p = Draw(random_a, trial), q = Draw(random_b, trial);
    ContactSolver fresh, used;
    Problem other = Draw(random_a, trial + 1);
    used.Solve(other.blocks, other.contacts, other.limits, other.velocity);
    fresh.Solve(p.blocks, p.contacts, p.limits, p.velocity);
    used.Solve(q.blocks, q.contacts, q.limits, q.velocity);
    ASSERT_EQ(p.velocity, q.velocity);
    for (std::size_t k = 0; k < p.contacts.size(); ++k) {
      ASSERT_EQ(p.contacts[k].impulse, q.contacts[k].impulse);
    }
  }
}

// Four corners where three would do, many times over: impulses are not unique, the motion is.
TEST(ContactProperties, RedundantContacts) {
  std::mt19937 random(6);
  ContactSolver solver;
  for (int trial = 0; trial < 500; ++trial) {
    Problem p = testing::BoxOnPlane(Uniform(random, 0.1, 5), Uniform(random, 0, 1));
    for (int k = 0; k < 6; ++k) p.velocity[k] += Uniform(random, -0.5, 0.5);
    std::vector<ContactConstraint> again = p.contacts;
    p.contacts.insert(p.contacts.end(), again.begin(), again.end());
    const VectorX start = p.velocity;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    EXPECT_TRUE(report.converged) << trial << " residual " << report.residual;
    // Hard contact: w is small beside its rounding over R, 2e-5, which decides on the edge of a cone.
    EXPECT_LT(LawViolation(p, start, p.velocity), 2e-5) << trial;
  }
}

// A tower of boxes, four points a face.
TEST(ContactProperties, TowerStands) {
  for (int boxes : {2, 5, 10}) {
    Problem p;
    for (int k = 0; k < boxes; ++k) p.W.push_back(testing::BoxOnPlane(1, 0.5).W[0]);
    p.Finish();
    for (int k = 0; k < boxes; ++k) {
      p.velocity[6 * k + 5] = -testing::kGravity * testing::kStep;
      for (double x : {-0.1, 0.1}) {
        for (double y : {-0.1, 0.1}) {
          p.contacts.push_back(testing::TouchAt(6 * k - 6 < 0 ? -1 : 6 * k - 6, Vector3(x, y, 0.1), 6 * k,
                                                Vector3(x, y, -0.1), Vector3::UnitZ(), 0.5));
        }
      }
    }
    ContactSolver solver;
    const ContactSolverReport report = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity, AsGiven());
    EXPECT_TRUE(report.converged) << boxes << " residual " << report.residual;
    EXPECT_LT(p.velocity.cwiseAbs().maxCoeff(), 1e-3) << boxes;
    RecordProperty("newton_iterations_" + std::to_string(boxes), report.newton_iterations);
  }
}

}  // namespace
}  // namespace fork1s
