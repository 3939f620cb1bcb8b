// What the C interface tells of contacts and rays, beside the C++ one.
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <random>
#include <set>

#include "support.hpp"

namespace fork1s {
namespace {

using namespace testing;  // the simulations of support.hpp

TEST(CSimulation, ContactsBearTheWeight) {
  const auto imported = LoadMechanism(ScenePath("fourbar_gripper.xml"));
  ASSERT_TRUE(imported);
  Simulation simulation = Create(*imported);
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("fourbar_gripper.xml")));
  Check(fork1s_simulation_step(in_c.get(), 120, FORK1S_HOLD, nullptr));
  for (int i = 0; i < 120; ++i) simulation.Step();
  const std::vector<BodyContact> expected = Contacts(simulation);
  const int count = Count(in_c, fork1s_simulation_num_contacts);
  ASSERT_EQ(count, static_cast<int>(expected.size()));
  std::vector<fork1s_contact> rows(static_cast<std::size_t>(count) + 2);
  std::int32_t found = -1, cube = -1;
  Check(fork1s_simulation_contacts(in_c.get(), rows.data(), rows.size(), &found));
  ASSERT_EQ(found, count);
  Check(fork1s_simulation_find_body(in_c.get(), "cube", &cube));
  double weight = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(rows[i].body_a, expected[i].body_a);
    EXPECT_EQ(rows[i].body_b, expected[i].body_b);
    EXPECT_EQ(Vector3(rows[i].point), expected[i].point_W);
    EXPECT_EQ(Vector3(rows[i].normal), expected[i].normal_W);
    EXPECT_EQ(Vector3(rows[i].force), expected[i].force_W);
    EXPECT_EQ(Vector3(rows[i].torque), expected[i].moment_W);
    EXPECT_EQ(rows[i].gap, expected[i].gap);
    EXPECT_EQ(rows[i].friction, expected[i].friction);
    if (rows[i].body_a == cube) weight -= rows[i].force[2];
    if (rows[i].body_b == cube) weight += rows[i].force[2];
  }
  EXPECT_NEAR(weight, 0.03 * 9.81,
              1e-6);  // at rest after two seconds: to the tolerance of the contact solver
  EXPECT_EQ(fork1s_simulation_contacts(in_c.get(), rows.data(), static_cast<std::size_t>(count) - 1, &found),
            FORK1S_ERROR_USAGE);
  const std::vector<double> uses = Read(in_c, expected.size(), fork1s_simulation_friction_uses);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const BodyContact& c = expected[i];
    EXPECT_EQ(uses[i], ContactLoad::OfContact(c.force_W, c.normal_W, c.friction).FrictionUse());
  }
}

TEST(CSimulation, RaysMeetWhatTheCppOnesMeet) {
  const auto imported = LoadMechanism(ScenePath("fourbar_gripper.xml"));
  ASSERT_TRUE(imported);
  Simulation simulation = Create(*imported);
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("fourbar_gripper.xml")));
  auto rays = RayCaster::Create(simulation);
  ASSERT_TRUE(rays);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::set<int> met;
  int missed = 0;
  for (int i = 0; i < 200; ++i) {
    if (i % 20 == 0) {
      Check(fork1s_simulation_step(in_c.get(), 1, FORK1S_HOLD, nullptr));
      simulation.Step();
    }
    const Vector3 origin = 0.2 * Vector3(uniform(random), uniform(random), uniform(random) + 1);
    const Vector3 aim = 0.05 * Vector3(uniform(random), uniform(random), uniform(random) + 1);
    const Vector3 direction =
        i % 4 == 0 ? origin : Vector3(aim - origin);  // every fourth away from everything
    const auto expected = rays->Cast(simulation, origin, direction, 0.5);
    std::int32_t found = -1;
    fork1s_ray_hit hit{};
    Check(fork1s_simulation_ray(in_c.get(), origin.data(), direction.data(), 0.5, &found, &hit));
    ASSERT_EQ(found, expected ? 1 : 0);
    missed += expected ? 0 : 1;
    if (!expected) continue;
    met.insert(hit.body);
    EXPECT_EQ(hit.body, expected->body);
    EXPECT_EQ(hit.distance, expected->distance);
    EXPECT_EQ(Vector3(hit.point), expected->point_W);
    EXPECT_EQ(Vector3(hit.normal), expected->normal_W);
  }
  EXPECT_GT(met.size(), 3u);
  EXPECT_GT(missed, 0);
}

}  // namespace
}  // namespace fork1s
