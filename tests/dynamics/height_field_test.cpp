// What comes to rest on a height field: against planes in the same place.
#include <cmath>
#include <functional>

#include "support.hpp"

namespace fork1s {
namespace {

constexpr double kWeight = 9.81;

// 2 m square, cells of 0.1 m, heights above `low`.
GeometryDef Ground(const std::function<double(double, double)>& height, double low, double friction) {
  auto grid = std::make_shared<HeightGrid>();
  constexpr int kPoints = 21;
  constexpr double kHalf = 1, kSpan = 2;
  grid->name = "ground";
  grid->rows = grid->columns = kPoints;
  grid->half_x = grid->half_y = kHalf;
  grid->max_height = kSpan;
  grid->base_depth = 0.1;
  for (int row = 0; row < kPoints; ++row)
    for (int column = 0; column < kPoints; ++column)
      grid->values.push_back(
          static_cast<float>((height(column * 0.1 - kHalf, row * 0.1 - kHalf) - low) / kSpan));
  return testing::Geometry("ground", HeightField{grid}, friction, RigidTransform(Vector3(0, 0, low)));
}

// A ball that is dropped beside the middle of a square funnel rolls to its bottom, where four faces carry it:
// with slopes ±s along x and y its centre stands R √(1 + 2s²) above the bottom.
TEST(HeightFieldRest, ABallSettlesAtTheBottomOfAFunnel) {
  constexpr double kSlope = 0.3, kRadius = 0.12, kMass = 2;
  Scene scene;
  scene.world.push_back(
      Ground([](double x, double y) { return kSlope * (std::abs(x) + std::abs(y)); }, 0, 0.6));
  scene.free_bodies.push_back(testing::BallBody("ball", kMass, kRadius, Vector3(0.31, -0.22, 0.5), 0.6));
  World world = testing::MustCreate(scene);
  StepOptions step;
  for (int i = 0; i < 1200; ++i) {
    const StepReport report = world.Step(step);
    ASSERT_TRUE(report.finite);
    ASSERT_FALSE(report.contacts_dropped);
  }
  const FreeBody& ball = world.free_bodies()[0];
  const Vector3 at = ball.pose().translation();
  EXPECT_NEAR(at.x(), 0, 1e-4);
  EXPECT_NEAR(at.y(), 0, 1e-4);
  EXPECT_NEAR(at.z(), kRadius * std::sqrt(1 + 2 * kSlope * kSlope), 3e-5);  // it sinks by 10 µm as designed
  Vector3 force = Vector3::Zero();
  for (const ContactRecord& c : world.contacts()) force += c.point.frame.transpose() * c.impulse / step.h;
  EXPECT_NEAR(force.z(), kMass * kWeight, 1e-4 * kMass * kWeight);
}

// A box on an even slope stays, level with the slope, and the ground carries its weight. (Sliding over cells
// is another matter: docs/contact_detection.md, limits.)
TEST(HeightFieldRest, ABoxStaysOnASlope) {
  constexpr double kSlope = 0.4, kFriction = 0.8, kMass = 1.5;
  const double angle = std::atan(kSlope);
  const Vector3 half(0.15, 0.12, 0.05);
  const RigidTransform turned(ExpRotation(Vector3(0, -angle, 0)) * ExpRotation(Vector3(0, 0, 0.35)),
                              Vector3::Zero());
  const Vector3 up = turned.rotation().col(2);
  Scene scene;
  scene.world.push_back(Ground([](double x, double) { return kSlope * x; }, -0.5, kFriction));
  scene.free_bodies.push_back(testing::BoxBody("box", kMass, half, Vector3::Zero(), kFriction));
  scene.free_bodies[0].X_WB = RigidTransform(turned.rotation(), Vector3(0.3, 0.1, kSlope * 0.3) + 0.06 * up);
  World world = testing::MustCreate(scene);
  StepOptions step;
  step.h = 1.0 / 240;
  const auto run = [&](double seconds) {
    for (int i = 0; i < std::lround(seconds / step.h); ++i) ASSERT_FALSE(world.Step(step).contacts_dropped);
  };
  run(0.5);
  const FreeBody& box = world.free_bodies()[0];
  const Vector3 before = box.pose().translation();
  EXPECT_NEAR(box.pose().rotation().col(2).dot(up), 1, 1e-6);
  const double depth = half.z() - (before.z() - kSlope * before.x()) * up.z();
  EXPECT_NEAR(depth, 0, 3e-5);  // contacts give by 10 µm as designed
  run(2);
  EXPECT_LT((box.pose().translation() - before).norm(), 1e-6);
  Vector3 force = Vector3::Zero();
  for (const ContactRecord& c : world.contacts()) force += c.point.frame.transpose() * c.impulse / step.h;
  EXPECT_LT((force - Vector3(0, 0, kMass * kWeight)).norm(), 1e-4 * kMass * kWeight);
}

}  // namespace
}  // namespace fork1s
