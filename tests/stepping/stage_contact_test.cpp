// Contacts and stops in the two-stage step: what lasts is no impact, what is met slowly stays, and a gap that
// bends is closed to second order.
#include <cmath>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustCreate;
using testing::MustStart;
using testing::TwoStage;

// A box between two jaws on slides, each pressed against it by a servo of `stiffness` [N/m]; lengths in
// multiples of `scale`, no gravity.
Scene Grip(double scale, double stiffness) {
  MechanismBuilder builder("gripper");
  for (const double side : {-1.0, 1.0}) {
    BodyDef jaw;
    jaw.name = side < 0 ? "left" : "right";
    jaw.parent = builder.base();
    jaw.X_PB = RigidTransform(Vector3(0.06 * scale * side, 0, 0));
    jaw.inertia = testing::Brick(0.1, scale * Vector3(0.01, 0.03, 0.03));
    jaw.geometries.push_back(testing::Geometry(jaw.name, Box{scale * Vector3(0.01, 0.03, 0.03)}, 0.6));
    const BodyIndex b = builder.AddBody(jaw);
    JointDef slide = JointDef::Slide(jaw.name, b, Vector3(-side, 0, 0));
    slide.freedoms[0].stiffness = stiffness;
    slide.freedoms[0].damping = 21 * std::sqrt(stiffness / 200);
    builder.AddJoint(slide);
  }
  builder.SetInterfaces({"left", "right"});
  MechanismDef gripper = builder.definition();
  for (int j = 0; j < 2; ++j) {
    ControlDef servo;
    servo.name = j == 0 ? "left" : "right";
    servo.terms.emplace_back(FreedomRef{JointIndex(j), 0}, 1.0);
    servo.gain = stiffness;
    servo.is_setpoint = true;
    servo.initial = 0.05 * scale;
    gripper.controls.push_back(servo);
  }
  Scene scene;
  scene.mechanisms.push_back(gripper);
  scene.free_bodies.push_back(
      testing::BoxBody("box", 0.5, scale * Vector3(0.048, 0.02, 0.02), Vector3::Zero(), 0.6));
  return scene;
}

double SumOfNormalForces(const World& world, double h) {
  double force = 0;
  for (const ContactRecord& c : world.contacts()) force += c.impulse(0) / h;
  return force;
}

TEST(TwoStageContact, AGripWithoutGravityIsNoImpact) {
  for (const double scale : {0.1, 1.0, 10.0})
    for (const double stiffness : {200.0, 2e4})
      for (const double h : {1.0 / 30, 1.0 / 60, 1.0 / 240, 1.0 / 960}) {
        SCOPED_TRACE(::testing::Message() << "scale " << scale << ", " << stiffness << " N/m, step " << h);
        World world = MustCreate(Grip(scale, stiffness));
        const StepOptions step = TwoStage(h, Vector3::Zero());
        const int second = static_cast<int>(std::lround(1 / h));
        for (int i = 0; i < second; ++i) ASSERT_TRUE(world.Step(step).finite);
        double least = 1e300, most = 0;
        for (int i = 0; i < second; ++i) {
          const StepReport report = world.Step(step);
          ASSERT_TRUE(report.finite);
          EXPECT_EQ(report.parts, 1);
          least = std::min(least, SumOfNormalForces(world, h));
          most = std::max(most, SumOfNormalForces(world, h));
        }
        // Servo 0.05, surfaces met at 0.002 of it: stiffness times 0.048, on either side, less what contacts
        // press in.
        EXPECT_NEAR(most, 2 * stiffness * 0.048 * scale, 1e-3 * most + 2 * stiffness * step.material.depth);
        EXPECT_LT(most - least, 1e-8 * most);
      }
}

