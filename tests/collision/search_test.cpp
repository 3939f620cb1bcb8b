// The search through many pairs: what it finds is what each pair alone has, on any number of threads.
#include <random>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>
#include <algorithm>
#include <cmath>

#include "parallel/parallel_for.hpp"
#include "scenes.hpp"

namespace fork1s {
namespace {

using namespace testing;

// Shapes of every kind, some bodies of two, over a plane, rough ground and still boxes; some pairs touch by
// no means.
struct Crowd {
  std::vector<CollisionBodyDef> bodies;
  std::vector<std::pair<int, int>> excluded;
  std::vector<int> moving;
};

Crowd MakeCrowd(int count) {
  Crowd crowd;
  auto grid = std::make_shared<HeightGrid>();
  grid->rows = grid->columns = 12;
  grid->half_x = grid->half_y = 0.6;
  grid->max_height = 0.08;
  grid->base_depth = 0.1;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> share(0, 1);
  for (int k = 0; k < grid->rows * grid->columns; ++k) grid->values.push_back(share(random));
  crowd.bodies = {Still(Plane{}, At(0, 0, -0.02)), Still(HeightField{grid}, At(0, 0, -0.04))};
  for (int k = 0; k < 12; ++k)
    crowd.bodies.push_back(Still(Box{Vector3(0.03, 0.02, 0.05)}, At(-0.5 + 0.09 * k, 0.3, 0.05)));
  const MeshShape hull = BoxMesh(Vector3(0.04, 0.03, 0.05), Vector3(0.01, 0, 0));
  for (int k = 0; k < count; ++k) {
    std::vector<GeometryDef> shapes;
    switch (k % 7) {
      case 0:
        shapes = {Geometry(Sphere{0.05})};
        break;
      case 1:
        shapes = {Geometry(Capsule{0.03, 0.05})};
        break;
      case 2:
        shapes = {Geometry(Box{Vector3(0.05, 0.03, 0.04)}), Geometry(Sphere{0.03}, At(0, 0, 0.06))};
        break;
      case 3:
        shapes = {Geometry(Cylinder{0.04, 0.04})};
        break;
      case 4:
        shapes = {Geometry(Ellipsoid{Vector3(0.05, 0.04, 0.03)})};
        break;
      case 5:
        shapes = {Geometry(hull)};
        break;
      default:
        shapes = {Geometry(Capsule{0.02, 0.06}), Geometry(Box{Vector3(0.02, 0.04, 0.02)}, At(0.05, 0, 0))};
    }
    if (k % 11 == 3)
      for (GeometryDef& g : shapes) g.contype = 2, g.conaffinity = 1;
    crowd.moving.push_back(static_cast<int>(crowd.bodies.size()));
    crowd.bodies.push_back(Moving(shapes));
    if (k % 5 == 4) crowd.excluded.emplace_back(crowd.moving.back(), crowd.moving.back() - 3);
  }
  crowd.excluded.emplace_back(0, crowd.moving.front());
  return crowd;
}

void Throw(std::mt19937& random, Crowd& crowd) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const int b : crowd.moving) {
    const Quaternion q =
        Quaternion(uniform(random), uniform(random), uniform(random), uniform(random)).normalized();
    crowd.bodies[static_cast<std::size_t>(b)].X_WB = RigidTransform(
        q, Vector3(0.55 * uniform(random), 0.55 * uniform(random), 0.1 + 0.1 * uniform(random)));
  }
}

bool Same(const ContactPoint& a, const ContactPoint& b) {
  return a.geometry_a == b.geometry_a && a.geometry_b == b.geometry_b && a.point == b.point &&
         a.frame == b.frame && a.gap == b.gap && a.friction == b.friction;
}

// Two bodies by themselves have few pairs, which have names and are found without a sweep.
TEST(PairSearch, FindsWhatEachPairOfBodiesHas) {
  Crowd crowd = MakeCrowd(21);
  const int count = static_cast<int>(crowd.bodies.size());
  std::mt19937 random(8);
  Throw(random, crowd);
  const CollisionOptions near{.margin = 0.02};
  const std::vector<ContactPoint> together = Contacts(crowd.bodies, crowd.excluded, near);
  std::size_t seen = 0;
  for (int a = 0; a < count; ++a)
    for (int b = a + 1; b < count; ++b) {
      const CollisionBodyDef &body_a = crowd.bodies[static_cast<std::size_t>(a)],
                             &body_b = crowd.bodies[static_cast<std::size_t>(b)];
      if (!body_a.moves && !body_b.moves) continue;
      bool excluded = false;
      for (const auto& pair : crowd.excluded)
        excluded = excluded || std::minmax(pair.first, pair.second) == std::minmax(a, b);
      std::vector<ContactPoint> here;
      for (const ContactPoint& c : together)
        if (std::minmax(c.body_a, c.body_b) == std::minmax(a, b)) here.push_back(c);
      const auto alone = excluded ? std::vector<ContactPoint>() : Contacts({body_a, body_b}, {}, near);
      ASSERT_EQ(here.size(), alone.size()) << a << " " << b;
      for (std::size_t k = 0; k < here.size(); ++k) {
        EXPECT_TRUE(Same(here[k], alone[k])) << a << " " << b;
        EXPECT_EQ(here[k].body_a < here[k].body_b, alone[k].body_a == 0);
      }
      seen += here.size();
    }
  EXPECT_EQ(seen, together.size());
  EXPECT_GT(seen, 40u);
}

