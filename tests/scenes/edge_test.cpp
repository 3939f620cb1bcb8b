// What falls on an edge lands on the face that it came from, however little it overlaps the other one.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace fork1s {
namespace {

// A box of 10 mm on slides along z and, by a spring, along x falls from `height` [m] on a block, whose upper edge it
// overlaps by `overlap` [m]. Returns where its lower face is half a second after it has landed.
double Lands(double height, double overlap, double dt) {
  const std::string text = fmt::format(
      "<mujoco><worldbody><geom type='box' size='.01 .01 .015' pos='0 0 -.015'/>"
      "<body name='carriage' pos='{} 0 {}'><joint type='slide' axis='0 0 1'/>"
      "<inertial pos='0 0 0' mass='.05' diaginertia='1e-5 1e-5 1e-5'/>"
      "<body name='part'><joint type='slide' axis='1 0 0' stiffness='4000' damping='10'/>"
      "<geom type='box' size='.005 .005 .005' mass='.05'/></body></body></worldbody></mujoco>",
      0.015 - overlap, height + 0.005);
  auto imported = LoadMechanismFromString(text, "edge", {});
  if (!imported) throw std::runtime_error(imported.error().Text());
  SimulationOptions options;
  options.step.h = dt;
  auto simulation = Simulation::Create(imported->scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  const double end = std::sqrt(2 * height / 9.81) + 0.5;
  while (simulation->time() < end) {
    const StepReport report = simulation->Step();
    EXPECT_TRUE(report.IsSolved());
  }
  return simulation->Pose("part").translation().z() - 0.005;
}

TEST(Edge, IsLandedOnFromAbove) {
  for (const double dt : {1.0 / 60, 1.0 / 240})
    for (const double height : {1e-4, 1e-3, 5e-3, 0.02, 0.1})
      for (const double overlap : {2e-6, 1e-5, 1e-4, 1e-3}) {
        SCOPED_TRACE(fmt::format("dt {}, height {}, overlap {}", dt, height, overlap));
        // 1 N on four points of 1e6 N/m.
        EXPECT_NEAR(Lands(height, overlap, dt), 0, 1e-6);
      }
}

// Beside the edge it falls past.
TEST(Edge, IsPassedBesideIt) {
  for (const double dt : {1.0 / 60, 1.0 / 240})
    for (const double height : {1e-3, 0.02, 0.1}) EXPECT_LT(Lands(height, -1e-5, dt), -1) << height;
}

}  // namespace
}  // namespace fork1s
