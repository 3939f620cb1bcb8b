// Free rigid bodies: falling, tumbling, rolling, sliding, sticking.
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::BallBody;
using testing::BoxBody;
using testing::MustCreate;

constexpr double kG = 9.81;

TEST(FreeBodies, FreeFall) {
  Scene scene;
  scene.free_bodies.push_back(BallBody("ball", 2, 0.1, Vector3(0, 0, 100), 1));
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = MustCreate(scene);
    StepOptions options;
    options.integrator = integrator;
    const int n = 120;
    for (int i = 0; i < n; ++i) world.Step(options);
    const double t = options.h * n, ahead = integrator == Integrator::kEuler ? options.h : 0;
    // Two stages follow the parabola; backward Euler goes by the velocity of the end. Sums of 120 terms round
    // at 1e-14 of 100 m.
    EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), 100 - kG * t * (t + ahead) / 2, 1e-11);
    EXPECT_NEAR(world.free_bodies()[0].velocity_of_center().z(), -kG * t, 1e-12);
  }
}

TEST(FreeBodies, LandsWithoutSinking) {
  // Falls at 2 m/s: the step that lands it must not carry it half a step into the floor.
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.free_bodies.push_back(BallBody("ball", 2, 0.1, Vector3(0, 0, 0.31), 1));
  World world = MustCreate(scene);
  StepOptions options;
  for (int i = 0; i < 60; ++i) {
    world.Step(options);
    // The slop is a tenth of a millimetre.
    ASSERT_GT(world.free_bodies()[0].pose().translation().z(), 0.1 - 1e-4) << i;
  }
  EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), 0.1, 1e-4);
}

TEST(FreeBodies, TorqueFreeTumblingKeepsMomentum) {
  FreeBodyDef def = BoxBody("box", 1, Vector3(0.05, 0.1, 0.2), Vector3::Zero(), 1);
  def.inertia.center = Vector3(0.02, -0.01, 0.03);
  Scene scene;
  scene.free_bodies.push_back(def);
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    World world = testing::MustCreate(scene, {});
    FreeBody& body = world.free_bodies()[0];
    // About the middle axis, which turns over.
    body.SetState(RigidTransform(), Vector3(0.02, 6, 0.01), Vector3::Zero());
    const auto spin = [&] {
      const Matrix3& R = body.pose().rotation();
      return Vector3(R * body.inertia().rotational * body.omega_B());
    };
    double energy = body.KineticEnergy();
    const Vector3 momentum = spin();
    StepOptions step = testing::Still();
    step.integrator = integrator;
    bool turned_over = false;
    for (int i = 0; i < 600; ++i) {
      world.Step(step);
      EXPECT_LT((spin() - momentum).norm(), 1e-12 * momentum.norm()) << i;
      EXPECT_LT(body.KineticEnergy(), (1 + 1e-9) * energy) << i;
      energy = body.KineticEnergy();
      turned_over = turned_over || body.omega_B().y() < 0;
    }
    EXPECT_TRUE(turned_over || integrator == Integrator::kEuler);
  }
}

// A slope of angle theta along x is a level plane under turned gravity.
StepOptions Slope(double theta) {
  StepOptions options;
  options.gravity = kG * Vector3(std::sin(theta), 0, -std::cos(theta));
  return options;
}

Scene OnPlane(const FreeBodyDef& body, double friction) {
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, friction));
  scene.free_bodies.push_back(body);
  return scene;
}

TEST(FreeBodies, SphereRollsDownASlope) {
  const double theta = 0.2;
  World world = MustCreate(OnPlane(BallBody("ball", 0.5, 0.1, Vector3(0, 0, 0.1), 0.8), 0.8));
  const StepOptions options = Slope(theta);
  for (int i = 0; i < 120; ++i) world.Step(options);
  const FreeBody& ball = world.free_bodies()[0];
  const double expected = 5.0 / 7 * kG * std::sin(theta) * 2;
  // The solver's residual is 1e-4 or better of the step's impulse.
  EXPECT_NEAR(ball.velocity_of_center().x(), expected, 1e-3 * expected);
  EXPECT_NEAR(ball.omega_W().y() * 0.1, expected, 1e-3 * expected);
  EXPECT_NEAR(ball.pose().translation().z(), 0.1, 2e-4);  // slop
}

