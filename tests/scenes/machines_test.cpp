// Machines that move what lies about: an excavator on its cylinders, two walkers with a beam.
#include <fork1s/sim/queries.hpp>
#include <sstream>

#include "run.hpp"

namespace fork1s::examples {
namespace {

std::vector<std::string> FreeBodies(const Simulation& simulation) {
  std::vector<std::string> names;
  for (const SceneBody& body : simulation.bodies())
    if (body.mechanism < 0) names.push_back(body.name);
  return names;
}

TEST(Excavator, LiftsWhatItDigsAndFillsTheSkip) {
  SceneRun run("excavator");
  EXPECT_EQ(run.simulation().world().mechanisms()[0].model().size(), 4) << "a swing and three cylinders";
  const auto check = [](const Course& course) {
    EXPECT_TRUE(course.finite);
    EXPECT_EQ(course.unconverged, 0);
    EXPECT_LT(course.gap, 1e-8);  // m; cylinders of 1e7 N/m bear 1e5 N
    // As in stiffness_test.cpp.
    EXPECT_LT(course.rise_max, 0.2 * course.penetration * course.force_max + 1e-6 * course.kinetic_max);
  };
  run.Until(3);
  double settled = 0;
  for (const std::string& name : FreeBodies(run.simulation()))
    settled = std::max(settled, run.Position(name).z());
  EXPECT_LT(settled, 0.5);
  check(run.Until(13));
  int lifted = 0;
  for (const std::string& name : FreeBodies(run.simulation())) lifted += run.Position(name).z() > 1.2;
  EXPECT_GE(lifted, 4);
  // They hang on the bucket alone: its cylinders bear their weight.
  EXPECT_LT(ContactForce(run.simulation(), "bucket").z(), -20 * 9.81 * lifted);
  check(run.Until(20));
  int in_skip = 0;
  std::stringstream where;
  for (const std::string& name : FreeBodies(run.simulation())) {
    const Vector3 p = run.Position(name);
    in_skip += std::abs(p.x()) < 0.8 && p.y() > 2.2 && p.y() < 3.8 && p.z() < 0.6;
    where << name << ' ' << p.transpose() << '\n';
  }
  EXPECT_GE(in_skip, std::max(4, lifted - 1)) << where.str();
}

// Without a heap, at 1e10 N/m: where the edge is pressed on the ground one cylinder gives all it can. All of
// them went from one bound to the other, in the same step and in every step after it.
TEST(Excavator, StiffCylindersGiveWayOneAtATime) {
  ImportOptions options;
  options.stiffness_scale = 1e3;
  Scene scene = Load("excavator", options).scene;
  scene.free_bodies.clear();
  for (KeyframeDef& key : scene.keyframes) key.free_bodies.clear();
  Simulation simulation = Start(std::move(scene));
  auto track = ReadControls(FORK1S_SOURCE_DIR "/scenes/excavator.csv");
  ASSERT_TRUE(track) << track.error().Text();
  int at_bound = 0;
  while (simulation.time() < 12) {
    track->Apply(simulation.time() + simulation.dt(), simulation);
    const StepReport report = simulation.Step(true);
    ASSERT_TRUE(report.finite && report.IsSolved()) << simulation.time();
    at_bound = std::max(at_bound, report.forces_at_bound);
    ASSERT_LT(simulation.ClosureGap(), 1e-8) << simulation.time();
  }
  EXPECT_EQ(at_bound, 1);
}

// The jaws go 0.16 up for what they close; at 20 mm/s they meet the cube and lift it off the floor, by either
// rule. By two stages friction once held the way back from a base point beyond the cube's sides, and pressed
// it down.
TEST(FourbarGripper, LiftsTheCubeItClosesOn) {
  for (const Integrator integrator : {Integrator::kTwoStage, Integrator::kEuler}) {
    SimulationOptions options;
    options.step.integrator = integrator;
    auto simulation = Simulation::Create(Load("fourbar_gripper").scene, options);
    ASSERT_TRUE(simulation) << simulation.error().Text();
    for (int i = 1; i <= 60; ++i) {
      for (const char* name : {"left_grip", "right_grip"})
        simulation->SetControl(name, 0.22 * std::min(1.0, simulation->dt() * i / 0.5));
      ASSERT_TRUE(simulation->Step(true).finite);
    }
    for (const BodyContact& c : Contacts(*simulation))
      EXPECT_TRUE(c.name_a != "world" || c.force_W.norm() < 1e-6) << c.name_b << ' ' << c.force_W.transpose();
    EXPECT_GT(simulation->Pose("cube").translation().z(), 0.012);
  }
}

TEST(BeamWalkers, CarryTheBeamUpTheStep) {
  SceneRun run("beam_walkers");
  run.Until(1.5);
  const Vector3 before = run.Position("beam");
  double dropped = 0, most_feet = 0;
  const Course course = run.Until(14, [&](const StepReport& report) {
    const double lead = run.Position("lead_trunk").z(), tail = run.Position("tail_trunk").z();
    // The bars are 44 mm above the middle of the trunks, the beam's middle 16 mm above the bars.
    dropped = std::max(dropped, 0.5 * (lead + tail) + 0.06 - run.Position("beam").z());
    most_feet = std::max<double>(most_feet, report.contacts);
  });
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(dropped, 2e-3);
  EXPECT_GE(most_feet, 10) << "six feet and four places of the beam";
  const Vector3 moved = run.Position("beam") - before;
  // Strides make 1.26 m, and the step is 25 mm high.
  EXPECT_NEAR(moved.x(), 1.26, 0.06);
  EXPECT_NEAR(moved.y(), 0, 0.03);
  EXPECT_NEAR(moved.z(), 0.025, 5e-4);
  for (const char* trunk : {"lead_trunk", "tail_trunk"})
    EXPECT_GT(run.simulation().Pose(trunk).rotation()(2, 2), 0.9999) << trunk;
  // It lies still again, on both.
  EXPECT_LT(run.Until(14.5).kinetic_max, 1e-6);
  EXPECT_NEAR(ContactForce(run.simulation(), "beam").z(), 0.8 * 9.81, 1e-3);
}

}  // namespace
}  // namespace fork1s::examples
