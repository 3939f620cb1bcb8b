// Steps of two stages in contact, through impacts, at stops and bounds.
#include <cmath>
#include <numbers>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

constexpr auto kTwo = FullIntegrator::kTwoStages;

FreeBodyDef Loose(Shape shape, SpatialInertia inertia, const Vector3& at, double friction = 0.5) {
  FreeBodyDef body;
  body.name = "body";
  body.inertia = std::move(inertia);
  body.geometries = {Touching(std::move(shape), friction)};
  body.X_WB.translation() = at;
  return body;
}

// Gravity falls off by `slope` in a direction of its own, in which the body is turned too.
Scene OnGround(FreeBodyDef body, double slope = 0, double yaw = 0.7) {
  Scene scene;
  const Matrix3 R = ExpRotation(Vector3(0, 0, yaw));
  scene.gravity = kGravity * (R * Vector3(std::sin(slope), 0, -std::cos(slope)));
  scene.world = {Touching(Plane{}, 0.5)};
  body.X_WB.rotation() = R;
  scene.free_bodies = {std::move(body)};
  return scene;
}

TEST(TwoStagesContact, ABoxRestsOnItsWeight) {
  const Vector3 half(0.1, 0.08, 0.05);
  FullSimulation s =
      Start(OnGround(Loose(Box{half}, testing::Brick(2, half), Vector3(1, 2, 0.05))), 1.0 / 60, kTwo);
  for (int i = 0; i < 120; ++i) {
    const FullStepReport report = s.Step();
    ASSERT_TRUE(report.converged) << i;
    EXPECT_EQ(report.parts, 1) << i;
    double weight = 0;
    for (const FullContact& c : s.contacts()) weight += c.force.z();
    if (i < 20) continue;  // until its material bears it
    EXPECT_EQ(report.contacts, 4) << i;
    EXPECT_NEAR(weight, 2 * kGravity, 1e-6 * 2 * kGravity) << i;  // a hundred times the solver's tolerance
    EXPECT_LT(s.Velocity(0).norm(), 1e-9) << i;
  }
  EXPECT_LT((s.Pose(0).translation().head<2>() - Vector2(1, 2)).norm(), 1e-9);
  // 2 kg on four points of 1 MN/m: 5 µm.
  EXPECT_NEAR(s.Pose(0).translation().z(), 0.05, 1e-5);
}

TEST(TwoStagesContact, ABallRollsAtFiveSeventhsOfTheSlope) {
  constexpr double r = 0.1, slope = 0.2;
  FullSimulation s =
      Start(OnGround(Loose(Sphere{r}, testing::Ball(1, r), Vector3(0, 0, r), 1), slope), 1.0 / 60, kTwo);
  for (int i = 0; i < 60; ++i) EXPECT_EQ(s.Step().parts, 1) << i;
  const double a = 5.0 / 7 * kGravity * std::sin(slope);
  // Velocities of a constant acceleration are exact; the material takes up its load in the first steps.
  EXPECT_NEAR(s.Velocity(0).tail<3>().norm(), a, 2e-5 * a);
  EXPECT_NEAR(s.Velocity(0).head<3>().norm() * r, a, 2e-5 * a);
  EXPECT_NEAR(s.Pose(0).translation().head<2>().norm(), a / 2, 2e-5 * a);
}

TEST(TwoStagesContact, ASlidingBoxComesToRest) {
  const Vector3 half(0.1, 0.08, 0.02);
  Scene scene = OnGround(Loose(Box{half}, testing::Brick(1, half), Vector3(0, 0, 0.02)));
  const Vector3 v = ExpRotation(Vector3(0, 0, 0.7)) * Vector3(1.5, 0, 0);
  KeyframeDef key;
  key.free_bodies.push_back({scene.free_bodies[0].X_WB, Vector3::Zero(), v});
  scene.keyframes = {key};
  FullSimulation s = Start(scene, 1.0 / 240, kTwo);
  Advance(s, 1);
  // v²/2µg; where it comes to rest within a step, the way is off by what half a step at that speed makes, and
  // the material takes up its weight in a step.
  const double way = v.squaredNorm() / (2 * 0.5 * kGravity), step = 0.5 * kGravity / 240 / 240;
  EXPECT_NEAR((s.Pose(0).translation() - Vector3(0, 0, s.Pose(0).translation().z())).norm(), way,
              5e-3 * way + step);
  EXPECT_LT(s.Velocity(0).norm(), 1e-9);
}

