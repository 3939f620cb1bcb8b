// Contact with known answers.
#include <cmath>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

constexpr double kRadius = 0.1;

/// A body over the plane z = 0, gravity tilted by `slope` about y so that downhill is +x.
Scene OnPlane(Shape shape, SpatialInertia inertia, double height, double slope, double friction) {
  Scene scene;
  scene.gravity = kGravity * Vector3(std::sin(slope), 0, -std::cos(slope));
  scene.world = {Touching(Plane{}, friction)};
  FreeBodyDef body;
  body.name = "body";
  body.inertia = std::move(inertia);
  body.geometries = {Touching(std::move(shape), friction)};
  body.X_WB.translation().z() = height;
  scene.free_bodies = {body};
  return scene;
}

Scene BallOnPlane(double height, double slope, double friction) {
  return OnPlane(Sphere{kRadius}, testing::Ball(1, kRadius), height, slope, friction);
}

/// The same body as a mechanism of one floating body.
Scene AsMechanism(Scene scene) {
  const FreeBodyDef body = scene.free_bodies[0];
  MechanismBuilder builder(body.name, BaseKind::kFloating, body.inertia);
  builder.SetBasePose(body.X_WB);
  MechanismDef def = builder.definition();
  def.bodies[0].name = body.name;
  def.bodies[0].geometries = body.geometries;
  def.interfaces = {body.name};
  scene.free_bodies.clear();
  scene.mechanisms = {def};
  return scene;
}

enum class Coordinates { kFreeBody, kMechanism };

class Ball : public ::testing::TestWithParam<Coordinates> {
 protected:
  FullSimulation Make(double height, double slope, double h) const {
    const Scene scene = BallOnPlane(height, slope, 1);
    const bool free = GetParam() == Coordinates::kFreeBody;
    return Start(free ? scene : AsMechanism(scene), h);
  }
};

TEST_P(Ball, BouncesToTheSquareOfItsRestitution) {
  constexpr double kDrop = 0.5, kShare = 0.7, h = 1.0 / 240;
  Scene scene = BallOnPlane(kRadius + kDrop, 0, 1);
  scene.world[0].restitution = scene.free_bodies[0].geometries[0].restitution = kShare;
  FullSimulation s = Start(GetParam() == Coordinates::kFreeBody ? scene : AsMechanism(scene), h);
  double highest = 0;
  bool met = false;
  for (int i = 0; i < 150; ++i) {
    Advance(s, h);
    met = met || !s.contacts().empty();
    if (met) highest = std::max(highest, s.Pose(0).translation().z() - kRadius);
  }
  // Backward Euler takes g h of the way up in each second of flight, 0.8 %; material and samples some
  // thousandths.
  EXPECT_NEAR(highest, kShare * kShare * kDrop, 0.02 * kDrop);
}

TEST_P(Ball, RestsWithItsWeight) {
  FullSimulation s = Make(kRadius, 0, 1.0 / 60);
  Advance(s, 1);
  ASSERT_EQ(s.contacts().size(), 1u);
  // The contact solver's tolerance is 1e-8 of the impulse.
  EXPECT_NEAR(s.contacts()[0].force.z(), kGravity, 1e-6);
  EXPECT_NEAR(s.Pose(0).translation().z(), kRadius, 2e-4);  // within the slop
}

TEST_P(Ball, RollsAtFiveSeventhsOfTheSlope) {
  constexpr double kSlope = 0.2;
  FullSimulation s = Make(kRadius, kSlope, 1.0 / 60);
  Advance(s, 1);
  // Constant acceleration is exact for implicit Euler's velocities.
  // In the first steps the material takes up its loads and lets the ball slip by R λ, 1e-3 of what a step of
  // its friction does to it: 2 / 7 of one step in 60.
  const double expected = 5.0 / 7 * kGravity * std::sin(kSlope), tolerance = 1e-3 / 60 * 2;
  EXPECT_NEAR(s.Velocity(0)(3), expected, tolerance * expected);
  EXPECT_NEAR(s.Velocity(0)(1), expected / kRadius, tolerance * expected / kRadius);
}

TEST_P(Ball, FallsAndStays) {
  FullSimulation s = Make(kRadius + 0.5, 0, 1.0 / 240);
  double lowest = 1, energy = s.Energy();
  for (int i = 0; i < 240; ++i) {
    ASSERT_TRUE(s.Step().converged) << i;
    lowest = std::min(lowest, s.Pose(0).translation().z());
    // Flight follows the parabola, and landing takes energy; the material gives back what it stored, its load
    // times 20 µm in all and no more than a tenth of it in a step.
    EXPECT_LE(s.Energy(), energy + 0.1 * kGravity * 2e-5) << i;
    energy = s.Energy();
  }
  EXPECT_GT(lowest, kRadius - 2e-4);  // the slop, twice
  EXPECT_NEAR(s.Velocity(0)(5), 0, 1e-3);
}

