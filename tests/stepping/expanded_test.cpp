// Steps by a second-order model about a pose, against steps by exact poses.
#include <allocation_counter.hpp>
#include <random_mechanism.hpp>
#include <set>
#include <stepping/support.hpp>

#include <algorithm>
#include <functional>

#include "diagnostics/closure_forces.hpp"
#include "diagnostics/point_response.hpp"
#include "stepping/mechanism_model.hpp"

namespace fork1s {
namespace {

using testing::FarthestBody;
using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;
using testing::SteppedBy;

// Two worlds from the same start, for half a second of swinging under weight.
struct Swing {
  Swing(const RandomMechanismOptions& options, unsigned seed, double dt)
      : definition(testing::RandomMechanismDef(seed, options)), m(testing::Share(definition)) {
    step.h = dt;
    step.gravity = Vector3(0, 0, -9.81);
    RandomSource random(seed);
    q_dot = random.Vector(m->num_coordinates(), 2);
  }
  World Start(Recovery recovery) const {
    return MustStart(definition, VectorX::Zero(m->num_coordinates()), q_dot, Vector6::Zero(),
                     SteppedBy(recovery));
  }

  MechanismDef definition;
  std::shared_ptr<const Mechanism> m;
  VectorX q_dot;
  StepOptions step;
};

// Between expansions what is left out is of third order in poses and of second in inertia and forces.
void ExpectSwingAsExact(const RandomMechanismOptions& options,
                        const std::function<void(MechanismDynamics&, int)>& drive = {}) {
  constexpr int kSteps = 480;
  std::vector<double> shares;
  int at_bound = 0, by_expansion = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    SCOPED_TRACE(seed);
    const Swing swing(options, seed,
                      1.0 / 960);  // at 1/240 s inertia changes so fast that exact poses are as cheap
    World exact = swing.Start(Recovery::kExact), expanded = swing.Start(Recovery::kExpanded);
    const World at_start = swing.Start(Recovery::kExact);
    ASSERT_TRUE(expanded.mechanisms()[0].step_model().expands);
    double far = 0, way = 0;
    for (int i = 0; i < kSteps; ++i) {
      if (drive)
        for (World* world : {&exact, &expanded}) drive(world->mechanisms()[0], i);
      exact.Step(swing.step);
      const StepReport report = expanded.Step(swing.step);
      ASSERT_TRUE(report.finite);
      at_bound += expanded.mechanisms()[0].is_expanded() ? report.forces_at_bound : 0;
      by_expansion += report.by_expansion;
      EXPECT_TRUE(report.stages_converged);
      far = std::max(far, FarthestBody(exact, expanded));
      way = std::max(way, FarthestBody(exact, at_start));
    }
    EXPECT_LT(far, 0.02 * way);
    shares.push_back(far / way);
  }
  std::sort(shares.begin(), shares.end());
  EXPECT_LT(shares[shares.size() / 2], 3e-3);  // (8 degrees)³
  EXPECT_GT(by_expansion, 12 * kSteps / 2);
  if (options.bounded_servos > 0) {
    EXPECT_GT(at_bound, 100);
  }
}

TEST(Expanded, TreesSwingAsExactPosesDo) { ExpectSwingAsExact({}); }

TEST(Expanded, LoopsSwingAsExactPosesDo) {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  ExpectSwingAsExact(options);
}

// Servos that give no more, with and without loops: force and stiffness follow the length, whose second order loops make.
TEST(Expanded, ServosAtTheirBoundsSwingAsByExactPoses) {
  for (const int closures : {0, 2}) {
    RandomMechanismOptions options;
    options.rigid_closures = closures;
    options.bounded_servos = 3;
    ExpectSwingAsExact(options, [](MechanismDynamics& m, int step) {
      for (Eigen::Index k = 0; k < m.controls().size(); ++k)
        m.controls()(k) = 0.3 * std::sin(0.025 * step + static_cast<double>(k));
    });
  }
}

TEST(Expanded, StateThatIsPutBackGivesTheSameBits) {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  for (unsigned seed = 0; seed < 6; ++seed) {
    SCOPED_TRACE(seed);
    const Swing swing(options, seed, 1.0 / 60);
    World world = swing.Start(Recovery::kExpanded), other = swing.Start(Recovery::kExpanded);
    for (int i = 0; i < 10; ++i) world.Step(swing.step);
    WorldState saved, ended, again;
    world.Save(saved);
    for (int i = 0; i < 20; ++i) world.Step(swing.step);
    world.Save(ended);
    other.Restore(saved);
    for (int i = 0; i < 20; ++i) other.Step(swing.step);
    other.Save(again);
    EXPECT_EQ(HashOf(ended, VectorX()), HashOf(again, VectorX()));
  }
}

// Exact poses carry what pushes from outside, wherever it acts.
TEST(Expanded, APushMovesItAsExactPosesDo) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  for (unsigned seed = 0; seed < 6; ++seed) {
    SCOPED_TRACE(seed);
    const Swing swing(options, seed, 1.0 / 240);
    World exact = swing.Start(Recovery::kExact), expanded = swing.Start(Recovery::kExpanded);
    const World at_start = swing.Start(Recovery::kExact);
    for (int i = 0; i < 60; ++i) {
      for (World* world : {&exact, &expanded}) {
        MechanismDynamics& m = world->mechanisms()[0];
        const BodyIndex middle(m.mechanism().num_bodies() / 2);
        if (i >= 20 && i < 40)
          m.AddWrench(middle, Vector3(3, 1, 0), Vector3::Zero(), m.BodyPose(middle).translation());
        world->Step(swing.step);
      }
    }
    EXPECT_LT(FarthestBody(exact, expanded), 0.02 * FarthestBody(exact, at_start));
  }
}

