// What is stacked comes to rest, whatever the faces on each other.
#include <cmath>
#include <meshes.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::Geometry;
using testing::kDown;

constexpr double kHalf = 0.05;  // m

Shape Prism(int sides) { return testing::PrismMesh(sides, kHalf, kHalf); }

// Five of 1 kg on a floor, each turned by 0.1 rad against the one below.
World Stack(const std::vector<Shape>& shapes) {
  Scene scene;
  scene.world.push_back(Geometry("floor", Plane{}, 0.5));
  for (std::size_t i = 0; i < 5; ++i) {
    const double turn = 0.1 * static_cast<double>(i), height = kHalf * static_cast<double>(2 * i + 1);
    FreeBodyDef body =
        testing::BoxBody("s" + std::to_string(i), 1, Vector3::Constant(kHalf), Vector3::Zero(), 0.5);
    body.geometries[0].shape = shapes[i % shapes.size()];
    body.X_WB = RigidTransform(ExpRotation(Vector3(0, 0, turn)), Vector3(0, 0, height));
    scene.free_bodies.push_back(body);
  }
  return testing::MustCreate(scene);
}

Vector3 ForceOfFloor(const World& world, double h) {
  Vector3 force = Vector3::Zero();
  for (const ContactRecord& c : world.contacts())
    if (std::min(c.point.body_a, c.point.body_b) == 0) force += c.point.frame.transpose() * c.impulse / h;
  return force;
}

// Rounding leaves far less than 1e-7 of the weight. Contact points that followed the sway of their stack kept it going: 2e-3.
TEST(Stack, OfTurnedShapes_ComesToRest) {
  const Shape box = Box{Vector3::Constant(kHalf)}, cylinder = Cylinder{kHalf, kHalf};
  const std::vector<std::vector<Shape>> stacks = {{box},       {cylinder},          {cylinder, box},
                                                  {Prism(5)},  {Prism(12)},         {Prism(12), box},
                                                  {Prism(32)}, {cylinder, Prism(5)}};
  for (std::size_t k = 0; k < stacks.size(); ++k)
    for (const double h : {1.0 / 60, 1.0 / 240})
      for (StepOptions step : {testing::TwoStage(h, kDown), testing::BackwardEuler(h, kDown)}) {
        SCOPED_TRACE(std::to_string(k) + (step.integrator == Integrator::kEuler ? " euler " : " two-stage ") +
                     std::to_string(h));
        World world = Stack(stacks[k]);
        const int settled = static_cast<int>(std::lround(3 / h));
        Vector3 low = Vector3::Constant(1e9), high = -low;
        for (int i = 0; i < settled + 60; ++i) {
          const StepReport report = world.Step(step);
          ASSERT_TRUE(report.finite && report.stages_converged) << i;
          if (i < settled) continue;
          const Vector3 force = ForceOfFloor(world, h);
          low = low.cwiseMin(force);
          high = high.cwiseMax(force);
        }
        const double weight = 5 * 9.81;
        EXPECT_LT((high - low).norm(), 1e-7 * weight);
        EXPECT_NEAR(std::abs(high.z()), weight, 1e-6 * weight);
      }
}

}  // namespace
}  // namespace fork1s