INSTANTIATE_TEST_SUITE_P(All, Ball, ::testing::Values(Coordinates::kFreeBody, Coordinates::kMechanism));

TEST(Box, SticksWhileTheSlopeIsBelowFriction) {
  constexpr double kFriction = 0.5;
  const Vector3 half(0.1, 0.1, 0.05);
  for (double factor : {0.98, 1.02}) {
    const double slope = std::atan(factor * kFriction);
    FullSimulation s =
        Start(OnPlane(Box{half}, testing::Brick(1, half), half.z(), slope, kFriction), 1.0 / 60);
    Advance(s, 1);
    const double sliding = kGravity * (std::sin(slope) - kFriction * std::cos(slope));
    // What is above the friction cone accelerates it; the solver's tolerance is 1e-8.
    EXPECT_NEAR(s.Velocity(0)(3), std::max(0.0, sliding), 1e-5) << factor;
    double normal = 0;
    for (const FullContact& c : s.contacts()) normal += c.force.z();
    EXPECT_NEAR(normal, kGravity * std::cos(slope), 1e-5) << factor;
  }
}

// A hinged bar that rests on a ball: the bar is implicit in its spring, the contact feels it.
TEST(Bar, PressesByItsSpring) {
  MechanismDef def = testing::Chain(1, 1, 0.5, 200, 2);
  def.bodies[1].geometries = {Touching(Capsule{0.01, 0.5})};
  def.bodies[1].geometries[0].X_BG =
      RigidTransform(Matrix3(Eigen::AngleAxisd(M_PI / 2, Vector3::UnitY()).matrix()), Vector3(0.5, 0, 0));
  def.interfaces = {"link1"};
  def.joints[0].WithRest(-0.1);
  Scene scene = Of(def);
  // A still ball of 0.1 m below the bar's end at x = 1.
  scene.world = {Touching(Sphere{0.1})};
  scene.world[0].X_BG.translation() = Vector3(1, -0.11, 0);
  FullSimulation s = Start(scene, 1.0 / 60);
  Advance(s, 1);
  ASSERT_EQ(s.contacts().size(), 1u);
  // 200 N m/rad x 0.1 rad at an arm of 1 m; the contact sits 1e-4 rad lower for the slop at most.
  EXPECT_NEAR(s.contacts()[0].force.norm(), 20, 0.05);
}

TEST(Limits, HoldAJoint) {
  MechanismDef def = testing::Chain(1, 1, 1, 0);
  def.joints[0].WithLimits(-0.3, 0.3);
  FullSimulation s = Start(Of(def, Vector3(0, -kGravity, 0)), 1.0 / 60);
  Advance(s, 1);
  EXPECT_NEAR(s.Displacements(0)(0), -0.3, 2e-4);  // the slop
  EXPECT_NEAR(s.Rates(0)(0), 0, 1e-6);
}

// Torsional friction by the full equations, as in the reduced simulator: ω falls by torsion m g h/I a step.
TEST(Moments, ASpinSlowsAtTheRateOfItsTorsionalFriction) {
  Scene scene = BallOnPlane(kRadius, 0, 1);
  scene.world[0].torsion = 0;
  scene.free_bodies[0].geometries[0].torsion = 0.004;
  scene.free_bodies[0].geometries[0].moments = 1;
  for (const bool free : {true, false}) {
    Scene one = free ? scene : AsMechanism(scene);
    KeyframeDef key;
    if (free)
      key.free_bodies.push_back({scene.free_bodies[0].X_WB, Vector3(0, 0, 30), Vector3::Zero()});
    else
      key.mechanisms.push_back({VectorX(), VectorX(), scene.free_bodies[0].X_WB,
                                (Vector6() << 0, 0, 30, 0, 0, 0).finished(), VectorX()});
    one.keyframes = {key};
    FullSimulationOptions options;
    options.initial_keyframe = 0;
    auto s = FullSimulation::Create(one, options);
    ASSERT_TRUE(s) << s.error().Text();
    for (int i = 0; i < 30; ++i) s->Step();
    const double rate = 0.004 * kGravity / (0.4 * kRadius * kRadius);
    EXPECT_NEAR(s->Velocity(0)(2), 30 - rate * 30 * s->dt(), 1e-6 * 30) << free;
  }
}

}  // namespace
}  // namespace fork1s::reference_test
