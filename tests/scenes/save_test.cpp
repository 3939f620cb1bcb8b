// A moment of every scene, saved and gone back to: the same bits follow.
#include "run.hpp"

namespace fork1s::examples {
namespace {

struct SaveCase {
  const char* scene;
  Integrator integrator;
};
std::ostream& operator<<(std::ostream& out, const SaveCase& c) {
  return out << c.scene << (c.integrator == Integrator::kTwoStage ? ", two stages" : ", euler");
}

std::vector<std::uint64_t> HashesOf(SceneRun& run, int steps) {
  std::vector<std::uint64_t> hashes;
  for (int i = 0; i < steps; ++i) {
    run.Until(run.simulation().time() + run.simulation().dt());
    hashes.push_back(run.simulation().HashState());
  }
  return hashes;
}

class Saved : public ::testing::TestWithParam<SaveCase> {};

TEST_P(Saved, TheSameBitsFollow) {
  constexpr int kSteps = 60;  // every scene refreshes, touches something or closes loops in these
  SceneRun run(GetParam().scene), fresh(GetParam().scene);
  for (SceneRun* r : {&run, &fresh}) r->simulation().step_options().integrator = GetParam().integrator;
  for (const double from : {0.0, 0.7, 2.0}) {
    run.Until(from);
    const Simulation::Snapshot moment = run.simulation().Save();
    const std::uint64_t hash = run.simulation().HashState();
    const std::vector<std::uint64_t> first = HashesOf(run, kSteps);
    ASSERT_TRUE(run.simulation().Restore(moment)) << from;
    EXPECT_EQ(run.simulation().HashState(), hash) << from;
    EXPECT_EQ(HashesOf(run, kSteps), first) << from;
    // Nothing that the next step reads stayed behind in the workspace of the first.
    ASSERT_TRUE(fresh.simulation().Restore(moment)) << from;
    EXPECT_EQ(fresh.simulation().HashState(), hash) << from;
    EXPECT_EQ(HashesOf(fresh, kSteps), first) << from;
  }
}

std::vector<SaveCase> AllCases() {
  std::vector<SaveCase> cases;
  for (const char* scene : {"hexapod_terrain", "firemen", "vehicle", "grasp_box", "grasp_mug", "peg_grasp",
                            "hammer", "fourbar_gripper", "excavator", "beam_walkers"})
    for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage})
      cases.push_back({scene, integrator});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(Scenes, Saved, ::testing::ValuesIn(AllCases()));

TEST(Saved, AcrossFidelity) {
  SceneRun run("peg_grasp");
  run.Until(0.5);
  Simulation& simulation = run.simulation();
  const Simulation::Snapshot held = simulation.Save();
  const std::vector<std::uint64_t> first = HashesOf(run, 20);
  const auto set = simulation.SetFidelity({DetailLevel::kObject, -1, Recovery::kExact});
  ASSERT_TRUE(set) << set.error().Text();
  ASSERT_FALSE(simulation.frozen_grasps().empty());
  const Simulation::Snapshot frozen = simulation.Save();
  const std::vector<std::uint64_t> object = HashesOf(run, 20);
  ASSERT_TRUE(simulation.Restore(held));
  EXPECT_TRUE(simulation.frozen_grasps().empty());
  EXPECT_EQ(HashesOf(run, 20), first);
  ASSERT_TRUE(simulation.Restore(frozen));
  EXPECT_EQ(simulation.fidelity().level, DetailLevel::kObject);
  EXPECT_EQ(HashesOf(run, 20), object);
}

TEST(Saved, RefusesAnotherScene) {
  SceneRun box("grasp_box"), hammer("hammer");
  box.Until(0.1);
  const std::uint64_t hash = box.simulation().HashState();
  const auto refused = box.simulation().Restore(hammer.simulation().Save());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
  EXPECT_NE(refused.error().Text().find("another scene"), std::string::npos) << refused.error().Text();
  EXPECT_FALSE(box.simulation().Restore(Simulation::Snapshot{}));
  EXPECT_EQ(box.simulation().HashState(), hash);
}

}  // namespace
}  // namespace fork1s::examples
