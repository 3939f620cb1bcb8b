// Where contact points are redundant, forces spread as on an elastic pad: symmetric, and without squeezing
// sideways.
#include <fork1s/mechanism/builder.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::BoxBody;
using testing::MustCreate;

constexpr double kFallRate = 9.81;

/// Impulses of the last step as forces [N], of contacts that bear something.
std::vector<Vector3> Forces(const World& world, double h) {
  std::vector<Vector3> forces;
  for (const ContactRecord& c : world.contacts())
    if (c.impulse(0) > 0) forces.push_back(c.impulse / h);
  return forces;
}

Scene OnFloor(const FreeBodyDef& body, double friction) {
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, friction));
  scene.free_bodies.push_back(body);
  return scene;
}

TEST(Pad, ARestingBoxStandsOnEqualCorners) {
  for (const double mass : {0.05, 1.0, 50.0, 1000.0}) {
    World world =
        MustCreate(OnFloor(BoxBody("box", mass, Vector3(0.05, 0.05, 0.05), Vector3(0, 0, 0.05), 0.8), 0.8));
    const StepOptions step;
    for (int i = 0; i < 120; ++i) EXPECT_TRUE(world.Step(step).IsSolved()) << i;
    const std::vector<Vector3> forces = Forces(world, step.h);
    ASSERT_EQ(forces.size(), 4u);
    for (const Vector3& f : forces) {
      EXPECT_NEAR(f(0), mass * kFallRate / 4, 1e-6 * mass * kFallRate);
      EXPECT_LT(f.tail<2>().norm(), 1e-6 * mass * kFallRate);
    }
    // 10 µm is what material under heavy things is made stiff for, so it is met to rounding.
    EXPECT_GT(world.free_bodies()[0].pose().translation().z(), 0.05 - 1e-5 * (1 + 1e-9));
    EXPECT_LT(world.free_bodies()[0].pose().translation().z(), 0.05);
  }
}

// Dropped askew: what corners squeezed against each other while it settled has faded.
TEST(Pad, ADroppedBoxComesToRestWithoutSqueeze) {
  FreeBodyDef box = BoxBody("box", 1, Vector3(0.05, 0.05, 0.05), Vector3(0, 0, 0.07), 0.8);
  box.X_WB.rotation() = Eigen::AngleAxisd(0.2, Vector3(1, 0.3, 0.2).normalized()).toRotationMatrix();
  World world = MustCreate(OnFloor(box, 0.8));
  const StepOptions step;
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(world.Step(step).IsSolved()) << i;
  const std::vector<Vector3> forces = Forces(world, step.h);
  ASSERT_EQ(forces.size(), 4u);
  for (const Vector3& f : forces) {
    EXPECT_NEAR(f(0), kFallRate / 4, 1e-4);
    EXPECT_LT(f.tail<2>().norm(), 1e-6 * kFallRate);
  }
}

// So fast that every hind corner, which bears nothing since friction tips the box, comes to where a front
// corner was a step ago: each finds its own forces again, not the other's, and starts from the answer.
TEST(Pad, CornersThatSlideAreTheSameContacts) {
  const StepOptions step;
  const double speed = 10, half = 0.5 * speed * step.h, height = half / 0.2;
  World world =
      MustCreate(OnFloor(BoxBody("box", 1, Vector3(half, 0.05, height), Vector3(0, 0, height), 0.4), 0.4));
  world.free_bodies()[0].SetState(RigidTransform(Vector3(0, 0, height)), Vector3::Zero(),
                                  Vector3(speed, 0, 0));
  for (int i = 0; i < 6; ++i) {
    const StepReport report = world.Step(step);
    EXPECT_EQ(report.solver.active, 2);
    if (i > 0) {
      EXPECT_EQ(report.solver.newton_iterations, 1) << i;
    }
  }
}

TEST(Pad, ATableStandsOnFourLegs) {
  FreeBodyDef table = BoxBody("table", 20, Vector3(0.6, 0.4, 0.02), Vector3(0, 0, 0.72), 0.6);
  for (const double x : {-0.55, 0.55})
    for (const double y : {-0.35, 0.35})
      table.geometries.push_back(
          testing::Geometry("leg", Sphere{0.02}, 0.6, RigidTransform(Vector3(x, y, -0.7))));
  World world = MustCreate(OnFloor(table, 0.6));
  const StepOptions step;
  for (int i = 0; i < 120; ++i) EXPECT_TRUE(world.Step(step).IsSolved()) << i;
  const std::vector<Vector3> forces = Forces(world, step.h);
  ASSERT_EQ(forces.size(), 4u);
  for (const Vector3& f : forces) {
    EXPECT_NEAR(f(0), 20 * kFallRate / 4, 1e-6 * 20 * kFallRate);
    EXPECT_LT(f.tail<2>().norm(), 1e-6 * 20 * kFallRate);
  }
}

