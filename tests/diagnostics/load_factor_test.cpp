// The load at which pressing harder ejects a grasped ball: k_t (R + r) where fingertips do not rotate.
#include <fork1s/diagnostics/load_factor.hpp>
#include <squeeze.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::Geometry;
using testing::MustCreate;
using testing::Squeeze;
using testing::Still;

double NormalForce(const World& world, double h) {
  double sum = 0;
  for (const ContactRecord& c : world.contacts()) sum += c.impulse(0) / h;
  return sum / 2;
}

class CriticalForce : public ::testing::TestWithParam<Squeeze> {};

TEST_P(CriticalForce, IsTangentialStiffnessTimesTheSumOfRadii) {
  const Squeeze& c = GetParam();
  // A tilted grasp too: the answer knows no axes.
  for (double tilt : {0.0, 0.7}) {
    const Scene scene = c.Make(tilt);
    World world = MustCreate(scene);
    const StepOptions step = Still(1e-3);
    for (int i = 0; i < 300; ++i) ASSERT_TRUE(world.Step(step).finite);
    const LoadFactor load = ComputeLoadFactor(world, step.h);
    EXPECT_EQ(load.contacts, 2);
    EXPECT_EQ(load.body, "ball");
    const double critical = c.Critical();
    // Penetration, 0.1 mm at most, shortens R + r by 0.5 % in the smallest case.
    EXPECT_NEAR(load.factor * NormalForce(world, step.h) / critical, 1, 0.01) << "tilt " << tilt;
  }
}

INSTANTIATE_TEST_SUITE_P(Grasps, CriticalForce,
                         ::testing::Values(Squeeze{0.045, 0.01, 200, 0.3}, Squeeze{0.045, 0.01, 800, 0.6},
                                           Squeeze{0.02, 0.02, 500, 0.5}, Squeeze{0.03, 0.05, 300, 0.9},
                                           Squeeze{0.1, 0.005, 400, 0.2}));

// Turn of the ball [rad], a while after a push that turned it a little.
double TurnAfterPush(double share, double& factor) {
  const Squeeze c = testing::SoftSqueeze(share);
  const Scene scene = c.Make();
  World world = MustCreate(scene);
  const StepOptions step = Still(1e-3);
  for (int i = 0; i < 4000; ++i) {
    if (i == 300) factor = ComputeLoadFactor(world, step.h).factor;
    if (i >= 300 && i < 500)
      world.free_bodies()[0].AddWrench(Vector3::Zero(), c.SmallTorque() * Vector3::UnitY(), Vector3::Zero());
    if (!world.Step(step).finite) return std::nan("");
  }
  return testing::Turn(world.free_bodies()[0].pose());
}

// The second method: the same grasp in motion, 5 % below and 5 % above.
TEST(Ejection, BeginsAtTheCriticalForce) {
  double factor = 0;
  EXPECT_LT(TurnAfterPush(0.95, factor), 0.001);
  EXPECT_NEAR(factor, 1 / 0.95, 0.01);
  EXPECT_GT(TurnAfterPush(1.05, factor), 0.2);
  EXPECT_NEAR(factor, 1 / 1.05, 0.01);
}

TEST(LoadFactor, IsInfiniteWhereNothingIsHeld) {
  Scene scene;
  scene.world.push_back(Geometry("floor", Plane{}, 1));
  scene.free_bodies.push_back(testing::BoxBody("box", 1, Vector3(0.1, 0.1, 0.1), Vector3(0, 0, 0.1), 1));
  World world = MustCreate(scene);
  StepOptions step;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(world.Step(step).finite);
  EXPECT_TRUE(std::isinf(ComputeLoadFactor(world, step.h).factor));
}

// A finger that holds a box to a floor can move in no way in which contacts roll; the ball on the box can,
// and has no spring. What is left of springs in that motion is rounding, and was once what load was compared
// with.
TEST(LoadFactor, IsInfiniteWhereWhatRollsHasNoSpring) {
  for (const double tilt : {0.0, 0.7}) {
    const RigidTransform X(Eigen::AngleAxisd(tilt, Vector3(1, 2, 3).normalized()).toRotationMatrix(),
                           Vector3::Zero());
    Scene scene;
    scene.world.push_back(Geometry("floor", Plane{}, 1, X));
    scene.free_bodies.push_back(testing::BoxBody("box", 1, Vector3(0.1, 0.1, 0.05), Vector3(0, 0, 0.05), 1));
    scene.free_bodies.push_back(testing::BallBody("ball", 0.2, 0.03, Vector3(0.05, 0.02, 0.13), 1));
    for (FreeBodyDef& body : scene.free_bodies) body.X_WB = X * body.X_WB;
    MechanismBuilder builder("press");
    builder.SetBasePose(X);
    BodyDef finger;
    finger.name = "finger";
    finger.parent = builder.base();
    finger.X_PB = RigidTransform(Vector3(-0.04, 0.01, 0.12));
    finger.inertia.mass = 0.1;
    finger.inertia.rotational = 1e-5 * Matrix3::Identity();
    finger.geometries.push_back(Geometry("tip", Sphere{0.02}, 1));
    const BodyIndex b = builder.AddBody(finger);
    JointDef slides = JointDef::General("slides", b, Matrix6X::Identity(6, 6).rightCols(3));
    for (FreedomDef& f : slides.freedoms) {
      f.stiffness = 1e4;
      f.damping = 50;
    }
    slides.freedoms[2].rest = -0.001;
    builder.AddJoint(slides);
    builder.SetInterfaces({"finger"});
    scene.mechanisms.push_back(builder.definition());
    World world = MustCreate(scene);
    StepOptions step;
    step.gravity = X.rotation() * step.gravity;
    for (int i = 0; i < 120; ++i) ASSERT_TRUE(world.Step(step).finite);
    const LoadFactor load = ComputeLoadFactor(world, step.h);
    EXPECT_GE(load.contacts, 6);
    EXPECT_TRUE(std::isinf(load.factor)) << load.factor << " at tilt " << tilt;
  }
}

}  // namespace
}  // namespace fork1s
