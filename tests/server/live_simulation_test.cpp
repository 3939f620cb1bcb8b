#include <cmath>
#include <nlohmann/json.hpp>

#include "support.hpp"

namespace fork1s::test {
namespace {

TEST(LiveSimulation, InteriorBodyFollowsAPullAndTheForceShows) {
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  const int body = live.simulation().FindBody("index_proximal");
  ASSERT_FALSE(live.simulation().bodies()[static_cast<std::size_t>(body)].is_interface);
  for (int i = 0; i < 30; ++i) live.Advance(kNoLimit);
  const Vector3 point(0.04, 0, 0);
  const Vector3 start = live.simulation().Pose(body) * point;
  const Vector3 target = start + Vector3(0.03, 0, 0.03);
  ASSERT_FALSE(live.Handle(Pull(body, point, target)));
  live.Advance(kNoLimit);
  ASSERT_EQ(live.pulls().size(), 1u);  // within one frame
  EXPECT_GT(live.pulls()[0].force_W.norm(), 0.1);
  for (int i = 0; i < 120; ++i) live.Advance(kNoLimit);
  const Vector3 held = live.simulation().Pose(body) * point;
  EXPECT_LT((held - target).norm(), 0.8 * (start - target).norm());
  EXPECT_GT((held - start).norm(), 0.005);
  // At rest the spring holds what its stretch says.
  const Vector3 stretch = live.settings().pull_stiffness * (target - held);
  EXPECT_LT((live.pulls()[0].force_W - stretch).norm(), 0.1 * stretch.norm());
  live.Handle(Of(Command::Kind::kRelease));
  for (int i = 0; i < 240; ++i) live.Advance(kNoLimit);
  EXPECT_TRUE(live.pulls().empty());
  EXPECT_LT((live.simulation().Pose(body) * point - start).norm(), 1e-3);
}

TEST(LiveSimulation, NoStiffnessOfThePullBlowsUp) {
  for (const char* scene : {"hand.xml", "firemen.xml", "hexapod.xml"}) {
    LiveSimulation live = Live(scene);
    live.Handle(Set("pull_stiffness", 1e6));
    for (std::size_t b = 0; b < live.simulation().bodies().size(); b += 3) {
      const int body = static_cast<int>(b);
      const Vector3 start = live.simulation().Pose(body).translation();
      for (int i = 0; i < 40; ++i) {
        live.Handle(Pull(body, Vector3(0.01, 0, 0), start + Vector3(0.02 * std::sin(0.3 * i), 0.02, 0.01)));
        live.Advance(kNoLimit);
      }
      ASSERT_TRUE(live.PopFaults().empty()) << scene << ' ' << b;
      // Stretched by 3 cm the spring holds some 450 J.
      ASSERT_LT(live.simulation().KineticEnergy(), 1e4) << scene << ' ' << b;
    }
  }
}

TEST(LiveSimulation, NoStiffnessOfThePullBlowsUpInTheAir) {
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/hexapod.xml");
  ASSERT_TRUE(imported);
  Scene scene = imported->scene;
  scene.world.clear();
  scene.gravity.setZero();
  scene.timestep = 1.0 / 240;
  for (MechanismDef& m : scene.mechanisms) {
    m.base = BaseKind::kFixed;
    for (BodyDef& body : m.bodies) body.geometries.clear();
  }
  auto live = LiveSimulation::Create(scene, {}, "in the air");
  ASSERT_TRUE(live) << live.error().Text();
  EXPECT_EQ(live->simulation().step_options().integrator, Integrator::kTwoStage);
  live->Handle(Set("pull_stiffness", 1e6));
  const int body = static_cast<int>(live->simulation().bodies().size()) - 1;
  const Vector3 start = live->simulation().Pose(body).translation();
  for (int i = 0; i < 120; ++i) {
    live->Handle(Pull(body, Vector3(0.01, 0, 0), start + Vector3(0.02 * std::sin(0.3 * i), 0.02, 0.01)));
    live->Advance(kNoLimit);
    ASSERT_LT(live->simulation().KineticEnergy(), 1e4) << i;
  }
  EXPECT_TRUE(live->PopFaults().empty());
}

TEST(LiveSimulation, OneViewerDrags) {
  LiveSimulation live = Live("hand.xml");
  EXPECT_FALSE(live.Handle(Pull(2, Vector3::Zero(), Vector3::Zero(), 1)));
  EXPECT_TRUE(live.Handle(Pull(3, Vector3::Zero(), Vector3::Zero(), 2)));
  Command left = Of(Command::Kind::kLeft);
  left.viewer = 2;
  live.Handle(left);
  EXPECT_TRUE(live.Handle(Pull(3, Vector3::Zero(), Vector3::Zero(), 2)));
  left.viewer = 1;
  live.Handle(left);
  EXPECT_FALSE(live.Handle(Pull(3, Vector3::Zero(), Vector3::Zero(), 2)));
}

TEST(LiveSimulation, PauseStepReset) {
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  const std::uint64_t initial = live.simulation().HashState();
  for (int i = 0; i < 10; ++i) live.Advance(kNoLimit);
  live.Handle(Of(Command::Kind::kPause, true));
  const auto steps = live.simulation().steps();
  for (int i = 0; i < 5; ++i) live.Advance(kNoLimit);
  EXPECT_EQ(live.simulation().steps(), steps);
  live.Handle(Of(Command::Kind::kStep));
  live.Advance(kNoLimit);
  live.Advance(kNoLimit);
  EXPECT_EQ(live.simulation().steps(), steps + 1);
  EXPECT_TRUE(live.paused());
  live.Handle(Of(Command::Kind::kReset));
  EXPECT_EQ(live.simulation().HashState(), initial);
}

TEST(LiveSimulation, ABuiltAnewModelStandsWhereTheOldOneStood) {
  LiveSimulation live = Live("firemen.xml");
  for (int i = 0; i < 30; ++i) live.Advance(kNoLimit);
  const int bodies = static_cast<int>(live.simulation().bodies().size());
  for (const Command& change :
       {Set("modes", 8), Set("detail", 2), Set("stiffness", 2, 0), Set("damping", 3), Set("friction", 0.5),
        Set("dt", 0.005), Set("recovery", 2), Set("recovery", 1)}) {
    std::vector<Vector3> before;
    for (int b = 0; b < bodies; ++b) before.push_back(live.simulation().Pose(b).translation());
    const auto refusal = live.Handle(change);
    ASSERT_FALSE(refusal) << change.setting << ": " << refusal->sentence;
    double moved = 0;
    for (int b = 0; b < bodies; ++b)
      moved = std::max(
          moved, (live.simulation().Pose(b).translation() - before[static_cast<std::size_t>(b)]).norm());
    EXPECT_LT(moved, 1e-6) << change.setting;
    for (int i = 0; i < 3; ++i) live.Advance(kNoLimit);
  }
}

TEST(LiveSimulation, InterfacesArePicked) {
  LiveSimulation live = Live("hand.xml");
  const Simulation& s = live.simulation();
  Command c = Of(Command::Kind::kInterfaces);
  c.bodies = {s.FindBody("index_tip"), s.FindBody("thumb_middle")};
  ASSERT_FALSE(live.Handle(c));
  EXPECT_TRUE(s.bodies()[static_cast<std::size_t>(c.bodies[1])].is_interface);
  EXPECT_FALSE(s.bodies()[static_cast<std::size_t>(s.FindBody("ring_tip"))].is_interface);
  const auto hash = s.HashState();
  c.bodies = {};
  EXPECT_TRUE(live.Handle(c));
  c.bodies = {s.FindBody("box")};
  EXPECT_TRUE(live.Handle(c));
  c.bodies = {9999};
  EXPECT_TRUE(live.Handle(c));
  EXPECT_EQ(s.HashState(), hash);  // a refusal changes nothing
}

TEST(LiveSimulation, ADrivenBaseFollowsItsSliderAtABoundedSpeed) {
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  const int lift = live.simulation().FindControl("palm.z");
  const double start = live.simulation().Pose("palm").translation().z();
  live.Handle(Set("control", 0.1, lift));
  double before = start, fastest = 0;
  for (int i = 0; i < 60; ++i) {
    live.Advance(kNoLimit);
    const double z = live.simulation().Pose("palm").translation().z();
    fastest = std::max(fastest, (z - before) * 60);
    before = z;
    if (i == 20) {
      ASSERT_FALSE(live.Handle(Set("modes", 2)));  // the slider keeps its meaning
    }
  }
  EXPECT_LE(fastest, 1.0 + 1e-9);
  EXPECT_NEAR(before, start + 0.1, 1e-4);
}

TEST(LiveSimulation, RefusesWhatDoesNotExist) {
  LiveSimulation live = Live("hand.xml");
  EXPECT_TRUE(live.Handle(Set("control", 0, 999)));
  EXPECT_TRUE(live.Handle(Set("control", 0, -1)));
  EXPECT_TRUE(live.Handle(Set("dt", 0)));
  EXPECT_TRUE(live.Handle(Set("gravity", 1e6)));
  EXPECT_TRUE(live.Handle(Set("stiffness", 2, 999)));
  EXPECT_TRUE(live.Handle(Set("nonsense", 2)));
  EXPECT_TRUE(live.Handle(Pull(-1, Vector3::Zero(), Vector3::Zero())));
  EXPECT_TRUE(live.Handle(Pull(9999, Vector3::Zero(), Vector3::Zero())));
}

TEST(LiveSimulation, JointGroupsAreTheFingers) {
  LiveSimulation live = Live("hand.xml");
  const auto scene = nlohmann::json::parse(*live.Capture(1).scene);
  ASSERT_EQ(scene["groups"].size(), 5u);
  EXPECT_EQ(scene["groups"][0]["name"], "index_knuckle");
}

}  // namespace
}  // namespace fork1s::test
