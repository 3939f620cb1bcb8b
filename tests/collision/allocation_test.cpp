// Detect must not touch the heap once its output has capacity.
#include <atomic>
#include <cstdlib>

#include "scenes.hpp"

namespace {
std::atomic<long> allocations{0};
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__)
// Every road to the heap ends here, MuJoCo's and operator new's alike.
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
  allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
#endif

namespace fork1s {
namespace {

using namespace testing;

TEST(CollisionAllocation, NoneInDetect) {
  std::vector<CollisionBodyDef> bodies = {
      Still(Plane{}), Moving(Sphere{0.1}, At(0, 0, 0.0995)),
      Moving(Box{Vector3(0.1, 0.1, 0.1)}, At(0, 0, 0.2985)),
      Moving(BoxMesh(Vector3(0.1, 0.1, 0.1), Vector3::Zero()), At(0, 0, 0.497)),
      Moving(Cylinder{0.1, 0.1}, At(0.1, 0, 0.0995))};
  auto world = CollisionWorld::Create(bodies, {{0, 2}});
  ASSERT_TRUE(world.has_value()) << world.error().Text();
  std::vector<ContactPoint> contacts;
  contacts.reserve(100);
  const long before = allocations.load();
  std::size_t seen = 0;
  for (int k = 0; k < 100; ++k) {
    world->SetPose(1, At(0.001 * k, 0, 0.0995));
    EXPECT_TRUE(world->Detect(contacts));
    seen += contacts.size();
  }
  EXPECT_EQ(allocations.load(), before);
  EXPECT_GT(seen, 500u);
}

}  // namespace
}  // namespace fork1s