// Joints that turn too fast for expansions go by exact poses, and expand again when they are slow.
TEST(Expanded, FastJointsGoByExactPoses) {
  const Swing swing({}, 2, 1.0 / 60);
  World world = MustStart(swing.definition, VectorX::Zero(swing.m->num_coordinates()), 10 * swing.q_dot,
                          Vector6::Zero(), SteppedBy(Recovery::kExpanded));
  int by_expansion = 0, exact = 0, expansions = 0;
  for (int i = 0; i < 600; ++i) {
    const bool is_expanded = world.mechanisms()[0].is_expanded();
    const StepReport report = world.Step(swing.step);
    ASSERT_TRUE(report.finite);
    EXPECT_LE(report.by_expansion, is_expanded ? 1 : 0);  // not where parts of it went by exact poses
    (report.by_expansion > 0 ? by_expansion : exact)++;
    expansions += report.expansions;
  }
  EXPECT_GT(exact, 5);
  EXPECT_GT(by_expansion, 10);
  EXPECT_GT(expansions, 1);
  EXPECT_LT(6 * expansions,
            by_expansion + 6);  // so many steps by each at least, but for those of speeding up
}

// A chain of many links whose joints turn by little, and whose inertia changes by much: where it would be expanded at every
// step, it goes by exact poses.
TEST(Expanded, FastChangeOfInertia_GoesByExactPoses) {
  for (const int links : {12, 24, 36}) {
    SCOPED_TRACE(links);
    World::Options options = SteppedBy(Recovery::kExpanded);
    options.reduction.modes = 6;
    MechanismDef chain = testing::Chain(links, 1.0 / links, 1.0 / links, 10, 0.05, true);
    World world = MustCreate(chain, options);
    int by_expansion = 0, expansions = 0;
    for (int i = 0; i < 240; ++i) {
      const StepReport report = world.Step(testing::TwoStage(1.0 / 60, testing::kDown));
      ASSERT_TRUE(report.finite && report.stages_converged) << i;
      by_expansion += report.by_expansion;
      expansions += report.expansions;
    }
    EXPECT_GT(by_expansion, 0);
    EXPECT_LE(6 * expansions,
              by_expansion + 6);  // so many steps by each at least, but for those of speeding up
  }
}

