// What drives and what walks.
#include "run.hpp"

namespace fork1s::examples {
namespace {

const char* const kWheels[] = {"front_left_wheel", "front_right_wheel", "rear_left_wheel",
                               "rear_right_wheel"};

double Upright(const Simulation& simulation, const std::string& body) {
  return simulation.Pose(body).rotation()(2, 2);
}

TEST(Vehicle, SinksOnItsSpringsAndStandsStill) {
  SceneRun run("vehicle");
  run.Until(0.4);
  const Vector3 before = run.Position("chassis");
  const Course course = run.Until(0.5);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(course.kinetic_max, 0.5);  // 428 kg at 5 cm/s: the last of the sinking
  EXPECT_LT((run.Position("chassis") - before).norm(), 5e-3);
  // Struts lean inward and hold on wishbones at two thirds: 25 N/mm a corner let 0.37 t down by 50 to 100 mm.
  EXPECT_NEAR(0.3 - run.Position("chassis").z(), 0.075, 0.025);
  double carried = 0, mass = 0;
  // A tyre of 0.1 m half width that leans by up to 1.5 degrees stands on its edge, 2.6 mm higher.
  for (const char* wheel : kWheels) carried += ContactForce(run.simulation(), wheel).z();
  for (const BodyDef& body : run.simulation().scene().mechanisms[0].bodies) mass += body.inertia.mass;
  EXPECT_NEAR(carried, mass * 9.81, 0.02 * mass * 9.81);
}

TEST(Vehicle, DrivesOverCobblesAndRampAndTurns) {
  SceneRun run("vehicle");
  double highest = 0;
  const Course course =
      run.Until(10, [&](const StepReport&) { highest = std::max(highest, run.Position("chassis").z()); });
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(course.gap, 1e-5);
  // Where a wheel meets the ramp within a step, it sees the road ahead as level: 5 m/s / 60 * sin(0.12).
  EXPECT_LT(course.penetration, 0.01);
  EXPECT_GT(highest, 0.45) << "over the ramp of 0.3 m";
  EXPECT_GT(run.Position("chassis").x(), 25);
  EXPECT_LT(run.Position("chassis").y(), -2) << "steered to the right";
  EXPECT_GT(Upright(run.simulation(), "chassis"), 0.99);
  for (const char* wheel : kWheels) EXPECT_NEAR(run.Position(wheel).z(), 0.3014, 1.6e-3) << wheel;
}

TEST(HexapodOnTerrain, SettlesIsPushedAndWalks) {
  SceneRun run("hexapod_terrain");
  run.Until(1.5);
  const Vector3 settled = run.Position("trunk");
  Course course = run.Until(2);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT((run.Position("trunk") - settled).norm(), 1e-5);

  run.Until(3.6);
  const Vector3 pushed = run.Position("trunk");
  EXPECT_GT(pushed.y() - settled.y(), 3e-3) << "moved by the ram";
  course = run.Until(4);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT((run.Position("trunk") - pushed).norm(), 1e-5) << "stands again";

  course = run.Until(12);
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  // A foot that passes the edge of a tile within a step sinks by at most its speed times the step times the
  // slope of its round sole there: 0.25 m/s / 60 at 45 degrees.
  EXPECT_LT(course.penetration, 3e-3);
  // 6.5 strides of 50 mm each way make 0.65 m without slip; tiles cost some of it.
  EXPECT_GT(run.Position("trunk").x() - pushed.x(), 0.4);
  EXPECT_LT(std::abs(run.Position("trunk").y() - pushed.y()), 0.1);
  EXPECT_GT(Upright(run.simulation(), "trunk"), 0.95);
  EXPECT_GT(run.Position("trunk").z(), 0.09);
}

}  // namespace
}  // namespace fork1s::examples
