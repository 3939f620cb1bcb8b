// The error figure of a run: moments to come back to, and what it says where there is no estimate.
#include "sim/error_figure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "gripper.hpp"

namespace fork1s {
namespace {

using internal::ErrorFigure;

void StepBoth(Simulation& simulation, ErrorFigure& figure, int steps) {
  for (int i = 0; i < steps; ++i) {
    simulation.SetControl(0, 0.004 * std::sin(0.3 * static_cast<double>(simulation.steps() + 1)));
    figure.BeginStep(simulation);
    figure.EndStep(simulation, simulation.Step(true));
  }
}

void ExpectEqual(const ErrorFigure& a, const ErrorFigure& b) {
  ASSERT_EQ(a.bodies().size(), b.bodies().size());
  for (std::size_t i = 0; i < a.bodies().size(); ++i) {
    const ErrorFigure::Body &one = a.bodies()[i], &other = b.bodies()[i];
    EXPECT_EQ(one.name, other.name);
    EXPECT_EQ(one.total, other.total) << one.name;
    EXPECT_EQ(one.interior, other.interior) << one.name;
    EXPECT_EQ(one.time, other.time) << one.name;
    EXPECT_EQ(one.last, other.last) << one.name;
    EXPECT_EQ(one.motion, other.motion) << one.name;
  }
  EXPECT_EQ(a.Warnings(), b.Warnings());
}

Simulation GripperInMotion() {
  auto simulation = Simulation::Create(testing::Gripper{}.Make());
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(ErrorFigure, RestoredMomentGoesOnWithTheSameNumbers) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  StepBoth(simulation, figure, 10);
  const Simulation::Snapshot moment = simulation.Save();
  const ErrorFigure::Snapshot errors = figure.Save();
  StepBoth(simulation, figure, 20);
  ASSERT_GT(figure.largest().total, 0);
  // The same simulation, and one that has not been stepped.
  ErrorFigure again, fresh;
  ASSERT_TRUE(simulation.Restore(moment));
  again.Restore(simulation, errors);
  StepBoth(simulation, again, 20);
  ExpectEqual(again, figure);
  Simulation other = GripperInMotion();
  ASSERT_TRUE(other.Restore(moment));
  fresh.Restore(other, errors);
  StepBoth(other, fresh, 20);
  ExpectEqual(fresh, figure);
}

TEST(ErrorFigure, MomentBeforeTheFirstStepIsTheBeginning) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  const Simulation::Snapshot moment = simulation.Save();
  const ErrorFigure::Snapshot errors = figure.Save();
  StepBoth(simulation, figure, 10);
  ErrorFigure again = ErrorFigure();
  ASSERT_TRUE(simulation.Restore(moment));
  again.Restore(simulation, errors);
  EXPECT_TRUE(again.bodies().empty());
  StepBoth(simulation, again, 10);
  ExpectEqual(again, figure);
}

TEST(ErrorFigure, BegunAnewKeepsTheLargestErrorsAndSaysSo) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  StepBoth(simulation, figure, 10);
  const double before = figure.largest().total;
  figure.BeginAnew("here");
  figure.BeginAnew("there");  // no estimate ended
  EXPECT_EQ(figure.largest().total, before);
  EXPECT_EQ(figure.Warnings().back(), "the error estimate began anew here");
  StepBoth(simulation, figure, 1);
  EXPECT_GE(figure.largest().total, before);
}

// Steps beside the simulation go on under a gravity that leaves no finite velocity, and are undone.
TEST(ErrorFigure, IsNotQuantifiedWhereAShorterStepIsUndone) {
  Simulation simulation = GripperInMotion();
  ErrorFigure figure;
  StepBoth(simulation, figure, 5);
  const ErrorFigure::Snapshot before = figure.Save();
  const Simulation::Snapshot moment = simulation.Save();
  figure.BeginStep(simulation);
  const StepReport report = simulation.Step();
  const Vector3 gravity = simulation.step_options().gravity;
  simulation.step_options().gravity = Vector3::Constant(0.1 * std::numeric_limits<double>::max());
  figure.EndStep(simulation, report);
  simulation.step_options().gravity = gravity;
  EXPECT_FALSE(figure.largest().finite);
  EXPECT_FALSE(figure.largest().IsWithinRange());
  EXPECT_TRUE(std::isinf(figure.bodies()[0].last));
  ASSERT_EQ(figure.Warnings().size(), 1u);
  EXPECT_NE(figure.Warnings()[0].find("no error estimate"), std::string::npos) << figure.Warnings()[0];
  ASSERT_TRUE(simulation.Restore(moment));
  figure.Restore(simulation, before);
  StepBoth(simulation, figure, 5);
  EXPECT_TRUE(figure.largest().finite);
}

}  // namespace
}  // namespace fork1s
