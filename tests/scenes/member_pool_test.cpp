// Members of a batch, which take turns in worlds: each gives the bits of a simulation of its own.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>

#include <cstdint>
#include <numeric>
#include <random>
#include <stdexcept>

#include "parallel/parallel_for.hpp"
#include "sim/member_pool.hpp"

namespace fork1s {
namespace {

using internal::MemberPool;

Scene SceneOf(const std::string& name) {
  auto read = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/" + name + ".xml");
  if (!read) throw std::runtime_error(read.error().Text());
  return std::move(read->scene);
}

Drawn DrawnAs(const SceneFactors& factors, const VectorX& start = {}) { return {factors, start}; }

MemberPool PoolOf(const Scene& scene, const std::vector<Drawn>& drawn,
                  const std::vector<StartRange>& ranges = {}) {
  auto starts = Starts::Create(scene, {}, ranges);
  if (!starts) throw std::runtime_error(starts.error().Text());
  return MemberPool(std::move(*starts), drawn.size());
}

void BeginAll(const std::vector<Drawn>& drawn, MemberPool& pool) {
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const auto begun = pool.Begin(i, drawn[i]);
    ASSERT_TRUE(begun) << begun.error().Text();
  }
}

Simulation Alone(const Scene& scene, const Drawn& drawn, const std::vector<StartRange>& ranges = {}) {
  auto begun = Starts::Create(scene, {}, ranges)->Begin(drawn);
  if (!begun) throw std::runtime_error(begun.error().Text());
  return std::move(*begun);
}

// Set-points and a push that the i-th of a hundred steps of a member has.
void Drive(std::size_t member, int step, Simulation& simulation) {
  std::mt19937 bits(static_cast<unsigned>(1000 * member) + static_cast<unsigned>(step / 10));
  std::uniform_real_distribution<double> within(-0.2, 0.2);
  for (int k = 0; k < simulation.controls().size(); ++k)
    if (!simulation.DrivesBase(k)) simulation.SetControl(k, simulation.controls()(k) + within(bits));
  if (step % 7 == static_cast<int>(member) % 7)
    simulation.ApplyWrench(0, Vector3(within(bits), within(bits), within(bits)), Vector3::Zero(),
                           simulation.Pose(0).translation());
}

std::uint64_t HashOf(MemberPool& pool, std::size_t member) {
  std::uint64_t hash = 0;
  pool.Read(member, [&](const Simulation& simulation) { hash = simulation.HashState(); });
  return hash;
}

class MemberPoolOfScene : public ::testing::TestWithParam<const char*> {};

TEST_P(MemberPoolOfScene, StepsByTurns_EachAsAlone) {
  const Scene scene = SceneOf(GetParam());
  const std::vector<Drawn> drawn(5);
  MemberPool pool = PoolOf(scene, drawn);
  ASSERT_NO_FATAL_FAILURE(BeginAll(drawn, pool));
  std::vector<Simulation> alone;
  for (const Drawn& one : drawn) alone.push_back(Alone(scene, one));
  for (int step = 0; step < 50; ++step)
    for (std::size_t k = 0; k < drawn.size(); ++k) {
      const std::size_t member = (k * 3 + static_cast<std::size_t>(step)) % drawn.size();
      Drive(member, step, alone[member]);
      alone[member].Step();
      pool.Change(member, [&](Simulation& simulation) {
        Drive(member, step, simulation);
        simulation.Step();
      });
      ASSERT_EQ(HashOf(pool, member), alone[member].HashState()) << member << " after step " << step;
    }
  for (std::size_t member = 0; member < drawn.size(); ++member)
    pool.Read(member, [&](const Simulation& simulation) {
      EXPECT_EQ(simulation.time(), alone[member].time());
      for (int b = 0; b < static_cast<int>(simulation.bodies().size()); ++b) {
        EXPECT_EQ(simulation.Pose(b).translation(), alone[member].Pose(b).translation());
        EXPECT_EQ(simulation.Velocity(b), alone[member].Velocity(b));
      }
    });
}

INSTANTIATE_TEST_SUITE_P(Scenes, MemberPoolOfScene,
                         ::testing::Values("hand", "fourbar_gripper", "quadruped", "vehicle", "peg_grasp"));

TEST(MemberPool, ThreadsAndFactors_EachAsAlone) {
  const Scene scene = SceneOf("fourbar_gripper");
  std::vector<Drawn> drawn;
  for (int i = 0; i < 12; ++i)
    drawn.push_back(DrawnAs({i % 3 == 0 ? 1.0 : 1.3, i % 3 == 1 ? 1.0 : 0.7, i < 8 ? 1.0 : 1.1}));
  MemberPool pool = PoolOf(scene, drawn);
  ASSERT_NO_FATAL_FAILURE(BeginAll(drawn, pool));
  for (int call = 0; call < 8; ++call)
    ParallelFor(0, static_cast<int>(drawn.size()), 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i)
        pool.Change(static_cast<std::size_t>(i), [&](Simulation& simulation) {
          for (int step = 5 * call; step < 5 * call + 5; ++step) {
            Drive(static_cast<std::size_t>(i), step, simulation);
            simulation.Step();
          }
        });
    });
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    Simulation alone = Alone(scene, drawn[i]);
    for (int step = 0; step < 40; ++step) {
      Drive(i, step, alone);
      alone.Step();
    }
    EXPECT_EQ(HashOf(pool, i), alone.HashState()) << i;
  }
}