// A ball that meets a wall at 10 mm/s, at any time within a step, is slower than what makes an impact of it.
// Extrapolated from a first stage that stopped it, it left at 1.4 times its speed. At most 0.28 are left
// where only the base point of the second stage lies beyond the wall: what overlaps is pushed out.
TEST(TwoStageContact, ASlowTouchIsNotThrownBack) {
  for (const double scale : {0.1, 1.0, 10.0})
    for (int k = 0; k < 20; ++k) {
      SCOPED_TRACE("scale " + std::to_string(scale) + ", phase " + std::to_string(k));
      Scene scene;
      scene.world.push_back(testing::Geometry("wall", Plane{}, 0));
      const double radius = 0.02 * scale, speed = 0.01 * scale, h = 1.0 / 60;
      const Vector3 start(0, 0, radius + speed * h * (2 + 0.05 * k));
      scene.free_bodies.push_back(testing::BallBody("ball", 0.1, radius, start, 0));
      World world = MustCreate(scene);
      world.free_bodies()[0].SetState(RigidTransform(start), Vector3::Zero(), Vector3(0, 0, -speed));
      // Gravity along the wall: what presses onto it is nothing.
      for (int i = 0; i < 10; ++i) ASSERT_TRUE(world.Step(TwoStage(h, Vector3(9.81 * scale, 0, 0))).finite);
      EXPECT_LT(std::abs(world.free_bodies()[0].velocity_of_center().z()), 0.3 * speed);
    }
}

// A step is taken in parts where the gap closes within it, and whole where it closes just after, wherever in the step
// that is: halves that begin where the step does go by what the whole has foreseen.
TEST(TwoStageContact, AStepIsTakenInPartsWhereTheGapClosesWithinIt) {
  const double h = 1.0 / 60, radius = 0.02, speed = 1;
  for (const double share : {0.01, 0.12, 0.13, 0.24, 0.26, 0.49, 0.51, 0.76, 0.99, 1.01}) {
    SCOPED_TRACE(share);
    Scene scene;
    scene.world.push_back(testing::Geometry("wall", Plane{}, 0));
    const Vector3 start(0, 0, radius + share * speed * h);
    scene.free_bodies.push_back(testing::BallBody("ball", 0.1, radius, start, 0));
    World world = MustCreate(scene);
    world.free_bodies()[0].SetState(RigidTransform(start), Vector3::Zero(), Vector3(0, 0, -speed));
    const StepReport report = world.Step(TwoStage(h, Vector3::Zero()));
    EXPECT_EQ(report.parts > 1, share < 1);
    EXPECT_EQ(report.impact, share < 1);
    // Where it lands in the last part the next step stops it.
    world.Step(TwoStage(h, Vector3::Zero()));
    EXPECT_LT(std::abs(world.free_bodies()[0].velocity_of_center().z()),
              share < 1 ? 0.01 * speed : 2 * speed);
    // The depth of the material, and the way by the hundredth of the speed that is left at most.
    EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), radius, 1e-5 + 0.01 * speed * 2 * h);
  }
}

// What is faster than the depth to which contacts press in, 10 um a step, is an impact also where nothing
// weighs, whatever the size of the bodies: it stops to 1 %. Near that speed the shortest part may leave less
// than it, and half comes back.
TEST(TwoStageContact, AnImpactWithoutGravityStops) {
  for (const double radius : {0.02, 1.0})
    for (const double h : {1.0 / 60, 1.0 / 960})
      for (const double depths : {1.2, 10.0, 100.0})  // of approach, a step
        for (int k = 0; k < 12; ++k) {
          SCOPED_TRACE("radius " + std::to_string(radius) + ", h " + std::to_string(h) + ", depths a step " +
                       std::to_string(depths) + ", phase " + std::to_string(k));
          const StepOptions step = TwoStage(h, Vector3::Zero());
          const double speed = depths * step.material.depth / h;
          const Vector3 start(0, 0, radius + speed * h * (2 + k / 12.0));
          Scene scene;
          scene.world.push_back(testing::Geometry("wall", Plane{}, 0));
          scene.free_bodies.push_back(
              testing::BallBody("ball", 4000 * std::pow(radius, 3), radius, start, 0));
          World world = MustCreate(scene);
          world.free_bodies()[0].SetState(RigidTransform(start), Vector3::Zero(), Vector3(0, 0, -speed));
          for (int i = 0; i < 12; ++i) ASSERT_TRUE(world.Step(step).finite);
          EXPECT_LT(std::abs(world.free_bodies()[0].velocity_of_center().z()),
                    (depths < 2 ? 0.6 : 0.01) * speed);
        }
}

