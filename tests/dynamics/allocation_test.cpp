// A step without a refresh must not touch the heap once it is warm.
#include <dynamics/support.hpp>

#include <atomic>
#include <cstdlib>

namespace {
std::atomic<long> allocations{0};
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
// Every road to the heap ends here, Eigen's and operator new's alike.
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
#endif

namespace fork1s {
namespace {

TEST(WorldAllocation, NoneInAStep) {
  // A floating walker that stands, a loop with limits that touches a box, and a ball.
  MechanismDef walker = testing::Walker(BaseKind::kFloating, 60, 1);
  for (BodyDef& body : walker.bodies)
    if (body.name.rfind("shank", 0) == 0)
      body.geometries.push_back(
          testing::Geometry(body.name, Sphere{0.02}, 0.8, RigidTransform(Vector3(0.15, 0, 0))));
  walker.X_WR = RigidTransform(Vector3(0, 0, 0.025));
  MechanismDef bar = testing::FourBar().Definition();
  bar.X_WR = RigidTransform(Vector3(2, 0, 0.1));
  bar.bodies[0].name = "ground";
  bar.bodies[2].geometries.push_back(testing::Geometry("paddle", Sphere{0.03}, 0.8));
  bar.joints[0].WithLimits(-0.05, 0.05);
  Scene scene;
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
  scene.mechanisms = {walker, bar};
  scene.free_bodies.push_back(testing::BallBody("ball", 0.1, 0.05, Vector3(1, 1, 0.05), 0.8));
  scene.free_bodies.push_back(
      testing::BoxBody("box", 1, Vector3(0.05, 0.05, 0.05), Vector3(2, 0.1, 0.18), 0.8));
  World world = testing::MustCreate(scene);
  StepOptions step;
  step.refresh = false;
  for (int i = 0; i < 30; ++i) world.Step(step);
  int contacts = 0;
  const long before = allocations.load();
  for (int i = 0; i < 60; ++i) contacts += world.Step(step).contacts;
  const long after = allocations.load();
  EXPECT_EQ(after, before);
  EXPECT_GT(contacts, 60);
}

}  // namespace
}  // namespace fork1s
