// Detect must not touch the heap once its output has capacity.
#include <allocation_counter.hpp>

#include "scenes.hpp"

namespace fork1s {
namespace {

using testing::allocations;

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
  EXPECT_EQ(before > 0, testing::kCountsAllocations);
  std::size_t seen = 0;
  for (int k = 0; k < 100; ++k) {
    world->SetPose(1, At(0.001 * k, 0, 0.0995));
    EXPECT_TRUE(world->Detect(contacts));
    seen += contacts.size();
  }
  EXPECT_EQ(allocations.load(), before);
  EXPECT_GT(seen, 500u);
}

// More pairs than have names, few enough for one thread.
TEST(CollisionAllocation, NoneInASearchThroughManyPairs) {
  std::vector<CollisionBodyDef> bodies = {Still(Plane{})};
  for (int k = 0; k < 12; ++k) bodies.push_back(Moving(Sphere{0.1}, At(0.199 * k, 0, 0.0995)));
  auto world = CollisionWorld::Create(bodies, {});
  ASSERT_TRUE(world.has_value()) << world.error().Text();
  std::vector<ContactPoint> contacts;
  contacts.reserve(100);
  EXPECT_TRUE(world->Detect(contacts));
  const long before = allocations.load();
  std::size_t seen = 0;
  for (int k = 0; k < 50; ++k) {
    world->SetPose(12, At(0.05 * k, 0, 0.29));
    EXPECT_TRUE(world->Detect(contacts));
    seen += contacts.size();
  }
  EXPECT_EQ(allocations.load(), before);
  EXPECT_GT(seen, 1000u);
}

}  // namespace
}  // namespace fork1s
