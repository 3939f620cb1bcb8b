// Stops of joints where loops have a say.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "support.hpp"

namespace fork1s {
namespace {

// A link on a floating base that carries a triangle of two rods, pinned to it and to each other: none of the
// three turns against another, whatever the springs. Both rods stand at their stops.
MechanismDef LinkWithTriangle(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Vector3(uniform(random), uniform(random), uniform(random)); };
  const Vector3 axis = vector().normalized();
  MechanismBuilder builder("link with a triangle", BaseKind::kFloating, testing::Rod(1, 0.3));
  BodyDef link;
  link.name = "link";
  link.parent = builder.base();
  link.inertia = testing::Rod(1, 0.3);
  const BodyIndex carrier = builder.AddBody(link);
  builder.AddJoint(JointDef::Hinge("knee", carrier, axis).WithSpring(5));
  const Vector3 apex = 0.2 * vector();
  BodyIndex rods[2];
  for (int i = 0; i < 2; ++i) {
    BodyDef rod;
    rod.name = i == 0 ? "first rod" : "second rod";
    rod.parent = carrier;
    rod.X_PB = RigidTransform(Matrix3::Identity(), 0.2 * vector());
    rod.inertia = testing::Rod(0.3, 0.2);
    rods[i] = builder.AddBody(rod);
    builder.AddJoint(JointDef::Hinge(rod.name + " pin", rods[i], axis).WithSpring(0.1).WithLimits(0, 0.5));
  }
  const auto in = [&](int i) {
    return Vector3(apex -
                   builder.definition().bodies[static_cast<std::size_t>(rods[i].value())].X_PB.translation());
  };
  builder.AddClosure(ClosureDef::Connect("apex", rods[0], rods[1], in(0), in(1)));
  builder.SetInterfaces({"link"});
  return builder.definition();
}

TEST(Stops, OfJointsThatLoopsHoldPushNothing) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE(seed);
    VectorX rates = VectorX::Zero(3);
    rates(0) = 2;
    World world = testing::MustStart(LinkWithTriangle(seed), VectorX::Zero(3), rates);
    const double before = world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero());
    for (int i = 0; i < 60; ++i) {
      const StepReport report = world.Step(testing::Still());
      ASSERT_TRUE(report.finite) << i;
      ASSERT_TRUE(report.IsSolved()) << i;
    }
    EXPECT_LE(world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero()), before * (1 + 1e-9));
    EXPECT_LT(world.mechanisms()[0].configuration().q.tail(2).cwiseAbs().maxCoeff(), 1e-8);
  }
}

// A triangle of rods pinned to each other and to the ground: nothing is left to move, and its joints have
// stops and dry friction all the same.
TEST(Stops, OfAMechanismThatCannotMove) {
  MechanismDef def = LinkWithTriangle(1);
  def.base = BaseKind::kFixed;
  def.joints.erase(def.joints.begin());
  DryFrictionDef friction;
  friction.name = "in a pin";
  friction.terms = {{FreedomRef{JointIndex(0), 0}, 1.0}};
  friction.force = 1;
  def.frictions.push_back(friction);
  World world = testing::MustStart(def, VectorX::Zero(2), VectorX::Zero(2));
  ASSERT_EQ(world.mechanisms()[0].model().size(), 0);
  for (int i = 0; i < 3; ++i) {
    const StepReport report = world.Step({});
    EXPECT_TRUE(report.finite);
    EXPECT_EQ(report.limits, 0);
  }
}

// Two rods on hinges that a rope 1.3 m too long in every pose draws upright, where the row of its stop vanishes.
TEST(Stops, OfATendonThatNoPoseSatisfiesLeaveItStillAtItsShortest) {
  for (const double damping : {0.0, 0.05})
    for (const double h : {1.0 / 240, 1.0 / 60}) {
      SCOPED_TRACE("damping " + std::to_string(damping) + ", h " + std::to_string(h));
      MechanismBuilder builder("arm");
      BodyIndex parent = builder.base();
      for (const char* name : {"upper", "lower"}) {
        BodyDef rod;
        rod.name = name;
        rod.parent = parent;
        rod.X_PB = RigidTransform(Vector3(parent == builder.base() ? 0 : 0.3, 0, 0));
        rod.inertia = testing::Rod(1, 0.3);
        parent = builder.AddBody(rod);
        builder.AddJoint(JointDef::Hinge(name, parent, Vector3::UnitY()).WithSpring(0, damping));
      }
      builder.SetInterfaces({"lower"});
      MechanismDef def = builder.definition();
      PathElementDef top, end;
      top.body = builder.base();
      top.X_BE = RigidTransform(Vector3(0, 0, 2));
      end.body = parent;
      end.X_BE = RigidTransform(Vector3(0.3, 0, 0));
      def.paths.push_back({"rope", {top, end}});
      LengthLimitDef rope;
      rope.name = "rope";
      rope.along = {0, 1};
      rope.upper = 0.1 - std::hypot(2, 0.6);  // beyond the start's
      def.length_limits.push_back(rope);
      World world = testing::MustCreate(def);
      const auto energy = [&] { return world.KineticEnergy() + world.PotentialEnergy(testing::kDown); };
      const double lift = 2 * 9.81 * 0.6;  // J: more than it takes to raise both
      double before = energy(), pull = 0;
      const double start = before;
      const int steps = static_cast<int>(std::lround(20 / h));
      for (int i = 0; i < steps; ++i) {
        const StepReport report = world.Step(testing::TwoStage(h, testing::kDown));
        ASSERT_TRUE(report.finite) << i;
        // At most 2 kg at 0.1 m/s against the weights' 20 N and what holds the swing.
        if (damping > 0) {
          EXPECT_LT(energy() - before, 100 * 0.1 * h) << i;
        }
        before = energy();
        if (i > steps / 2) pull = std::max(pull, world.StopImpulses(0)[1] / h);
      }
      EXPECT_LT(energy(), start + lift);
      if (damping == 0) continue;  // swings on
      EXPECT_LT(pull, 1e3);
      EXPECT_LT(world.KineticEnergy(), 1e-8);
      EXPECT_NEAR(world.mechanisms()[0].BodyPose(parent).translation().z(), 0.3, 1e-4);
    }
}

}  // namespace
}  // namespace fork1s