// Each is about a reference of its own, and one starts beyond a limit, which is widened for it alone.
TEST(MemberPool, DrawnStarts_EachAsAlone) {
  auto read = LoadMechanismFromString(R"(<mujoco><worldbody>
    <body><joint name="a" axis="0 1 0" stiffness="5" damping=".1" limited="true" range="-20 20"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/>
      <body pos=".3 0 0"><joint name="b" axis="0 1 0" stiffness="5" damping=".1"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/></body></body>
    </worldbody></mujoco>)",
                                      "arm");
  ASSERT_TRUE(read) << read.error().Text();
  const std::vector<StartRange> ranges = {{"a", {-1, 1}}, {"b", {-1, 1}}};
  const std::vector<Drawn> drawn = {DrawnAs({}, Vector2(0.6, 0)), DrawnAs({}, Vector2(0.1, 0.8)),
                                    DrawnAs({2, 1, 1}, Vector2(-0.2, -0.5)), DrawnAs({}, Vector2(0.3, 0.1))};
  MemberPool pool = PoolOf(read->scene, drawn, ranges);
  ASSERT_NO_FATAL_FAILURE(BeginAll(drawn, pool));
  std::vector<Simulation> alone;
  for (const Drawn& one : drawn) alone.push_back(Alone(read->scene, one, ranges));
  bool met_limit = false;
  for (int step = 0; step < 120; ++step)
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      alone[i].Step();
      StepReport report;
      pool.Change(i, [&](Simulation& simulation) { report = simulation.Step(); });
      met_limit = met_limit || report.limits > 0;
      ASSERT_EQ(HashOf(pool, i), alone[i].HashState()) << i << " after step " << step;
    }
  EXPECT_TRUE(met_limit);
}

TEST(MemberPool, BeginAndRestore_MoveMembers) {
  const Scene scene = SceneOf("fourbar_gripper");
  const std::vector<Drawn> drawn = {DrawnAs({}), DrawnAs({}), DrawnAs({1.5, 1, 1})};
  MemberPool pool = PoolOf(scene, drawn);
  ASSERT_NO_FATAL_FAILURE(BeginAll(drawn, pool));
  const auto step = [&](std::size_t member, int count) {
    pool.Change(member, [&](Simulation& simulation) {
      for (int i = 0; i < count; ++i) simulation.Step();
    });
  };
  const std::uint64_t start = HashOf(pool, 0);
  step(0, 20), step(1, 10), step(2, 15);
  const Simulation::Snapshot stiff = pool.Moment(2);
  const std::uint64_t hash_of_stiff = HashOf(pool, 2);
  // To the beginning, and to a moment of other factors.
  ASSERT_TRUE(pool.Begin(0, drawn[0]));
  EXPECT_EQ(HashOf(pool, 0), start);
  ASSERT_TRUE(pool.Restore(1, stiff, drawn[2].factors));
  EXPECT_EQ(HashOf(pool, 1), hash_of_stiff);
  ASSERT_TRUE(pool.Begin(2, drawn[0]));
  EXPECT_EQ(HashOf(pool, 2), start);
  for (std::size_t i = 0; i < 3; ++i) step(i, 10);
  EXPECT_EQ(HashOf(pool, 0), HashOf(pool, 2));
  Simulation alone = Alone(scene, drawn[2]);
  for (int i = 0; i < 25; ++i) alone.Step();
  EXPECT_EQ(HashOf(pool, 1), alone.HashState());
  // What is refused, or throws, leaves the member as it was.
  const std::uint64_t before = HashOf(pool, 1);
  EXPECT_FALSE(pool.Restore(1, Alone(SceneOf("hand"), {}).Save(), {}));
  EXPECT_THROW(pool.Change(1,
                           [](Simulation& simulation) {
                             simulation.Step();
                             throw std::runtime_error("");
                           }),
               std::runtime_error);
  EXPECT_EQ(HashOf(pool, 1), before);
}

TEST(MemberPool, MomentOfOtherDetail_TakesAWorldOfItsOwn) {
  const Scene scene = SceneOf("hand");
  const std::vector<Drawn> drawn(3);
  MemberPool pool = PoolOf(scene, drawn);
  ASSERT_NO_FATAL_FAILURE(BeginAll(drawn, pool));
  Simulation detailed = Alone(scene, {});
  for (int i = 0; i < 5; ++i) detailed.Step();
  const auto set = detailed.SetFidelity({DetailLevel::kInterface, 4, Recovery::kTwist});
  ASSERT_TRUE(set) << set.error().Text();
  ASSERT_TRUE(pool.Restore(1, detailed.Save(), {}));
  Simulation plain = Alone(scene, {});
  for (int step = 0; step < 10; ++step) {
    detailed.Step();
    plain.Step();
    for (std::size_t i = 0; i < 3; ++i) {
      pool.Change(i, [](Simulation& simulation) { simulation.Step(); });
      ASSERT_EQ(HashOf(pool, i), i == 1 ? detailed.HashState() : plain.HashState()) << i;
    }
  }
}

}  // namespace
}  // namespace fork1s