TEST(FreeBodies, SlidingTurnsToRolling) {
  const double mu = 0.2, v0 = 3, r = 0.1;
  Scene scene = OnPlane(BallBody("ball", 0.5, r, Vector3(0, 0, r), mu), mu);
  World world = MustCreate(scene);
  world.free_bodies()[0].SetState(RigidTransform(Vector3(0, 0, r)), Vector3::Zero(), Vector3(v0, 0, 0));
  StepOptions options;
  options.h = 1.0 / 240;
  const double known = 2 * v0 / (7 * mu * kG);
  double rolls = -1;
  for (int i = 1; i <= 240; ++i) {
    world.Step(options);
    const FreeBody& ball = world.free_bodies()[0];
    const double slip = ball.velocity_of_center().x() - r * ball.omega_W().y();
    if (rolls < 0 && slip < 1e-3 * v0) rolls = i * options.h;
  }
  EXPECT_NEAR(rolls, known, 1.5 * options.h);  // found at whole steps
  EXPECT_NEAR(world.free_bodies()[0].velocity_of_center().x(), 5.0 / 7 * v0, 1e-3 * v0);
}

TEST(FreeBodies, BoxSticksBelowTheFrictionAngle) {
  const double mu = 0.5, limit = std::atan(mu);
  for (const double theta : {0.9 * limit, 1.1 * limit}) {
    World world =
        MustCreate(OnPlane(BoxBody("box", 1, Vector3(0.1, 0.1, 0.05), Vector3(0, 0, 0.05), mu), mu));
    const StepOptions options = Slope(theta);
    for (int i = 0; i < 120; ++i) world.Step(options);
    const FreeBody& box = world.free_bodies()[0];
    const double push = kG * (std::sin(theta) - mu * std::cos(theta));
    if (theta < limit) {
      // What a residual of 1e-4 of a step's impulse may creep: g h 1e-4 for 2 s.
      EXPECT_LT(std::abs(box.pose().translation().x()), 4e-5);
    } else {
      EXPECT_NEAR(box.velocity_of_center().x(), 2 * push, 0.01 * 2 * push);
    }
    EXPECT_LT(box.omega_W().norm(), 1e-3);
  }
}

TEST(FreeBodies, NothingBounces) {
  // Contacts must be seen before they happen: within the margin, at 3 m/s more than 0.05 m ahead.
  World::Options world_options;
  world_options.collision.margin = 0.2;
  World world = MustCreate(OnPlane(BallBody("ball", 0.5, 0.1, Vector3(0, 0, 0.6), 1), 1), world_options);
  StepOptions options;
  double fastest_up = 0, deepest = 0;
  for (int i = 0; i < 120; ++i) {
    world.Step(options);
    fastest_up = std::max(fastest_up, world.free_bodies()[0].velocity_of_center().z());
    deepest = std::max(deepest, 0.1 - world.free_bodies()[0].pose().translation().z());
  }
  // What rises is the undoing of penetration beyond the slop of 0.1 mm.
  EXPECT_LT(fastest_up, 1e-3);
  EXPECT_LT(deepest, 2e-4);
  EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), 0.1, 2e-4);
}

TEST(FreeBodies, BallRollsInABowl) {
  // A ball in a pair of slopes that meet: it comes to rest in the corner and stays above the ground.
  Scene scene;
  for (int side : {-1, 1}) {
    const Matrix3 R = Eigen::AngleAxisd(side * 0.3, Vector3::UnitY()).matrix();
    scene.world.push_back(testing::Geometry("wall" + std::to_string(side + 1), Plane{}, 0.5,
                                            RigidTransform(R, Vector3::Zero())));
  }
  scene.free_bodies.push_back(BallBody("ball", 0.5, 0.1, Vector3(0.3, 0, 0.3), 0.5));
  World::Options world_options;
  world_options.collision.margin = 0.1;
  World world = MustCreate(scene, world_options);
  StepOptions options;
  for (int i = 0; i < 600; ++i) {
    const StepReport report = world.Step(options);
    ASSERT_TRUE(report.finite);
    ASSERT_LT(report.max_penetration, 2e-3);
  }
  EXPECT_LT(world.free_bodies()[0].velocity_of_center().norm(), 1e-3);
  EXPECT_NEAR(world.free_bodies()[0].pose().translation().x(), 0, 1e-3);
  EXPECT_NEAR(world.free_bodies()[0].pose().translation().z(), 0.1 / std::cos(0.3), 1e-3);
}