// New references have other numbers of coordinates while steps go by exact poses: what a world did before it was put back
// does not decide when it is expanded.
TEST(Expanded, NewReferencesByExactPoses_SameBitsAfterRestore) {
  World::Options options = SteppedBy(Recovery::kExpanded);
  options.reduction.modes = 6;
  const auto start = [&](int links) {
    return MustCreate(testing::Chain(links, 1.0 / links, 1.0 / links, 10, 0.05, true), options);
  };
  World world = start(24), other = start(24);
  const StepOptions step = testing::TwoStage(1.0 / 60, testing::kDown);
  std::set<int> sizes;
  bool is_exact = false;
  for (int i = 0; i < 240; ++i) {
    world.Step(step);
    is_exact = is_exact || !world.mechanisms()[0].is_expanded();
    if (is_exact) sizes.insert(world.mechanisms()[0].num_velocities());
    if (i % 20 > 0) continue;
    WorldState saved, ended, again;
    world.Save(saved);
    for (int k = 0; k < 10; ++k) world.Step(step);
    world.Save(ended);
    other = start(24);
    other.Restore(saved);
    for (int k = 0; k < 10; ++k) other.Step(step);
    other.Save(again);
    EXPECT_EQ(HashOf(ended, VectorX()), HashOf(again, VectorX())) << i;
  }
  EXPECT_GT(sizes.size(), 1u);
}

// Slow joints are expanded again after 120 steps, faster ones after 8 degrees, and none that turns by less than a sixteenth
// of that.
TEST(Expanded, SlowJoints_AreExpandedAgainAfterManySteps) {
  for (const auto& [turn, between] :
       {std::pair(1e-5, 0), std::pair(1e-3, 120), std::pair(2e-3, 70)}) {  // rad a step
    SCOPED_TRACE(turn);
    MechanismBuilder builder("spinner");
    BodyDef link;
    link.name = "link";
    link.parent = builder.base();
    link.inertia = testing::Brick(1, Vector3(0.1, 0.02, 0.02));
    builder.AddJoint(JointDef::Hinge("pin", builder.AddBody(link), Vector3::UnitY(), Vector3(-0.1, 0, 0))
                         .WithSpring(1e-9, 0));
    builder.SetInterfaces({"link"});
    StepOptions step = testing::TwoStage(1.0 / 60, Vector3::Zero());
    step.refresh = false;
    World world = MustStart(builder.definition(), VectorX::Zero(1), VectorX::Constant(1, 60 * turn),
                            Vector6::Zero(), SteppedBy(Recovery::kExpanded));
    std::vector<int> at;
    for (int i = 1; i <= 600; ++i)
      if (world.Step(step).expansions > 0) at.push_back(i);
    EXPECT_EQ(at.empty(), between == 0);
    for (std::size_t i = 0; i < at.size(); ++i) EXPECT_NEAR(at[i] - (i > 0 ? at[i - 1] : 0), between, 1);
  }
}

// A pose farther from the expansion than three of its angles is none: the step that leads there is halved until it goes
// by poses within, or by exact ones.
TEST(Expanded, TurnBeyondItsReach_StepIsTakenInParts) {
  for (const double turn : {0.3, 1.2}) {  // rad in the first step; three angles are 0.42
    SCOPED_TRACE(turn);
    MechanismBuilder builder("spinner");
    BodyDef link;
    link.name = "link";
    link.parent = builder.base();
    link.inertia = testing::Brick(1, Vector3(0.1, 0.02, 0.02));
    const BodyIndex body = builder.AddBody(link);
    builder.AddJoint(JointDef::Hinge("pin", body, Vector3::UnitY(), Vector3(-0.1, 0, 0)).WithSpring(1e-3, 0));
    builder.SetInterfaces({"link"});
    const StepOptions step = testing::TwoStage(1.0 / 60, Vector3::Zero());
    const VectorX q_dot = VectorX::Constant(1, 60 * turn);
    World world = MustStart(builder.definition(), VectorX::Zero(1), q_dot, Vector6::Zero(),
                            SteppedBy(Recovery::kExpanded));
    ASSERT_TRUE(world.mechanisms()[0].is_expanded());
    const StepReport report = world.Step(step);
    EXPECT_TRUE(report.finite);
    EXPECT_EQ(report.parts > 1, turn > 0.42);
    EXPECT_NEAR(world.mechanisms()[0].configuration().q(0), turn, 1e-3);
    EXPECT_FALSE(world.mechanisms()[0].is_expanded());
  }
}