// A mass on a spring on a foot that stands on the ground; let go it swings about where it would rest.
struct Swing {
  double error = 0;    // largest within a second, as a share of the amplitude
  double deepest = 0;  // in the last half of it, likewise; 2 where nothing is lost
};

Swing Hops(FullIntegrator integrator, double h, double yaw = 0.3, const Vector3& aside = Vector3(2, -1, 0)) {
  MechanismBuilder builder("hopper", BaseKind::kFloating, testing::Brick(0.5, Vector3(0.1, 0.06, 0.02)));
  BodyDef mass;
  mass.name = "mass";
  mass.parent = builder.base();
  mass.X_PB = RigidTransform(Vector3(0, 0, 0.3));
  mass.inertia = testing::Ball(1, 0.05);
  const BodyIndex b = builder.AddBody(mass);
  const double rate = 2 * std::numbers::pi * 1.5, amplitude = kGravity / (rate * rate);
  builder.AddJoint(JointDef::Slide("leg", b, Vector3::UnitZ()).WithSpring(rate * rate));
  builder.SetInterfaces({"mass"});
  MechanismDef hopper = builder.definition();
  hopper.bodies[0].geometries.push_back(Touching(Box{Vector3(0.1, 0.06, 0.02)}, 0.8));
  hopper.X_WR = RigidTransform(ExpRotation(Vector3(0, 0, yaw)), aside + Vector3(0, 0, 0.02));
  Scene scene = Of(hopper, Vector3(0, 0, -kGravity));
  scene.world.push_back(Touching(Plane{}, 0.8));
  FullSimulation s = Start(scene, h, integrator);
  Swing swing;
  for (int i = 1; i * h <= 1 + 1e-9; ++i) {
    const FullStepReport report = s.Step();
    EXPECT_TRUE(report.converged && report.parts == 1) << i;
    const double q = s.Displacements(0)(0);
    swing.error = std::max(swing.error, std::abs(q + amplitude * (1 - std::cos(rate * i * h))) / amplitude);
    if (i * h > 0.5) swing.deepest = std::max(swing.deepest, -q / amplitude);
  }
  return swing;
}

TEST(TwoStagesContact, AStandingMassSwingsBySecondOrder) {
  double before = Hops(kTwo, 1.0 / 60).error;
  EXPECT_LT(before, 0.02 * Hops(FullIntegrator::kEuler, 1.0 / 60).error);
  for (const double h : {1.0 / 120, 1.0 / 240, 1.0 / 480}) {
    const double now = Hops(kTwo, h).error;
    EXPECT_NEAR(before / now, 4, 0.2) << h;
    before = now;
  }
}

TEST(TwoStagesContact, AStandingMassKeepsSwinging) {
  // (g ω h)⁴/2 of the amplitude a step, g = 1 - 1/√2: 2e-4 in 1.5 swings.
  const Swing here = Hops(kTwo, 1.0 / 60), there = Hops(kTwo, 1.0 / 60, 2.1, Vector3(-30, 40, 0));
  EXPECT_NEAR(here.deepest, 2, 5e-4);
  EXPECT_NEAR(here.error, there.error, 1e-6);  // contacts of a box are found to 1e-9 of where it stands
}