// The same of a slide that reaches its stop.
TEST(TwoStageContact, ASlowStopIsNotThrownBack) {
  for (int k = 0; k < 20; ++k) {
    SCOPED_TRACE(k);
    const double h = 1.0 / 60, speed = 0.01;
    MechanismBuilder builder("slider");
    BodyDef cart;
    cart.name = "cart";
    cart.parent = builder.base();
    cart.inertia = testing::Ball(1, 0.1);
    const BodyIndex b = builder.AddBody(cart);
    JointDef slide = JointDef::Slide("slide", b, Vector3::UnitX());
    slide.freedoms[0].upper = speed * h * (2 + 0.05 * k);
    slide.freedoms[0].lower = -1;
    builder.AddJoint(slide);
    builder.SetInterfaces({"cart"});
    World world = MustStart(builder.definition(), VectorX::Zero(1), VectorX::Constant(1, speed));
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(world.Step(TwoStage(h, Vector3(0, 0, -9.81))).finite);
    EXPECT_LT(world.mechanisms()[0].BodyVelocity(b).tail<3>().norm(), 0.3 * speed);
  }
}

// What is met at speed leaves none of it, however short the step: a rebound that a stage or part leaves would
// last. A ball on its floor keeps what it was pressed in by, which is pushed out at a fifth of that a step.
TEST(TwoStageContact, AnImpactStopsHoweverShortTheStep) {
  constexpr double kRadius = 0.05;
  const Vector3 weight(0, 0, -9.81);
  for (const double drop : {1e-3, 0.01, 0.05})
    for (const int parts : {1, 4, 16, 64, 256, 1024, 4096}) {
      const double h = 1.0 / 60 / parts, fall = std::sqrt(2 * drop / 9.81), speed = fall * 9.81;
      for (int k = 0; k < 5; ++k) {
        SCOPED_TRACE(::testing::Message() << drop << " m, " << parts << " parts, phase " << k);
        // From half a step to four before it is met.
        const double before = h * (0.5 + 0.7 * k), gap = speed * before;
        MechanismBuilder builder("slider");
        BodyDef cart;
        cart.name = "cart";
        cart.parent = builder.base();
        cart.inertia = testing::Ball(1, 0.1);
        const BodyIndex b = builder.AddBody(cart);
        JointDef slide = JointDef::Slide("slide", b, Vector3::UnitZ());
        slide.freedoms[0].lower = -gap;
        slide.freedoms[0].upper = 1;
        builder.AddJoint(slide);
        builder.SetInterfaces({"cart"});
        World stopped = MustStart(builder.definition(), VectorX::Zero(1), VectorX::Constant(1, -speed));
        const Vector3 start(0, 0, kRadius + gap);
        Scene scene;
        scene.world.push_back(testing::Geometry("floor", Plane{}, 0));
        scene.free_bodies.push_back(testing::BallBody("ball", 0.5, kRadius, start, 0));
        World landed = MustCreate(scene);
        landed.free_bodies()[0].SetState(RigidTransform(start), Vector3::Zero(), Vector3(0, 0, -speed));
        double up_stop = -1, up_floor = -1;
        for (int i = 0; i < 30; ++i) {
          ASSERT_TRUE(stopped.Step(TwoStage(h, weight)).finite);
          ASSERT_TRUE(landed.Step(TwoStage(h, weight)).finite);
          if (i < 6) continue;
          up_stop = std::max(up_stop, stopped.mechanisms()[0].BodyVelocity(b)(5));
          up_floor = std::max(up_floor, landed.free_bodies()[0].velocity_of_center().z());
        }
        EXPECT_LT(up_stop, 1e-9 * speed);
        EXPECT_LT(up_floor, 0.01 * speed);
      }
    }
}