// However long it goes without a new reference.
TEST(Expanded, GoesOnWithoutRefreshes) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  for (unsigned seed = 0; seed < 6; ++seed) {
    SCOPED_TRACE(seed);
    Swing swing(options, seed, 1.0 / 60);
    swing.step.refresh = false;
    World exact = swing.Start(Recovery::kExact), expanded = swing.Start(Recovery::kExpanded);
    const World at_start = swing.Start(Recovery::kExact);
    for (int i = 0; i < 60; ++i) {
      exact.Step(swing.step);
      ASSERT_TRUE(expanded.Step(swing.step).finite);
    }
    EXPECT_LT(FarthestBody(exact, expanded), 0.02 * FarthestBody(exact, at_start));
  }
}

// What loops bear is read from a pose and rates that a step by an expansion does not compute.
TEST(Expanded, ClosuresBearWhatTheyDoByExactPoses) {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  for (unsigned seed = 0; seed < 6; ++seed) {
    SCOPED_TRACE(seed);
    const Swing swing(options, seed, 1.0 / 240);
    const auto forces = [&](Recovery recovery) {
      World world = swing.Start(recovery);
      for (int i = 0; i < 20; ++i) world.Step(swing.step);
      const MechanismDynamics& m = world.mechanisms()[0];
      return ClosureForces(m, swing.step.h, Matrix6X::Zero(6, m.mechanism().num_bodies()),
                           VectorX::Zero(m.mechanism().num_constraints()));
    };
    const VectorX exact = forces(Recovery::kExact);
    // Accelerations are differences of rates that are known to second order.
    EXPECT_LT((forces(Recovery::kExpanded) - exact).norm(), 0.02 * exact.norm());
  }
}

TEST(Expanded, APointGivesWayAsByExactPoses) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  const Swing swing(options, 4, 1.0 / 240);
  const auto response = [&](Recovery recovery) {
    World world = swing.Start(recovery);
    for (int i = 0; i < 20; ++i) world.Step(swing.step);
    const MechanismDynamics& m = world.mechanisms()[0];
    return RespondAt(m, BodyIndex(m.mechanism().num_bodies() / 2), Vector3(0.1, 0, 0), swing.step.h).W;
  };
  const Matrix3 exact = response(Recovery::kExact);
  EXPECT_LT((response(Recovery::kExpanded) - exact).norm(), 5e-3 * exact.norm());
}

TEST(Expanded, AStepWithoutAnExpansionDoesNotAllocate) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  options.bounded_servos = 2;
  Swing swing(options, 4, 1.0 / 240);
  swing.q_dot *= 0.05;
  swing.step.gravity.setZero();
  World world = swing.Start(Recovery::kExpanded);
  for (int i = 0; i < 30; ++i) world.Step(swing.step);
  ASSERT_TRUE(world.mechanisms()[0].is_expanded());
  int counted = 0;
  for (int i = 0; i < 60; ++i) {
    const long before = testing::allocations.load();
    const StepReport report = world.Step(swing.step);
    if (report.expansions + report.refreshes > 0 || report.by_expansion == 0) continue;
    EXPECT_EQ(testing::allocations.load(), before) << i;
    ++counted;
  }
  EXPECT_GT(counted, 20);
}

TEST(Expanded, WhatHasNoExpansionStepsByExactPoses) {
  RandomMechanismOptions options;
  options.base = BaseKind::kFloating;
  const Swing swing(options, 3, 1.0 / 60);
  World exact = swing.Start(Recovery::kExact), expanded = swing.Start(Recovery::kExpanded);
  EXPECT_FALSE(expanded.mechanisms()[0].step_model().expands);
  EXPECT_EQ(std::count_if(expanded.warnings().begin(), expanded.warnings().end(),
                          [](const std::string& w) { return w.find("its base moves") != std::string::npos; }),
            1);
  for (int i = 0; i < 20; ++i) {
    exact.Step(swing.step);
    expanded.Step(swing.step);
  }
  WorldState a, b;
  exact.Save(a);
  expanded.Save(b);
  EXPECT_EQ(HashOf(a, VectorX()), HashOf(b, VectorX()));
}

}  // namespace
}  // namespace fork1s
