// What comes to rest on a height field: against planes in the same place.
#include <cmath>
#include <draws.hpp>
#include <functional>
#include <random>

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

// A box on an even slope stays, level with the slope, and the ground carries its weight.
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

struct SlopeShape {
  const char* name;
  Shape shape;
  double half_height;  // of its centre above the slope
};

// What slides down an even field goes as down a plane, g (sin α - µ cos α), whatever cells are under it and
// in whatever direction of the grid: sides of columns, which are no surface, do not catch it.
TEST(HeightFieldSlide, GoesAsDownAPlane) {
  constexpr double kSlope = 0.4, kFriction = 0.25, kMass = 1.5, kTime = 0.5;
  const double angle = std::atan(kSlope);
  const double expected = kWeight * (std::sin(angle) - kFriction * std::cos(angle));
  auto hull = std::make_shared<TriangleMesh>();
  hull->name = "wedge";
  for (const float x : {-0.15f, 0.15f})
    for (const float y : {-0.1f, 0.1f}) {
      hull->vertices.push_back({x, y, -0.05f});
      hull->vertices.push_back({0.6f * x, 0.5f * y, 0.05f});
    }
  const SlopeShape sleds[] = {{"box", Box{Vector3(0.15, 0.12, 0.05)}, 0.05},
                              {"cylinder", Cylinder{0.12, 0.05}, 0.05},
                              {"mesh", MeshShape{hull}, 0.05}};
  for (const SlopeShape& sled : sleds)
    for (const double heading : {0.0, 0.7, 1.5707963267948966})
      for (const auto& [integrator, h] :
           {std::pair(Integrator::kTwoStage, 1.0 / 60), std::pair(Integrator::kTwoStage, 1.0 / 240),
            std::pair(Integrator::kEuler, 1.0 / 60)}) {
        const Vector3 down(std::cos(heading), std::sin(heading), 0);  // level, the way it goes
        const Matrix3 R =
            ExpRotation(angle * Vector3::UnitZ().cross(down)) * ExpRotation(Vector3(0, 0, 0.35));
        const Vector3 up = R.col(2), along = (down - down.dot(up) * up).normalized();
        Scene scene;
        scene.world.push_back(
            Ground([&](double x, double y) { return -kSlope * down.dot(Vector3(x, y, 0)); }, -1, kFriction));
        scene.free_bodies.push_back(testing::BoxBody("sled", kMass, Vector3(0.15, 0.12, sled.half_height),
                                                     Vector3::Zero(), kFriction));
        scene.free_bodies[0].geometries[0].shape = sled.shape;
        const Vector3 start = -0.3 * down;
        scene.free_bodies[0].X_WB =
            RigidTransform(R, start + Vector3(0, 0, 0.3 * kSlope) + (sled.half_height - 5e-6) * up);
        World world = testing::MustCreate(scene);
        StepOptions step;
        step.h = h;
        step.integrator = integrator;
        const auto speed = [&] { return along.dot(world.free_bodies()[0].velocity_of_center()); };
        const auto run = [&](double seconds) {
          for (int i = 0; i < std::lround(seconds / step.h); ++i)
            ASSERT_FALSE(world.Step(step).contacts_dropped);
        };
        run(0.1);
        const double before = speed();
        run(kTime);
        const std::string what =
            std::string(sled.name) + " towards " + std::to_string(heading) + ", step " + std::to_string(h);
        EXPECT_NEAR((speed() - before) / kTime, expected, 1e-3 * expected) << what;
        EXPECT_NEAR(world.free_bodies()[0].pose().rotation().col(2).dot(up), 1, 1e-6) << what;
      }
}

// Height of the ground's triangles, as MuJoCo divides its cells.
double HeightAt(const HeightGrid& grid, double low, double x, double y) {
  const double u = (x + grid.half_x) / 0.1, v = (y + grid.half_y) / 0.1;
  const int column = static_cast<int>(std::floor(u)), row = static_cast<int>(std::floor(v));
  const auto z = [&](int r, int c) {
    return low +
           grid.max_height * static_cast<double>(grid.values[static_cast<std::size_t>(r * grid.columns + c)]);
  };
  const double a = u - column, b = v - row, z00 = z(row, column), z11 = z(row + 1, column + 1);
  return a > b ? z00 + a * (z(row, column + 1) - z00) + b * (z11 - z(row, column + 1))
               : z00 + b * (z(row + 1, column) - z00) + a * (z11 - z(row + 1, column));
}

