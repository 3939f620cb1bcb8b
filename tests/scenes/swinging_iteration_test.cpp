// Newton's iteration of a stage swings where loaded contacts turn with what they hold. It is relaxed then, and steps
// at rest and near it are solved at their full length.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/simulation.hpp>

#include <algorithm>
#include <cmath>

namespace fork1s {
namespace {

// Planks of 0.1 m by hinges, level, hung at both ends 80 % of their length apart on an arc; a ball lies on them.
std::string Bridge(int planks, double ball_mass) {
  const double arc = std::acos(-1.0) * 0.44;  // rad: of all planks
  const double turn = arc / (planks - 1);
  std::string text = "<mujoco><compiler angle='radian'/><worldbody>", end;
  double x = 0, z = 1, angle = arc / 2;
  for (int i = 0; i < planks; ++i) {
    const std::string n = std::to_string(i);
    text += "<body name='p" + n + "' pos='" + (i == 0 ? "0 0 1" : "0.1 0 0") + "' euler='0 " +
            std::to_string(i == 0 ? angle : -turn) + " 0'><joint name='j" + n +
            "' axis='0 1 0' damping='1e-4'/>"
            "<geom type='box' size='0.045 0.1 0.01' pos='0.05 0 0' mass='0.2'/>";
    end += "</body>";
    if (i <= planks / 2 - 1) {
      x += 0.1 * std::cos(angle);
      z -= 0.1 * std::sin(angle);
    }
    angle -= turn;
  }
  return text + end + "<body name='load' pos='" + std::to_string(x) + " 0 " + std::to_string(z + 0.12) +
         "'><freejoint/><geom type='sphere' size='0.08' mass='" + std::to_string(ball_mass) +
         "'/></body></worldbody><equality><connect body1='p" + std::to_string(planks - 1) +
         "' anchor='0.1 0 0'/></equality></mujoco>";
}

struct Count {
  int unsolved = 0, steps = 0;
};

Count StepsOf(const std::string& text, const std::vector<std::string>& interfaces, double time) {
  ImportOptions import;
  import.interfaces = interfaces;
  auto imported = LoadMechanismFromString(text, "bridge", import);
  EXPECT_TRUE(imported) << imported.error().Text();
  Count count;
  if (!imported) return count;
  auto simulation = Simulation::Create(imported->scene, {});
  EXPECT_TRUE(simulation) << simulation.error().Text();
  count.steps = static_cast<int>(std::lround(60 * time));
  for (int i = 0; i < count.steps; ++i) {
    const StepReport report = simulation->Step();
    EXPECT_TRUE(report.finite) << i;
    count.unsolved += report.IsSolved() ? 0 : 1;
  }
  return count;
}

TEST(SwingingIteration, ABridgeUnderABallIsSolved) {
  Count all;
  for (const int planks : {8, 12, 16})
    for (const double mass : {1.0, 3.0, 10.0}) {
      std::vector<std::string> names;
      for (int i = 0; i < planks; ++i) names.push_back("p" + std::to_string(i));
      const Count count = StepsOf(Bridge(planks, mass), names, 1.5);
      all.unsolved += count.unsolved;
      all.steps += count.steps;
    }
  EXPECT_EQ(all.steps, 810);
  // Of 810 steps 31 end unsolved, 227 without relaxation: some jump between the corners of two planks, which no
  // iteration settles.
  EXPECT_LE(all.unsolved, 60);
}

// Normals of capsules on edges jump by what their search leaves open, so an iteration ends between two poses some 1e-10 m
// apart. What adds up to 1e-4 of the length in ten thousand steps at most is solved.
TEST(SwingingIteration, WhatDetectionLeavesOpenIsNoUnsolvedStep) {
  auto track = ReadControls(FORK1S_SOURCE_DIR "/scenes/grasp_mug.csv");
  ASSERT_TRUE(track);
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/grasp_mug.xml");
  ASSERT_TRUE(imported);
  SimulationOptions options;
  options.step.h = 1.0 / 240;
  auto simulation = Simulation::Create(imported->scene, options);
  ASSERT_TRUE(simulation);
  int unsolved = 0;
  for (int i = 0; i < 960; ++i) {  // held at the rows of the table, without its rounded corners
    const double time = simulation->time() + options.step.h;
    const auto row = static_cast<std::size_t>(
        std::upper_bound(track->times.begin(), track->times.end(), time) - track->times.begin());
    const std::size_t from = row - 1, to = std::min(row, track->times.size() - 1);
    const double share = (time - track->times[from]) / std::max(track->times[to] - track->times[from], 1e-9);
    for (std::size_t k = 0; k < track->names.size(); ++k)
      simulation->SetControl(
          simulation->FindControl(track->names[k]),
          track->rows[from][k] + std::min(share, 1.0) * (track->rows[to][k] - track->rows[from][k]));
    unsolved += simulation->Step(true).IsSolved() ? 0 : 1;
  }
  EXPECT_EQ(unsolved, 0);
}

}  // namespace
}  // namespace fork1s
