// Moving the reference: nothing jumps, no energy appears.
#include <dynamics/support.hpp>
#include <random_mechanism.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;

struct Jump {
  double pose = 0;      // m and rad, of interfaces and all other bodies
  double kinetic = 0;   // J gained
  double velocity = 0;  // of interfaces, as a share
};

Jump RefreshAfter(const MechanismDef& definition, int modes, int steps, unsigned seed) {
  RandomSource random(seed);
  const auto m = testing::Share(definition);
  World::Options options;
  options.reduction.modes = modes;
  Vector6 V = Vector6::Zero();
  if (definition.base == BaseKind::kFloating) V = random.Six(1);
  World world = MustStart(definition, VectorX::Zero(m->num_coordinates()),
                          random.Vector(m->num_coordinates(), 2), V, options);
  StepOptions step;
  step.refresh = false;
  for (int i = 0; i < steps; ++i) world.Step(step);
  MechanismDynamics& d = world.mechanisms()[0];
  std::vector<RigidTransform> before;
  std::vector<Vector6> velocity;
  for (int b = 0; b < m->num_bodies(); ++b) {
    before.push_back(d.BodyPose(BodyIndex(b)));
    velocity.push_back(d.BodyVelocity(BodyIndex(b)));
  }
  const double kinetic = d.KineticEnergy();
  EXPECT_TRUE(d.Refresh());
  Jump jump;
  jump.kinetic = (d.KineticEnergy() - kinetic) / kinetic;
  double fastest = 0;
  for (int b = 0; b < m->num_bodies(); ++b) {
    jump.pose = std::max(
        jump.pose, Log(before[static_cast<std::size_t>(b)].inverse() * d.BodyPose(BodyIndex(b))).norm());
    fastest = std::max(fastest, velocity[static_cast<std::size_t>(b)].norm());
  }
  for (BodyIndex b : d.model().interfaces)
    jump.velocity = std::max(jump.velocity, (d.BodyVelocity(b) - velocity[b.u()]).norm() / fastest);
  EXPECT_EQ(d.state().z.norm(), 0);
  return jump;
}

TEST(Refresh, NothingJumpsWhereNothingIsTruncated) {
  for (unsigned seed = 0; seed < 10; ++seed)
    for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating}) {
      SCOPED_TRACE(seed);
      RandomMechanismOptions options;
      options.base = base;
      if (seed % 2) options.rigid_closures = 1;
      const Jump jump = RefreshAfter(testing::RandomMechanismDef(seed, options), 100, 10, seed);
      EXPECT_LT(jump.pose, 1e-9);
      // Loops that stood open by 1e-10 are closed to rounding.
      EXPECT_LT(jump.kinetic, 1e-9);
    }
}

TEST(Refresh, NothingJumpsUnderTruncation) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 14;
    options.interfaces = 1;
    const Jump jump = RefreshAfter(testing::RandomMechanismDef(seed, options), 1, 10, seed);
    // The interior's static share is part of the new reference, so even it stays.
    EXPECT_LT(jump.pose, 1e-9);
    EXPECT_LT(jump.kinetic, 1e-12);
  }
}

// The interior that is left out takes no load from how fast joint rates change: over a short step that would
// be large, feed on itself, and after a refresh hold what the new coordinates lack.
TEST(Refresh, ShortStepsGoWhereLongerOnesGo) {
  int kept_apart = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    RandomMechanismOptions options;
    options.bodies = 12;
    options.rigid_closures = 1;
    options.interfaces = 1;
    const MechanismDef definition = testing::RandomMechanismDef(seed, options);
    const auto m = testing::Share(definition);
    World::Options world_options;
    world_options.reduction.modes = 1;
    bool has_interior = false;
    const auto end = [&](int steps) {
      RandomSource random(seed);
      World world = MustStart(definition, VectorX::Zero(m->num_coordinates()),
                              random.Vector(m->num_coordinates(), 2), Vector6::Zero(), world_options);
      StepOptions step = testing::Still(4e-3 / steps);
      step.refresh = false;
      MechanismDynamics& d = world.mechanisms()[0];
      has_interior = d.model().has_complement && d.model().loop_rank() > 0;
      for (int i = 0; i < steps; ++i) {
        if (i == steps / 2) {
          EXPECT_TRUE(d.Refresh());
        }
        world.Step(step);
      }
      return d.configuration().q;
    };
    const VectorX fine = end(400), coarse = end(200);
    if (!has_interior) continue;
    // Of first order, and the way of interiors that are nearly free is long: one of twenty comes to 1 %.
    EXPECT_LT((fine - coarse).norm(), 0.05 * coarse.norm()) << seed;
    ++kept_apart;
  }
  EXPECT_GT(kept_apart, 5);
}

TEST(Refresh, StepsAfterItMoveOn) {
  // A chain that falls through 60 degrees and more: poses go on from step to step at no more than the speed.
  World world = testing::MustCreate(testing::Chain(8, 0.1, 0.2, 0.8, 0.02, true));
  StepOptions step;
  step.gravity = Vector3(0, -9.81, 0);
  const MechanismDynamics& chain = world.mechanisms()[0];
  const BodyIndex tip = chain.mechanism().FindBody("tip");
  int refreshes = 0;
  Vector3 before = chain.BodyPose(tip).translation();
  for (int i = 0; i < 240; ++i) {
    const double speed = chain.BodyVelocity(tip).tail<3>().norm();
    const StepReport report = world.Step(step);
    ASSERT_TRUE(report.finite);
    ASSERT_EQ(report.failed_refreshes, 0);
    refreshes += report.refreshes;
    const Vector3 now = chain.BodyPose(tip).translation();
    const double next = chain.BodyVelocity(tip).tail<3>().norm();
    // Half as much again as the faster end, and what gravity may add within a step.
    ASSERT_LT((now - before).norm(), 1.5 * step.h * std::max(speed, next) + 0.01) << i;
    before = now;
  }
  EXPECT_GE(refreshes, 4);
}

}  // namespace
}  // namespace fork1s