TEST(FreeBodies, MassRatioOfAMillionStaysBounded) {
  // A kilogramme on a milligramme, at a tenth of a second.
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.free_bodies.push_back(BoxBody("light", 1e-6, Vector3(0.1, 0.1, 0.05), Vector3(0, 0, 0.05), 0.8));
  scene.free_bodies.push_back(BoxBody("heavy", 1, Vector3(0.1, 0.1, 0.05), Vector3(0, 0, 0.15), 0.8));
  World world = MustCreate(scene);
  StepOptions options;
  options.h = 0.1;
  for (int i = 0; i < 300; ++i) {
    const StepReport report = world.Step(options);
    ASSERT_TRUE(report.finite);
    for (const FreeBody& body : world.free_bodies()) {
      ASSERT_LT(body.velocity_of_center().norm(), 1);
      ASSERT_LT(body.pose().translation().head<2>().norm(), 0.05) << i;
    }
  }
  EXPECT_NEAR(world.free_bodies()[1].pose().translation().z(), 0.15, 2e-3);
}

TEST(FreeBodies, StayWhereATurningTableHoldsThem) {
  // A box on a table that turns about the vertical at 1 rad/s: moved along the tangent it would creep outward
  // by h/2 of the distance it travels.
  MechanismBuilder builder("table", BaseKind::kDriven, testing::Brick(10, Vector3(0.5, 0.5, 0.02)));
  builder.SetInterfaces({"table"});
  MechanismDef table = builder.definition();
  table.bodies[0].name = "table";
  table.bodies[0].geometries.push_back(testing::Geometry("top", Box{Vector3(0.5, 0.5, 0.02)}, 0.9));
  Scene scene;
  scene.mechanisms.push_back(table);
  scene.free_bodies.push_back(BoxBody("box", 1, Vector3(0.05, 0.05, 0.05), Vector3(0.3, 0, 0.07), 0.9));
  World world = MustCreate(scene);
  StepOptions options;
  options.integrator = Integrator::kTwoStage;
  const int n = 300;
  for (int i = 0; i < n; ++i) {
    // From rest to 1 rad/s within a second, then on.
    const double t = (i + 1) * options.h, angle = t < 1 ? 0.5 * t * t : t - 0.5;
    world.mechanisms()[0].DriveBase(RigidTransform(ExpRotation(Vector3(0, 0, angle)), Vector3::Zero()));
    ASSERT_TRUE(world.Step(options).finite);
  }
  const Vector3 on_table =
      world.mechanisms()[0].state().X_WR.inverse() * world.free_bodies()[0].pose().translation();
  // What the contact solver's tolerance of 1e-4 of g h lets slip in 300 steps.
  EXPECT_LT((on_table - Vector3(0.3, 0, 0.07)).norm(), 1e-3) << on_table.transpose();
}

TEST(Keyframes, ThatDoNotFitAreRefused) {
  Scene scene;
  scene.mechanisms.push_back(testing::Walker(BaseKind::kFixed, 60, 1));
  scene.free_bodies.push_back(BallBody("ball", 1, 0.1, Vector3(0, 0, 3), 0.5));
  KeyframeDef key;
  key.name = "start";
  key.mechanisms.push_back({VectorX::Zero(8), VectorX::Zero(8), {}, Vector6::Zero(), {}});
  key.free_bodies.push_back({});
  World::Options options;
  options.initial_keyframe = 0;
  const auto refuse = [&](const KeyframeDef& broken, const std::string& says) {
    scene.keyframes = {broken};
    const auto world = World::Create(scene, options);
    ASSERT_FALSE(world.has_value());
    EXPECT_NE(world.error().Text().find("'start'"), std::string::npos) << world.error().Text();
    EXPECT_NE(world.error().Text().find(says), std::string::npos) << world.error().Text();
  };
  scene.keyframes = {key};
  EXPECT_TRUE(World::Create(scene, options).has_value());
  KeyframeDef broken = key;
  broken.mechanisms[0].q.resize(7);
  refuse(broken, "joint displacements");
  broken = key;
  broken.mechanisms[0].controls = VectorX::Zero(1);
  refuse(broken, "controls");
  broken = key;
  broken.mechanisms[0].q(3) = NAN;
  refuse(broken, "not finite");
  broken = key;
  broken.free_bodies.clear();
  refuse(broken, "number of mechanisms or free bodies");
  broken = key;
  broken.free_bodies[0].omega_W.x() = INFINITY;
  refuse(broken, "'ball'");
}

}  // namespace
}  // namespace fork1s