// A ball falls on a sprung plate, which it rides from then on: heights of plate and ball every 1/60 s.
std::vector<double> Landing(double drop, FullIntegrator integrator, int substeps, int& impacts) {
  MechanismBuilder builder("plate");
  BodyDef plate;
  plate.name = "plate";
  plate.parent = builder.base();
  plate.inertia = testing::Brick(0.5, Vector3(0.3, 0.3, 0.02));
  plate.geometries.push_back(Touching(Box{Vector3(0.3, 0.3, 0.02)}, 0.8));
  const BodyIndex b = builder.AddBody(plate);
  builder.AddJoint(JointDef::Slide("lift", b, Vector3::UnitZ()).WithSpring(200, 1));
  builder.SetInterfaces({"plate"});
  Scene scene = Of(builder.definition(), Vector3(0, 0, -kGravity));
  scene.free_bodies.push_back(Loose(Sphere{0.05}, testing::Ball(1, 0.05), Vector3(0.01, 0.02, 0.07 + drop)));
  FullSimulation s = Start(scene, 1.0 / 60 / substeps, integrator);
  const int ball = s.FindBody("body");
  std::vector<double> heights;
  for (int i = 0; i < 40 * substeps; ++i) {
    const FullStepReport report = s.Step();
    EXPECT_TRUE(report.converged);
    // Halved four times about the touch: eight parts, or nine where another touches at its end.
    EXPECT_LE(report.parts, report.impact ? 9 : 1);
    impacts += report.impact ? 1 : 0;
    if ((i + 1) % substeps != 0) continue;
    heights.push_back(s.Displacements(0)(0));
    heights.push_back(s.Pose(ball).translation().z());
  }
  return heights;
}