// A body that a step has thrown out of all numbers touches nothing, and keeps no other from being found.
TEST(PairSearch, WhatIsNoNumberTouchesNothing) {
  Crowd crowd = MakeCrowd(105);
  const CollisionOptions near{.margin = 0.01};
  std::mt19937 random(4);
  Throw(random, crowd);
  auto world = CollisionWorld::Create(crowd.bodies, crowd.excluded, near);
  std::vector<ContactPoint> all, rest;
  ASSERT_TRUE(world->Detect(all));
  const auto lost = [&](int b) {
    return std::find(crowd.moving.begin(), crowd.moving.end(), b) != crowd.moving.end() && b % 3 == 0;
  };
  for (const int b : crowd.moving)
    if (lost(b)) world->SetPose(b, RigidTransform(Vector3::Constant(std::nan(""))));
  ASSERT_TRUE(world->Detect(rest));
  std::size_t next = 0;
  for (const ContactPoint& c : all)
    if (!lost(c.body_a) && !lost(c.body_b)) {
      ASSERT_LT(next, rest.size());
      EXPECT_TRUE(Same(c, rest[next++]));
    }
  EXPECT_EQ(next, rest.size());
  EXPECT_LT(rest.size(), all.size());
  EXPECT_GT(rest.size(), 100u);
}

TEST(PairSearch, SameBitsForAnyNumberOfThreadsAndAnyPast) {
  Crowd crowd = MakeCrowd(210);
  const CollisionOptions near{.margin = 0.01};
  std::vector<std::unique_ptr<CollisionWorld>> worlds;
  for (int k = 0; k < 4; ++k)
    worlds.push_back(
        std::make_unique<CollisionWorld>(*CollisionWorld::Create(crowd.bodies, crowd.excluded, near)));
  std::mt19937 random(2);
  std::size_t seen = 0;
  for (int trial = 0; trial < 5; ++trial) {
    Throw(random, crowd);
    std::vector<std::vector<ContactPoint>> found(worlds.size());
    for (std::size_t k = 0; k < worlds.size(); ++k) {
      if (k == 1 && trial == 3) continue;  // one that saw less
      for (const int b : crowd.moving) worlds[k]->SetPose(b, crowd.bodies[static_cast<std::size_t>(b)].X_WB);
      const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, k + 1);
      oneapi::tbb::task_arena arena(static_cast<int>(k) + 1);
      arena.execute([&] { EXPECT_TRUE(worlds[k]->Detect(found[k])); });
      ASSERT_EQ(found[k].size(), found[0].size());
      for (std::size_t i = 0; i < found[k].size(); ++i) EXPECT_TRUE(Same(found[k][i], found[0][i]));
    }
    seen += found[0].size();
  }
  EXPECT_GT(seen, 1000u);  // several threads' worth at a time
}

// Worlds of the same shapes share what MuJoCo compiled of them, and all share scratch; friction and poses are
// their own.
TEST(PairSearch, WorldsThatTakeTurnsDoNotDisturbEachOther) {
  const CollisionOptions near{.margin = 0.01};
  std::mt19937 random(3);
  std::vector<Crowd> crowds{MakeCrowd(21), MakeCrowd(21), MakeCrowd(6), MakeCrowd(210)};
  for (CollisionBodyDef& body : crowds[1].bodies)
    for (GeometryDef& g : body.geometries) g.friction = 0.25;
  std::vector<CollisionWorld> worlds;
  for (Crowd& crowd : crowds) {
    Throw(random, crowd);
    worlds.push_back(*CollisionWorld::Create(crowd.bodies, crowd.excluded, near));
  }
  std::vector<std::vector<ContactPoint>> first(worlds.size());
  for (std::size_t k = 0; k < worlds.size(); ++k) {
    EXPECT_TRUE(worlds[k].Detect(first[k]));
    EXPECT_GT(first[k].size(), 0u);
  }
  for (const ContactPoint& point : first[1]) EXPECT_EQ(point.friction, 0.25);
  for (const std::size_t k : {1, 0, 3, 2, 0, 1}) {
    std::vector<ContactPoint> again, alone;
    EXPECT_TRUE(worlds[k].Detect(again));
    CollisionWorld other = *CollisionWorld::Create(crowds[k].bodies, crowds[k].excluded, near);
    EXPECT_TRUE(other.Detect(alone));
    ASSERT_EQ(again.size(), first[k].size());
    ASSERT_EQ(alone.size(), first[k].size());
    for (std::size_t i = 0; i < again.size(); ++i) {
      EXPECT_TRUE(Same(again[i], first[k][i]));
      EXPECT_TRUE(Same(alone[i], first[k][i]));
    }
  }
}

}  // namespace
}  // namespace fork1s
