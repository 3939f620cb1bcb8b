// The load at which pressing harder ejects a grasped ball: k_t (R + r) where fingertips do not rotate.
#include <dynamics/support.hpp>
#include <fork1s/dynamics/load_factor.hpp>

namespace fork1s {
namespace {

using testing::Geometry;
using testing::MustCreate;
using testing::Still;

struct Case {
  double radius, tip;  // m
  double k_t;          // N/m
  double share;        // of the critical force with which each finger presses
  double k_n = 2000;   // N/m
};

// Two spheres on three slides each press a ball from either side.
Scene Squeeze(const Case& c, double tilt = 0) {
  const double critical = c.k_t * (c.radius + c.tip), slop = 1e-4;
  Scene scene;
  scene.free_bodies.push_back(testing::BallBody("ball", 0.1, c.radius, Vector3::Zero(), 2));
  MechanismBuilder builder("gripper");
  const Matrix3 R = Eigen::AngleAxisd(tilt, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  for (int side : {-1, 1}) {
    BodyDef tip;
    tip.name = side < 0 ? "left" : "right";
    tip.parent = builder.base();
    tip.X_PB = RigidTransform(R, R * Vector3(side * (c.radius + c.tip), 0, 0));
    tip.inertia.mass = 0.02;
    tip.inertia.rotational = 1e-6 * Matrix3::Identity();
    tip.geometries.push_back(Geometry(tip.name + "_pad", Sphere{c.tip}, 2));
    const BodyIndex b = builder.AddBody(tip);
    JointDef slides = JointDef::General(tip.name + "_slides", b, Matrix6X::Identity(6, 6).rightCols(3));
    for (FreedomDef& f : slides.freedoms) {
      f.stiffness = c.k_t;
      f.damping = c.k_t / 50;  // overdamped: what is unstable leaves slowly, what is stable returns
    }
    slides.freedoms[0].stiffness = c.k_n;
    slides.freedoms[0].damping = c.k_n / 50;
    slides.freedoms[0].rest = -side * (c.share * critical / c.k_n + slop / 2);
    builder.AddJoint(slides);
  }
  builder.SetInterfaces({"left", "right"});
  scene.mechanisms.push_back(builder.definition());
  return scene;
}

double NormalForce(const World& world, double h) {
  double sum = 0;
  for (const ContactRecord& c : world.contacts()) sum += c.impulse(0) / h;
  return sum / 2;
}

class CriticalForce : public ::testing::TestWithParam<Case> {};

TEST_P(CriticalForce, IsTangentialStiffnessTimesTheSumOfRadii) {
  const Case& c = GetParam();
  // A tilted grasp too: the answer knows no axes.
  for (double tilt : {0.0, 0.7}) {
    const Scene scene = Squeeze(c, tilt);
    World world = MustCreate(scene);
    const StepOptions step = Still(1e-3);
    for (int i = 0; i < 300; ++i) ASSERT_TRUE(world.Step(step).finite);
    const LoadFactor load = ComputeLoadFactor(world, scene, step.h);
    EXPECT_EQ(load.contacts, 2);
    EXPECT_EQ(load.body, "ball");
    const double critical = c.k_t * (c.radius + c.tip);
    // Penetration, 0.1 mm at most, shortens R + r by 0.5 % in the smallest case.
    EXPECT_NEAR(load.factor * NormalForce(world, step.h) / critical, 1, 0.01) << "tilt " << tilt;
  }
}

INSTANTIATE_TEST_SUITE_P(Grasps, CriticalForce,
                         ::testing::Values(Case{0.045, 0.01, 200, 0.3}, Case{0.045, 0.01, 800, 0.6},
                                           Case{0.02, 0.02, 500, 0.5}, Case{0.03, 0.05, 300, 0.9},
                                           Case{0.1, 0.005, 400, 0.2}));

// Turn of the ball [rad], a while after a push that turned it a little.
double TurnAfterPush(double share, double& factor) {
  // Soft in the normal direction: stiff springs would lose force as the tips roll off and stop the ejection
  // at a new balance.
  const Case c{0.045, 0.015, 300, share, 50};
  const Scene scene = Squeeze(c);
  World world = MustCreate(scene);
  const StepOptions step = Still(1e-3);
  const double torque = 0.02 * c.k_t * c.radius * c.radius;  // of the size of a hundredth of a radian
  for (int i = 0; i < 4000; ++i) {
    if (i == 300) factor = ComputeLoadFactor(world, scene, step.h).factor;
    if (i >= 300 && i < 500)
      world.free_bodies()[0].AddWrench(Vector3::Zero(), torque * Vector3::UnitY(), Vector3::Zero());
    if (!world.Step(step).finite) return std::nan("");
  }
  const Matrix3& R = world.free_bodies()[0].pose().rotation();
  return Eigen::AngleAxisd(R).angle();
}

// The second road: the same grasp in motion, 5 % below and 5 % above.
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
  EXPECT_TRUE(std::isinf(ComputeLoadFactor(world, scene, step.h).factor));
}

}  // namespace
}  // namespace fork1s