/// A box between two flat jaws that soft springs press on it with `force` each.
struct Jaws {
  double mass = 0.5, force = 20, friction = 1;

  Scene Make() const {
    const Vector3 half(0.03, 0.03, 0.03);
    Scene scene;
    scene.free_bodies.push_back(BoxBody("box", mass, half, Vector3::Zero(), friction));
    MechanismBuilder builder("gripper");
    constexpr double kStiffness = 10;  // N/m: what the pads give does not change the force
    for (const int side : {-1, 1}) {
      BodyDef body;
      body.name = side < 0 ? "left" : "right";
      body.parent = builder.base();
      body.X_PB = RigidTransform(Vector3(side * 0.04, 0, 0));
      body.inertia.mass = 0.05;
      body.inertia.rotational = 1e-5 * Matrix3::Identity();
      body.geometries.push_back(
          testing::Geometry(body.name + "_pad", Box{Vector3(0.01, 0.02, 0.02)}, friction));
      const BodyIndex b = builder.AddBody(body);
      JointDef slide = JointDef::General(body.name + "_slide", b, Matrix6X::Identity(6, 6).middleCols(3, 1));
      slide.freedoms[0].stiffness = kStiffness;
      slide.freedoms[0].damping = 1;
      slide.freedoms[0].rest = -side * force / kStiffness;
      builder.AddJoint(slide);
    }
    builder.SetInterfaces({"left", "right"});
    scene.mechanisms.push_back(builder.definition());
    return scene;
  }
  double NeededFriction() const { return mass * kFallRate / (2 * force); }
};

struct Course {
  double fall = 0, tilt = 0;  // m, rad after a second
  int unconverged = 0;
};

Course AfterOneSecond(const Jaws& jaws, double h) {
  World world = MustCreate(jaws.Make());
  StepOptions step;
  step.h = h;
  Course held;
  for (int i = 0; i < static_cast<int>(std::lround(1 / h)); ++i)
    held.unconverged += world.Step(step).IsSolved() ? 0 : 1;
  const RigidTransform& X = world.free_bodies()[0].pose();
  held.fall = -X.translation().z();
  held.tilt = Eigen::AngleAxisd(Matrix3(X.rotation())).angle();
  return held;
}

TEST(Pad, FlatJawsHoldAtTheFrictionTheyNeed) {
  for (const double h : {1.0 / 60, 0.004}) {
    Jaws jaws;
    jaws.friction = 1.02 * jaws.NeededFriction();
    const Course held = AfterOneSecond(jaws, h);
    EXPECT_EQ(held.unconverged, 0);
    EXPECT_LT(held.fall, 2e-4) << h;
    EXPECT_LT(held.tilt, 1e-6) << h;
    jaws.friction = 0.98 * jaws.NeededFriction();
    const Course slips = AfterOneSecond(jaws, h);
    EXPECT_EQ(slips.unconverged, 0);
    // At 2 % of g from the start, until it is past the jaws.
    EXPECT_GT(slips.fall, 0.01) << h;
  }
}

// All the way to its limit a symmetric grasp stays symmetric.
TEST(Pad, ASymmetricGraspNearItsLimitDoesNotTilt) {
  for (const double share : {1.3, 1.1, 1.01}) {
    Jaws jaws;
    jaws.friction = share * jaws.NeededFriction();
    EXPECT_LT(AfterOneSecond(jaws, 1.0 / 60).tilt, 1e-6) << share;
  }
}

// What starts 20 mm deep comes out, at no more than the speed stated, by either rule: one of two steps must not take the
// jump for the beginning of a parabola. It does not hop at short steps either.
TEST(Pad, ADeepStartIsPushedApartGently) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage})
    for (const double h : {1.0 / 60, 1.0 / 500, 1.0 / 2000}) {
      SCOPED_TRACE(::testing::Message() << (integrator == Integrator::kTwoStage) << ' ' << 1 / h);
      World world =
          MustCreate(OnFloor(BoxBody("box", 1, Vector3(0.05, 0.05, 0.05), Vector3(0, 0, 0.03), 0.8), 0.8));
      StepOptions step;
      step.h = h;
      step.integrator = integrator;
      double fastest = 0, highest = 0;
      for (int i = 0; i * h < 2; ++i) {
        world.Step(step);
        fastest = std::max(fastest, world.free_bodies()[0].velocity_of_center().norm());
        highest = std::max(highest, world.free_bodies()[0].pose().translation().z());
      }
      EXPECT_LE(fastest, step.material.max_push_speed + 1e-9);
      EXPECT_LE(fastest, 0.02 / (5 * h) + 1e-9) << "the depth over h + τ";
      EXPECT_LT(highest, 0.05 + 0.6e-3) << "v²/2g is 0.5 mm";
      EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), 0.05, 1e-5);
    }
}

}  // namespace
}  // namespace fork1s