// A bob on a string, a limit of length between two points, that swings, or turns about it where nothing
// weighs: the string bends the path and stays taut.
TEST(TwoStageContact, ATautStringIsNoImpact) {
  constexpr double kLength = 0.4;
  MechanismDef def = testing::BobOnPath(0.2, kLength, 0.7, "string");
  LengthLimitDef limit;
  limit.name = "string";
  limit.upper = 0;  // counts from the length at q = 0
  limit.along = {0, 1};
  def.length_limits.push_back(limit);
  for (const bool weighs : {true, false})
    for (const double h : {1.0 / 60, 1.0 / 240}) {
      SCOPED_TRACE((weighs ? "swings, h " : "turns, h ") + std::to_string(h));
      const Vector3 along(std::cos(0.7), 0, std::sin(0.7));
      const VectorX rates = weighs ? Vector2(0, 0) : Vector2(2 * along.x(), 2 * along.z());
      World world = MustStart(def, VectorX::Zero(2), rates);
      const StepOptions step = TwoStage(h, weighs ? Vector3(0, 0, -9.81) : Vector3(0, 0, 0));
      int halved = 0;
      double longest = 0;
      for (double t = 0; t < 3; t += h) {
        const StepReport report = world.Step(step);
        ASSERT_TRUE(report.finite);
        halved += report.parts > 1;
        longest = std::max(longest, world.mechanisms()[0].BodyPose(BodyIndex(1)).translation().norm());
      }
      EXPECT_LE(halved, 1);  // the first, from a string that carries nothing yet
      EXPECT_LT(longest, kLength * (1 + 1e-3));
    }
}

// A bob that falls into its string: one impact takes the speed along the string, and from then on it swings,
// by whatever angle, without another.
TEST(TwoStageContact, AStringThatHasBecomeTautIsNoImpact) {
  constexpr double kLength = 0.4, kSlack = 0.05, kMass = 0.2;
  for (const double angle : {0.9, 1.4})
    for (const bool weighs : {true, false})
      for (const double h : {1.0 / 60, 1.0 / 240}) {
        SCOPED_TRACE(::testing::Message() << angle << (weighs ? " swings, h " : " turns, h ") << h);
        MechanismDef def = testing::BobOnPath(kMass, kLength - kSlack, angle, "string");
        LengthLimitDef limit;
        limit.name = "string";
        limit.upper = kSlack;  // counts from the length at q = 0
        limit.along = {0, 1};
        def.length_limits.push_back(limit);
        const Vector3 out(std::sin(angle), 0, -std::cos(angle)), along(std::cos(angle), 0, std::sin(angle));
        const Vector3 start = weighs ? Vector3(0, 0, 0) : Vector3(0.5 * out + 2 * along);
        World world = MustStart(def, VectorX::Zero(2), Vector2(start.x(), start.z()));
        const StepOptions step = TwoStage(h, weighs ? Vector3(0, 0, -9.81) : Vector3(0, 0, 0));
        int halved = 0;
        double energy = 0;  // after the impact [J]
        for (double t = 0; t < 3; t += h) {
          const StepReport report = world.Step(step);
          ASSERT_TRUE(report.finite);
          halved += report.parts > 1;
          if (report.parts > 1) energy = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
        }
        EXPECT_LE(halved, 2);  // the impact, and its end where that comes with the step's
        const double lost = energy - world.KineticEnergy() - world.PotentialEnergy(step.gravity);
        EXPECT_NEAR(lost / (kMass * 9.81 * kLength), 0, 0.04 * 60 * h);  // 0.034 at 1/60 s, 0.005 at 1/240 s
      }
}

// A ball whose centre of mass lies off its centre rolls in a bent path: the gap that each stage linearizes
// bends too.
TEST(TwoStageContact, ARollingBallOffItsCenterFollowsItsBentPath) {
  const auto run = [](double h) {
    Scene scene;
    scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
    FreeBodyDef ball = testing::BallBody("ball", 0.5, 0.05, Vector3(0, 0, 0.05), 0.8);
    ball.inertia.center = Vector3(0.015, 0.005, 0);
    ball.inertia.rotational = Vector3(5e-4, 5e-4, 5e-4).asDiagonal();
    scene.free_bodies.push_back(ball);
    World world = MustCreate(scene);
    world.free_bodies()[0].SetState(RigidTransform(Vector3(0, 0, 0.05)), Vector3(0, 5, 0),
                                    Vector3(0.25, 0, 0));
    for (int i = 0; i < std::lround(2 / h); ++i)
      EXPECT_TRUE(world.Step(TwoStage(h, Vector3(0, 0, -9.81))).finite);
    return world.free_bodies()[0].pose().translation();
  };
  const Vector3 truth = run(1.0 / 3840);
  // 2.3 and 0.42 mm with the gap that each stage linearizes.
  EXPECT_LT((run(1.0 / 60) - truth).head<2>().norm(), 1e-3);
  EXPECT_LT((run(1.0 / 240) - truth).head<2>().norm(), 1e-4);
}

}  // namespace
}  // namespace fork1s
