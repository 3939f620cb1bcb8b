// The contact solver of the full-coordinate simulator against that of the reduced one, which shares no code
// with it, on random problems.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <constraints/random_problems.hpp>
#include <draws.hpp>

#include "linalg/cholesky.hpp"
#include "reference/contact_problem.hpp"
#include "reference/dense_contact_solver.hpp"

namespace fork1s::reference {
namespace {

using testing::Problem;

struct Constraints {
  std::vector<ResponseBlock> blocks;
  std::vector<PointConstraint> points;
  std::vector<BoundConstraint> bounds;
};

Constraints ConstraintsOf(const Problem& p) {
  Constraints out;
  for (std::size_t i = 0; i < p.W.size(); ++i) out.blocks.push_back({p.blocks[i].offset, p.W[i]});
  for (const ContactConstraint& c : p.contacts) {
    PointConstraint& point = out.points.emplace_back();
    point.port_a = c.port_a;
    point.port_b = c.port_b;
    point.J_a = c.J_a;
    point.J_b = c.J_b;
    point.bias = c.bias;
    point.friction = c.friction;
    point.friction_scale = c.friction_scale;
    point.torsion = c.torsion;
    point.rolling = c.rolling;
    point.compliance_normal = c.compliance_normal;
    point.compliance_tangent = c.compliance_tangent;
    point.hardening_speed = c.hardening_speed;
    point.previous_impulse = c.previous_impulse;
    point.previous_moment = c.previous_moment;
    point.previous_utilization = c.previous_utilization;
  }
  for (const LimitConstraint& l : p.limits) {
    BoundConstraint& bound = out.bounds.emplace_back();
    bound.row = l.row;
    bound.sign = l.sign;
    bound.bias = l.bias;
    bound.lower = l.lower;
    bound.upper = l.upper;
    bound.previous_impulse = l.previous_impulse;
  }
  return out;
}

// Norm of a change of velocity: square root of twice its kinetic energy.
double KineticNorm(const Problem& p, const VectorX& v) {
  double sum = 0;
  for (std::size_t i = 0; i < p.W.size(); ++i) {
    const VectorX part = v.segment(p.blocks[i].offset, p.W[i].rows());
    sum += part.dot(SolveSymmetric(p.W[i], part).col(0));
  }
  return std::sqrt(sum);
}

// Torsional and rolling friction at some points; stops and dry friction on some velocities.
void AddMomentsAndBounds(std::mt19937& random, Problem& p) {
  for (ContactConstraint& c : p.contacts) {
    c.torsion = std::max(0.0, testing::Uniform(random, -0.01, 0.01));
    c.rolling = std::max(0.0, testing::Uniform(random, -0.005, 0.002));
  }
  for (int row = 0; row < p.velocity.size(); row += 7) {
    LimitConstraint& bound = p.limits.emplace_back();
    bound.row = row;
    bound.sign = row % 2 == 0 ? 1 : -1;
    if (row % 3 == 0) {
      bound.upper = testing::Uniform(random, 0, 0.1);
      bound.lower = -bound.upper;
      bound.previous_impulse = testing::Uniform(random, bound.lower, bound.upper);
    } else {
      bound.bias = testing::Uniform(random, -0.1, 0.1);
    }
  }
}

// Impulses of the step before within the cone, of the size of those that 0.1 m/s asks for.
void AddMemory(std::mt19937& random, Problem& p) {
  const MatrixX W = p.FullW();
  for (ContactConstraint& c : p.contacts) {
    const MatrixX J = p.RowsOf(c);
    const double normal = testing::Uniform(random, -0.02, 0.1) * 3 / (J * W * J.transpose()).trace();
    if (normal <= 0) continue;
    c.previous_utilization = testing::Uniform(random, 0, 1);
    const double angle = testing::Uniform(random, 0, 6), size = c.previous_utilization * c.friction * normal;
    c.previous_impulse = Vector3(normal, size * std::cos(angle), size * std::sin(angle));
    for (int k = 0; k < 3; ++k) {
      const double bound = (k == 0 ? c.torsion : c.rolling) * normal;
      c.previous_moment[k] = testing::Uniform(random, -bound, bound);
    }
  }
}

constexpr int kMaxPoints = 40;  // of a problem, so that the test takes seconds

class Families : public ::testing::TestWithParam<testing::Family> {
 protected:
  // Half of them with moments and bounds, half with memory. False for a problem that is too large.
  bool Draw(int draw, Problem& p) {
    p = testing::DrawFamily(random_, GetParam());
    testing::GiveDefaultMaterial(p);
    if (draw % 2 == 1) AddMomentsAndBounds(random_, p);
    if (draw % 4 >= 2) AddMemory(random_, p);
    const Vector2 scale(testing::Uniform(scales_, 0.2, 1.5), testing::Uniform(scales_, 0.2, 1.5));
    if (draw % 3 == 2)
      for (ContactConstraint& c : p.contacts) c.friction_scale = scale;
    return static_cast<int>(p.contacts.size()) <= kMaxPoints;
  }