// What falls on rough ground is not in the ground after ten seconds: a box whose faces lie on peaks and whose
// corners lie in hollows, round shapes, a hull. What does not roll lies still, carried. A face on a ridge
// that is level with it, as those of seed 0, used to rock by 0.02 mm.
TEST(HeightFieldRest, AllShapesLieOnRoughGround) {
  constexpr double kLow = -0.5, kMass = 1.5;
  auto hull = std::make_shared<TriangleMesh>();
  hull->name = "wedge";
  for (const float x : {-0.15f, 0.15f})
    for (const float y : {-0.12f, 0.12f}) {
      hull->vertices.push_back({x, y, -0.05f});
      hull->vertices.push_back({0.6f * x, 0.5f * y, 0.05f});
    }
  const std::pair<const char*, Shape> shapes[] = {{"box", Box{Vector3(0.15, 0.12, 0.05)}},
                                                  {"cylinder", Cylinder{0.14, 0.05}},
                                                  {"capsule", Capsule{0.05, 0.12}},
                                                  {"mesh", MeshShape{hull}}};
  for (unsigned seed = 0; seed < testing::Seeds(2, 4); ++seed)
    for (const auto& [name, shape] : shapes) {
      std::mt19937 engine(seed);
      std::uniform_real_distribution<double> bumps(0, 0.03), turn(-0.5, 0.5);
      Scene scene;
      // A bowl, or it would roll away.
      scene.world.push_back(
          Ground([&](double x, double y) { return 0.2 * (x * x + y * y) + bumps(engine); }, kLow, 0.7));
      const HeightGrid grid = *std::get<HeightField>(scene.world[0].shape).grid;
      scene.free_bodies.push_back(
          testing::BoxBody("stone", kMass, Vector3(0.15, 0.12, 0.05), Vector3::Zero(), 0.7));
      scene.free_bodies[0].geometries[0].shape = shape;
      scene.free_bodies[0].X_WB = RigidTransform(
          ExpRotation(Vector3(turn(engine), turn(engine), turn(engine))), Vector3(0.1, -0.05, 0.25));
      World world = testing::MustCreate(scene);
      StepOptions step;
      step.h = 1.0 / 240;
      for (int i = 0; i < 2400; ++i) ASSERT_FALSE(world.Step(step).contacts_dropped);
      const FreeBody& stone = world.free_bodies()[0];
      const std::string what = std::string(name) + ", seed " + std::to_string(seed);
      if (!std::holds_alternative<Capsule>(shape) &&
          !std::holds_alternative<Cylinder>(shape)) {  // which roll
        EXPECT_LT(stone.velocity_of_center().norm(), 1e-9) << what;
        Vector3 force = Vector3::Zero();
        for (const ContactRecord& c : world.contacts())
          force += c.point.frame.transpose() * c.impulse / step.h;
        EXPECT_LT((force - Vector3(0, 0, kMass * kWeight)).norm(), 1e-2 * kMass * kWeight) << what;
      }
      // Points of the surface, found along directions from the middle.
      double deepest = 0;
      for (int i = 0; i < 20000; ++i) {
        std::normal_distribution<double> normal;
        Vector3 p(normal(engine), normal(engine), normal(engine));
        if (const auto* box = std::get_if<Box>(&shape)) {
          p /= p.cwiseQuotient(box->half).cwiseAbs().maxCoeff();
        } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
          p /= std::max(p.head<2>().norm() / cylinder->radius, std::abs(p.z()) / cylinder->half_length);
        } else if (const auto* capsule = std::get_if<Capsule>(&shape)) {
          const Vector3 n = p.normalized();
          p = capsule->radius * n +
              std::copysign(capsule->half_length * std::min(1.0, std::abs(p.z())), p.z()) * Vector3::UnitZ();
        } else {  // of the bottom of the hull, and its corners
          p = Vector3(0.15 * std::tanh(p.x()), 0.12 * std::tanh(p.y()), -0.05);
        }
        const Vector3 at = stone.pose() * p;
        deepest = std::max(deepest, HeightAt(grid, kLow, at.x(), at.y()) - at.z());
      }
      EXPECT_LT(deepest, 3e-4) << what;
    }
}

}  // namespace
}  // namespace fork1s
