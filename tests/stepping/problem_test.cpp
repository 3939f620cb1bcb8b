// The contact problem of a step, taken out and solved apart, is the step's own.
#include <stepping/support.hpp>

#include "constraints/contact_problem.hpp"
#include "world/island_solver.hpp"

namespace fork1s {
namespace {

// A walker on its feet beside boxes: two islands, stops of joints, a floating base, which one solve takes at
// once.
Scene WalkerAmongBoxes() {
  Scene scene = testing::Started(testing::Walker(BaseKind::kFloating, 20, 0.2, true), VectorX::Zero(8),
                                 VectorX::Zero(8));
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.world.back().X_BG.translation().z() = -1;
  for (int i = 0; i < 2; ++i)
    scene.free_bodies.push_back(testing::BoxBody("box" + std::to_string(i), 1, Vector3(0.1, 0.1, 0.1),
                                                 Vector3(1.0 + 0.15 * i, 1, -0.89 + 0.21 * i), 0.8));
  return scene;
}

TEST(LastContactProblem, HasTheAnswerOfTheStep) {
  World world = testing::MustCreate(WalkerAmongBoxes());
  IslandSolver islands;
  ContactSolver solver;
  int compared = 0;
  for (int i = 0; i < 120; ++i) {
    ASSERT_TRUE(world.Step(testing::BackwardEuler(1.0 / 60, testing::kDown)).IsSolved()) << i;
    ContactProblem problem = world.LastContactProblem();
    if (problem.contacts.empty()) continue;
    ASSERT_EQ(problem.contacts.size(), world.contacts().size());
    ContactProblem whole = problem;
    VectorX velocity = problem.velocity, at_once = problem.velocity;
    ASSERT_TRUE(islands.Solve(problem.Blocks(), problem.contacts, problem.limits, velocity, {}).converged)
        << i;
    ASSERT_TRUE(solver.Solve(whole.Blocks(), whole.contacts, whole.limits, at_once).converged) << i;
    const double size = std::max(1e-3, problem.velocity.norm());
    // The solver ends at 1e-10 of what contact changes, island by island or at once.
    EXPECT_LT((problem.VelocityUnderImpulses() - velocity).norm(), 1e-9 * size) << i;
    EXPECT_LT((at_once - velocity).norm(), 1e-9 * size) << i;
    for (std::size_t k = 0; k < problem.contacts.size(); ++k) {
      EXPECT_LT((problem.contacts[k].impulse - world.contacts()[k].impulse).norm(), 5e-7) << i;
      // How fast corners of one box cease to push against each other depends on what else is solved.
      EXPECT_LT(std::abs(whole.contacts[k].impulse[0] - world.contacts()[k].impulse[0]), 5e-7) << i;
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
}

TEST(LastContactProblem, IsEmptyWhereNothingMayTouch) {
  World world = testing::MustCreate(testing::Chain(3, 0.1, 0.2, 0.8, 0.02, true));
  world.Step({});
  const ContactProblem problem = world.LastContactProblem();
  EXPECT_TRUE(problem.contacts.empty());
  EXPECT_EQ(problem.velocity.size(), 0);
  EXPECT_TRUE(problem.Blocks().empty());
}

}  // namespace
}  // namespace fork1s