double Apart(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

// The truth is implicit Euler's, extrapolated: another rule, which knows no impacts.
TEST(TwoStagesContact, ALandingIsThirtyTimesAsExact) {
  double euler = 0, coarse = 0, fine = 0;
  for (int i = 0; i < 8; ++i) {  // at any time within a step
    const double drop = 0.1 + 0.006 * i;
    int none = 0, impacts = 0;
    const std::vector<double> first = Landing(drop, FullIntegrator::kEuler, 64, none),
                              second = Landing(drop, FullIntegrator::kEuler, 128, none);
    std::vector<double> truth;
    for (std::size_t k = 0; k < first.size(); ++k) truth.push_back(2 * second[k] - first[k]);
    euler += Apart(Landing(drop, FullIntegrator::kEuler, 1, none), truth);
    coarse += Apart(Landing(drop, kTwo, 1, impacts), truth);
    EXPECT_EQ(impacts, 1) << drop;
    fine += Apart(Landing(drop, kTwo, 4, none), truth);
  }
  EXPECT_GT(euler, 1e-3);  // m, of eight: there is something to be better at
  EXPECT_LT(coarse, euler / 30);
  EXPECT_LT(fine, coarse / 4);  // first order at least, as the time of impact is known
}

TEST(TwoStagesContact, ALandingTellsItsWholeImpulse) {
  Scene scene = OnGround(Loose(Sphere{0.05}, testing::Ball(0.3, 0.05), Vector3(0, 0, 0.25)));
  FullSimulation s = Start(scene, 1.0 / 60, kTwo);
  double sum = 0;
  int impacts = 0;
  for (int i = 0; i < 60; ++i) {
    const FullStepReport report = s.Step();
    impacts += report.impact ? 1 : 0;
    for (const FullContact& c : s.contacts()) sum += c.force.z() / 60;
  }
  EXPECT_GE(impacts, 1);
  EXPECT_LE(impacts, 2);  // what is left of the speed when a step ends, the next one stops
  EXPECT_LT(s.Velocity(0).norm(), 1e-9);
  EXPECT_NEAR(sum, 0.3 * kGravity, 1e-8);  // momentum is kept to the solver's tolerance
}

TEST(TwoStagesContact, ABallBouncesToTheSquareOfItsRestitution) {
  Scene scene = OnGround(Loose(Sphere{0.1}, testing::Ball(1, 0.1), Vector3(0, 0, 0.6)));
  scene.world[0].restitution = scene.free_bodies[0].geometries[0].restitution = 0.7;
  FullSimulation s = Start(scene, 1.0 / 60, kTwo);
  double highest = 0;
  bool met = false;
  for (int i = 0; i < 40; ++i) {
    met = s.Step().impact || met;
    if (met) highest = std::max(highest, s.Pose(0).translation().z() - 0.1);
  }
  EXPECT_NEAR(highest, 0.49 * 0.5, 0.01 * 0.5);  // g h²/8 between samples, and material
}

TEST(TwoStagesContact, AStopHoldsAJoint) {
  MechanismDef def = testing::Chain(1, 1, 1, 0);
  def.joints[0].WithLimits(-0.3, 0.3);
  FullSimulation s = Start(Of(def, Vector3(0, -kGravity, 0)), 1.0 / 60, kTwo);
  int impacts = 0;
  for (int i = 0; i < 60; ++i) {
    const FullStepReport report = s.Step();
    EXPECT_TRUE(report.converged) << i;
    impacts += report.impact ? 1 : 0;
  }
  EXPECT_EQ(impacts, 1);
  EXPECT_NEAR(s.Displacements(0)(0), -0.3, 1e-9);  // a stop is hard
  EXPECT_NEAR(s.Rates(0)(0), 0, 1e-9);
}

/// A slide of 1 kg.
MechanismDef Slide() {
  MechanismBuilder builder("slide");
  BodyDef mass;
  mass.name = "mass";
  mass.parent = builder.base();
  mass.inertia = testing::Ball(1, 0.05);
  builder.AddJoint(JointDef::Slide("slide", builder.AddBody(mass), Vector3::UnitX()));
  return builder.definition();
}

TEST(TwoStagesContact, DryFrictionStopsAndHolds) {
  MechanismDef def = Slide();
  DryFrictionDef friction;
  friction.name = "slide";
  friction.terms.emplace_back(FreedomRef{JointIndex(0), 0}, 1.0);
  friction.force = 2;
  def.frictions.push_back(friction);
  Scene scene = Of(def, Vector3(1, 0, 0));  // half of what friction holds
  StartAt(scene, VectorX::Zero(1), VectorX::Constant(1, 0.5));
  FullSimulation s = Start(scene, 1.0 / 60, kTwo);
  Advance(s, 2);
  // 1 m/s² against it: 0.125 m; within the step of its stop it may be off by a h²/2.
  EXPECT_NEAR(s.Displacements(0)(0), 0.125, 0.5 / 3600);
  EXPECT_EQ(s.Rates(0)(0), 0);
}

TEST(TwoStagesContact, ABoundedServoGivesItsBound) {
  MechanismDef def = Slide();
  def.joints[0].WithSpring(500, 40);
  ControlDef servo;
  servo.name = "servo";
  servo.terms.emplace_back(FreedomRef{JointIndex(0), 0}, 1.0);
  servo.gain = 500;
  servo.is_setpoint = true;
  def.controls.push_back(servo);
  ForceLimitDef bound;
  bound.name = "servo";
  bound.terms = servo.terms;
  bound.inputs = {{"servo", 1.0}};
  bound.stiffness = 500;
  bound.damping = 40;
  bound.lower = -5;
  bound.upper = 5;
  def.force_limits.push_back(bound);
  FullSimulation s = Start(Of(def, Vector3(-9, 0, 0)), 1.0 / 240, kTwo);
  s.SetControl(0, 0.5);
  for (int i = 1; i <= 48; ++i) {
    ASSERT_TRUE(s.Step().converged);
    // A constant acceleration: exact.
    EXPECT_NEAR(s.Displacements(0)(0), -0.5 * (9 - 5) * std::pow(i / 240.0, 2), 1e-9) << i;
  }
}

// A tray that moves up and down under a box, its path smooth: the box stays, and feels what it must.
TEST(TwoStagesContact, ADrivenTrayCarriesABox) {
  MechanismBuilder builder("tray", BaseKind::kDriven, testing::Brick(1, Vector3(0.3, 0.3, 0.02)));
  MechanismDef tray = builder.definition();
  tray.bodies[0].geometries.push_back(Touching(Box{Vector3(0.3, 0.3, 0.02)}, 0.8));
  const std::string base = tray.bodies[0].name;
  Scene scene = Of(tray, Vector3(0, 0, -kGravity));
  const Vector3 half(0.05, 0.05, 0.05);
  scene.free_bodies.push_back(Loose(Box{half}, testing::Brick(1, half), Vector3(0.1, 0, 0.07)));
  FullSimulation s = Start(scene, 1.0 / 240, kTwo);
  const int up = s.FindControl(base + ".z"), box = s.FindBody("body");
  constexpr double kRate = 2 * std::numbers::pi, kHeight = 0.1;
  for (int i = 1; i <= 480; ++i) {
    const double t = i / 240.0;
    s.SetControl(up, kHeight * (1 - std::cos(kRate * t)));
    const FullStepReport report = s.Step();
    ASSERT_TRUE(report.converged) << i;
    EXPECT_EQ(report.parts, 1) << i;
    if (i < 60) continue;  // it starts with a jump of acceleration
    double force = 0;
    for (const FullContact& c : s.contacts()) force += c.force.z() * (c.point.body_b == box ? 1 : -1);
    const double middle = t - 0.5 / 240;  // what the mean over the step is
    // The tray's bend changes by 2.6 % a step, 0.1 N; where it changes sign a step goes straight.
    EXPECT_NEAR(force, kGravity + kHeight * kRate * kRate * std::cos(kRate * middle), 0.1) << i;
  }
  EXPECT_NEAR(s.Pose(box).translation().z(), 0.07, 1e-5);
}

// Still, then at 0.9 of what friction bears, then at constant speed: the box stays where it is on the plate.
TEST(TwoStagesContact, DrivenPlateAtNineTenthsOfFriction_BoxDoesNotSlip) {
  constexpr double kFriction = 0.5, a = 0.9 * kFriction * kGravity, from = 0.1, to = 0.4;
  for (const bool known : {true, false})
    for (const double h : {1.0 / 60, 1.0 / 240}) {
      SCOPED_TRACE(::testing::Message() << (known ? "known" : "estimated") << " rate, h = " << h);
      const Vector3 half(3, 3, 0.02), box(0.05, 0.05, 0.05);
      MechanismDef plate = MechanismBuilder("plate", BaseKind::kDriven, testing::Brick(1, half)).definition();
      plate.bodies[0].geometries.push_back(Touching(Box{half}, kFriction));
      Scene scene = Of(plate, Vector3(0, 0, -kGravity));
      scene.free_bodies.push_back(Loose(Box{box}, testing::Brick(1, box), Vector3(0.1, 0, 0.07), kFriction));
      FullSimulation s = Start(scene, h, kTwo);
      const int x = s.FindControl(plate.bodies[0].name + ".x");
      double slip = 0;
      for (int i = 1; i <= std::lround(0.6 / h); ++i) {
        const double t = i * h, on = std::clamp(t - from, 0.0, to - from);
        s.SetControl(x, 0.5 * a * on * on + a * on * std::max(0.0, t - to));
        if (known) s.SetBaseRates((VectorX(6) << a * on, 0, 0, 0, 0, 0).finished());
        ASSERT_TRUE(s.Step().converged) << i;
        const double relative = s.Pose(s.FindBody("body")).translation().x() - s.Pose(0).translation().x();
        slip = std::max(slip, std::abs(relative - 0.1));
      }
      EXPECT_LT(slip, known ? 2e-5 : 2 * a * h * h);
    }
}

}  // namespace
}  // namespace fork1s::reference_test