 private:
  std::mt19937 random_{11}, scales_{12};
};

// Which of several solutions a solver finds is its own affair, but the solutions are common: those of the
// reduced simulator's solver satisfy the natural map. Problems whose material was made stiffer during the solve
// are left to the next test.
TEST_P(Families, SolutionsOfReducedSimulatorSatisfyNaturalMap) {
  int checked = 0;
  for (int draw = 0; draw < testing::Draws(100); ++draw) {
    Problem p;
    if (!Draw(draw, p)) continue;
    const Constraints all = ConstraintsOf(p);
    ContactProblem problem = AssembleContactProblem(all.blocks, all.points, all.bounds, p.velocity);
    RelaxInternalForces(all.points, problem);
    const double max_relative = FullContactOptions{}.max_relative_regularization;
    InitializePairCompliance(all.points, max_relative, problem);
    UpdateCompliance(all.points, max_relative, problem);
    ContactSolver solver;
    if (!solver.Solve(p.blocks, p.contacts, p.limits, p.velocity).converged) continue;
    VectorX x = VectorX::Zero(problem.size());
    for (const PointBlock& block : problem.points) {
      const ContactConstraint& c = p.contacts[static_cast<std::size_t>(block.constraint)];
      x.segment<3>(block.row) = c.impulse;
      for (std::size_t k = 0; k < 3; ++k)
        if (block.moment_row[k] >= 0) x[block.moment_row[k]] = c.moment[static_cast<Eigen::Index>(k)];
    }
    for (std::size_t i = 0; i < p.limits.size(); ++i)
      x[problem.first_bound + static_cast<int>(i)] = p.limits[i].impulse;
    if (std::any_of(problem.points.begin(), problem.points.end(), [&](const PointBlock& block) {
          const double limit = all.points[static_cast<std::size_t>(block.constraint)].hardening_speed;
          return x[block.row] * problem.R[block.row] > 2 * limit;
        }))
      continue;
    NaturalMap map;
    EvaluateNaturalMap(problem, all.points, all.bounds, x, map);
    EXPECT_LT(map.Relative(), 1e-8) << draw;
    ++checked;
  }
  EXPECT_GE(checked, testing::Draws(100) / 20);
}

TEST_P(Families, AgreeWithReducedSimulator) {
  int solved_by_both = 0, differ = 0, unsolved = 0, unsolved_by_other = 0;
  for (int draw = 0; draw < testing::Draws(100); ++draw) {
    Problem p;
    if (!Draw(draw, p)) continue;
    Constraints all = ConstraintsOf(p);
    VectorX v = p.velocity;
    const FullContactReport report = SolveContacts(all.blocks, all.points, all.bounds, v, {});
    const VectorX start = p.velocity;
    ContactSolver solver;
    const bool other_converged = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity).converged;
    unsolved += report.converged ? 0 : 1;
    unsolved_by_other += other_converged ? 0 : 1;
    if (!report.converged || !other_converged) continue;
    EXPECT_LE(report.residual, FullContactOptions{}.tolerance);
    ++solved_by_both;
    differ += KineticNorm(p, v - p.velocity) > 1e-5 * KineticNorm(p, p.velocity - start) ? 1 : 0;
  }
  EXPECT_GE(solved_by_both, testing::Draws(30));
  // Wedged bodies have several solutions (see the test before), and a few jams and stacks with hard rows stay
  // unsolved, which the report says.
  EXPECT_LE(differ, solved_by_both / 12);
  EXPECT_LE(unsolved, unsolved_by_other + solved_by_both / 8);
}

// Boxes between the world and a plate that nothing moves; the plate comes down askew.
TEST(DrivenPairs, AgreeWithReducedSimulator) {
  std::mt19937 random{5};
  for (int draw = 0; draw < 20; ++draw) {
    Problem p;
    p.W = {testing::RigidBodyW(0.03, 1e-5), MatrixX::Zero(6, 6)};
    p.Finish();
    for (const double side : {-1.0, 1.0})
      for (const double x : {-0.01, 0.01})
        for (const double y : {-0.01, 0.01}) {
          const int below = side < 0 ? -1 : 0, above = side < 0 ? 0 : 6;
          p.contacts.push_back(testing::TouchAt(below, Vector3(x, y, below < 0 ? 0 : 0.01), above,
                                                Vector3(x, y, -0.01), Vector3::UnitZ(), 0.5));
        }
    testing::GiveDefaultMaterial(p);
    p.velocity[11] = -testing::Uniform(random, 0.05, 1);
    p.velocity[6] = testing::Uniform(random, -0.5, 0.5);
    Constraints all = ConstraintsOf(p);
    VectorX v = p.velocity;
    ASSERT_TRUE(SolveContacts(all.blocks, all.points, all.bounds, v, {}).converged) << draw;
    ContactSolver solver;
    ASSERT_TRUE(solver.Solve(p.blocks, p.contacts, p.limits, p.velocity).converged) << draw;
    double most = 0;
    for (const ContactConstraint& c : p.contacts) most = std::max(most, c.impulse[0]);
    EXPECT_LT(most, 1e3) << draw;  // N·s; 1e8 where they are stiffened on and on
    for (std::size_t i = 0; i < p.contacts.size(); ++i)
      EXPECT_LT((all.points[i].impulse - p.contacts[i].impulse).norm(), 1e-6 * most) << draw << ", " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(All, Families, ::testing::ValuesIn(testing::kFamilies),
                         [](const auto& drawn) { return std::string(testing::NameOf(drawn.param)); });

}  // namespace
}  // namespace fork1s::reference
