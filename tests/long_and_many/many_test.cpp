// Many hands in one scene do what one does, in any number of threads.
#include <gtest/gtest.h>

#include <fork1s/constraints/material.hpp>
#include <fstream>
#include <many_hands.hpp>
#include <string>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

namespace fork1s::examples {
namespace {

const char* const kScene = FORK1S_SOURCE_DIR "/scenes/hand.xml";

ManyHands Hands(int count) {
  ManyHands hands;
  hands.count = count;
  hands.scenario.shake = false;
  hands.scenario.rest = -3;  // up to the end of the lift
  return hands;
}

Simulation Create(const ManyHands& hands) {
  auto simulation = CreateManyHands(kScene, hands);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

TEST(ManyHands, DoWhatOneDoes) {
  Simulation one = Create(Hands(1)), many = Create(Hands(36));
  const ManyHandsMeasurement alone = RunManyHands(one, Hands(1)), together = RunManyHands(many, Hands(36));
  EXPECT_TRUE(together.finite);
  EXPECT_EQ(together.held, 36);
  // A corner that only just bears counts or not by its last digits.
  EXPECT_NEAR(together.contacts_max, 36 * alone.contacts_max, 36);
  EXPECT_EQ(together.unconverged_closing, 0);
  // Places on the table differ by up to 2 m, whose rounding contacts may grow a little.
  EXPECT_NEAR(together.penetration_max, alone.penetration_max, 1e-9);
  const int k = 35;
  const auto in_palm = [](const Simulation& s, int hand) {
    const std::string suffix = "#" + std::to_string(hand);
    return Vector3(s.Pose("palm" + suffix).inverse() * s.Pose("box" + suffix).translation());
  };
  // Such a corner begins to remember what its tangents bear, some 0.1 N, a step sooner or later.
  EXPECT_LT((in_palm(many, k) - in_palm(one, 0)).norm(), 0.1 / ContactMaterial().stiffness);
}

TEST(ManyHands, SameBitsForAnyNumberOfThreads) {
  std::vector<std::uint64_t> hashes;
  for (int threads : {1, 2, 3, 4}) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                            static_cast<std::size_t>(threads));
    oneapi::tbb::task_arena arena(threads);
    arena.execute([&] {
      Simulation simulation = Create(Hands(36));
      hashes.push_back(RunManyHands(simulation, Hands(36)).hash);
    });
  }
  for (std::uint64_t hash : hashes) EXPECT_EQ(hash, hashes.front());
}

// One hand's touch, or its change of reference, is no business of its neighbours.
class ManyHandsBy : public ::testing::TestWithParam<Integrator> {};

TEST_P(ManyHandsBy, DoNotKnowOfEachOther) {
  const Simulation made = Create(Hands(2));
  SimulationOptions options = made.options();
  options.step.integrator = GetParam();
  auto one = Simulation::Create(made.scene(), options), other = Simulation::Create(made.scene(), options);
  ASSERT_TRUE(one && other);
  Simulation &pair = *one, &still = *other;
  const int first = pair.FindBody("box#0");
  for (int i = 0; i < 90; ++i) {
    for (Simulation* s : {&pair, &still}) {
      for (const auto& [name, value] : HandSetPoints(i / 60.0, Hands(2).scenario))
        if (name.find('.') == std::string::npos) s->SetControl(name + "#1", value);
    }
    for (const auto& [name, value] : HandSetPoints(i / 30.0, Hands(2).scenario))
      if (name.find('.') == std::string::npos) pair.SetControl(name + "#0", value);
    if (i == 40) pair.ApplyWrench(first, Vector3(2, 0, 0), Vector3::Zero(), pair.Pose(first).translation());
    pair.Step();
    still.Step();
  }
  EXPECT_NE(pair.Pose("box#0").translation(), still.Pose("box#0").translation());
  // Collision points are looked for as far ahead as the fastest body needs, so contacts that stay open may
  // differ; what they do must not. By two stages a step in which one meets something is halved for both, and
  // differs by its error: 1e-6 m of 30 mm.
  EXPECT_LT((pair.Pose("box#1").translation() - still.Pose("box#1").translation()).norm(),
            GetParam() == Integrator::kEuler ? 1e-9 : 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Integrators, ManyHandsBy,
                         ::testing::Values(Integrator::kEuler, Integrator::kTwoStage));

// Kilobytes asked of the system at most since the program began, whether ever written or not.
long MostMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmPeak:")) return std::stol(line.substr(7));
  return -1;
}

// What a step needs grows with what touches each other, not with the square of all that there is: 150 hands
// once asked for 3 GB, 400 for 36, and 1000 were refused.
TEST(ManyHands, FitIntoMemory) {
  const long before = MostMemory();
  if (before < 0) GTEST_SKIP() << "there is no /proc/self/status to read the memory from";
  Simulation simulation = Create(Hands(150));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.Step().finite);
  // They hold some 40 MB; what threads set aside, 64 MB each, is the rest.
  EXPECT_LT(MostMemory() - before, 1'000'000);
}

}  // namespace
}  // namespace fork1s::examples
