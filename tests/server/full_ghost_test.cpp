// The full simulation beside the live one takes the same start and the same inputs.
#include <chrono>
#include <cstring>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <nlohmann/json.hpp>
#include <thread>

#include "sim/interface_names.hpp"
#include "support.hpp"

namespace fork1s::test {
namespace {

// What the ghost shows once it has done `steps`; it works on a thread of its own.
std::optional<GhostView> After(const FullGhost& ghost, std::int64_t steps) {
  for (int i = 0; i < 60000; ++i) {
    auto view = ghost.Newest();
    if (!ghost.on()) return {};
    if (view && view->steps >= steps) return view;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return {};
}

FullSimulation ByHand(const Simulation& simulation) {
  FullSimulationOptions options;
  options.dt = simulation.dt();
  options.initial_keyframe = simulation.options().initial_keyframe;
  options.interfaces = InterfaceNames(simulation);
  options.collision = simulation.options().collision;
  auto full = FullSimulation::Create(simulation.scene(), options);
  if (!full) throw std::runtime_error(full.error().Text());
  return std::move(*full);
}

TEST(FullGhost, IsTheFullSimulationSteppedByHand) {
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  FullSimulation full = ByHand(live.simulation());
  live.Handle(Of(Command::Kind::kGhost, true));
  const int finger = live.simulation().FindBody("index_proximal"), box = live.simulation().FindBody("box");
  const Vector3 point(0.03, 0, 0), target = live.simulation().Pose(finger) * point + Vector3(0.02, 0, 0.03);
  live.Handle(Set("control", 0.05, live.simulation().FindControl("palm.z")));
  live.Handle(Set("control", 0.3, 0));
  constexpr int kSteps = 40;
  std::vector<Vector3> live_at;
  for (int i = 0; i < kSteps; ++i) {
    if (i == 5) live.Handle(Pull(finger, point, target));
    if (i == 15) live.Handle(Set("gravity", -4));
    if (i == 25) {
      Command push = Pull(box, Vector3::Zero(), Vector3(0, 1, 0));
      push.kind = Command::Kind::kPush;
      live.Handle(push);
    }
    live.Advance(kNoLimit);
    full.SetGravity(live.simulation().step_options().gravity);
    full.SetControls(live.simulation().controls());
    for (const ShownPull& p : live.pulls()) {
      const Vector3 at_B = p.body == finger ? point : Vector3(Vector3::Zero());
      full.ApplyWrench(p.body, p.force_W, Vector3::Zero(), full.Pose(p.body) * at_B);
    }
    ASSERT_TRUE(full.Step().finite);
  }
  const auto view = After(*live.ghost(), kSteps);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->behind, 0);
  EXPECT_NEAR(view->time, kSteps * live.simulation().dt(), 1e-12);
  ASSERT_EQ(view->X_WB.size(), live.simulation().bodies().size());
  double worst = 0;
  for (std::size_t b = 0; b < view->X_WB.size(); ++b) {
    const RigidTransform expected = full.Pose(static_cast<int>(b));
    // Equal but for the last digits of the start, which went through the reduced model's coordinates.
    EXPECT_LT((view->X_WB[b].translation() - expected.translation()).norm(), 1e-6);
    EXPECT_LT((view->X_WB[b].rotation() - expected.rotation()).norm(), 1e-5);
    worst = std::max(
        worst, (expected.translation() - live.simulation().Pose(static_cast<int>(b)).translation()).norm());
  }
  EXPECT_NEAR(view->distance, worst, 1e-6);
  ASSERT_GE(view->body, 0);
}

TEST(FullGhost, StartsWhereTheLiveSimulationStandsAndItsBaseGoesAlong) {
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  const auto base = static_cast<std::size_t>(live.simulation().FindBody("palm"));
  live.Handle(Set("control", 0.1, live.simulation().FindControl("palm.z")));
  live.Handle(Set("control", 0.5, live.simulation().FindControl("palm.rx")));
  for (int i = 0; i < 10; ++i) live.Advance(kNoLimit);
  const RigidTransform start = live.simulation().Pose(static_cast<int>(base));
  live.Handle(Of(Command::Kind::kGhost, true));
  const auto begun = After(*live.ghost(), 0);
  ASSERT_TRUE(begun);
  EXPECT_LT(begun->distance, 1e-9);
  for (int i = 0; i < 10; ++i) live.Advance(kNoLimit);
  const auto view = After(*live.ghost(), 10);
  ASSERT_TRUE(view);
  const RigidTransform now = live.simulation().Pose(static_cast<int>(base));
  ASSERT_GT((now.translation() - start.translation()).norm(), 0.01);
  EXPECT_LT((view->X_WB[base].translation() - now.translation()).norm(), 1e-9);
  EXPECT_LT((view->X_WB[base].rotation() - now.rotation()).norm(), 1e-9);
}

// The messages of viewers: the epoch that the poses belong to is the second word.
std::uint32_t EpochOf(const Message& ghost) {
  std::uint32_t words[2];
  std::memcpy(words, ghost->data(), sizeof words);
  return words[0] == static_cast<std::uint32_t>(WireKind::kGhost) ? words[1] : 0;
}

TEST(FullGhost, BeginsAnewWithTheModelAndEndsWithTheLastViewer) {
  LiveSimulation live = Live("hand.xml");
  live.Handle(Of(Command::Kind::kGhost, true));
  live.Advance(kNoLimit);
  ASSERT_TRUE(After(*live.ghost(), 1));
  Snapshot s = live.Capture(1);
  ASSERT_TRUE(s.ghost);
  EXPECT_EQ(EpochOf(s.ghost), s.epoch);
  EXPECT_TRUE(nlohmann::json::parse(*s.settings)["ghost"].get<bool>());
  const std::uint32_t before = s.epoch;
  ASSERT_FALSE(live.Handle(Set("damping", 2)));
  ASSERT_TRUE(After(*live.ghost(), 0));
  s = live.Capture(1);
  EXPECT_GT(s.epoch, before);
  ASSERT_TRUE(s.ghost);
  EXPECT_EQ(EpochOf(s.ghost), s.epoch);
  s = live.Capture(0);
  EXPECT_FALSE(s.ghost);
  EXPECT_FALSE(live.ghost()->on());
  EXPECT_FALSE(nlohmann::json::parse(*s.settings)["ghost"].get<bool>());
}

TEST(FullGhost, GivesUpWhenItIsTooFarBehind) {
  LiveSimulation live = Live("hand.xml");
  const Simulation& s = live.simulation();
  FullGhost ghost(0.5);
  GhostStart start;
  start.scene = s.scene();
  start.scene.keyframes.resize(1);
  start.options.dt = s.dt();
  start.options.initial_keyframe = 0;
  for (const MechanismDynamics& m : s.world().mechanisms()) start.base_start.push_back(m.state().X_WR);
  start.p_WB.resize(s.bodies().size(), Vector3::Zero());
  ghost.Begin(start);
  // Far faster than any full simulation could follow, the first step of which waits for it to be built.
  for (int i = 0; i < 100000 && ghost.on(); ++i)
    ghost.Push({s.controls(), Vector3(0, 0, -9.81), {}, start.p_WB});
  EXPECT_FALSE(ghost.on());
  const auto fault = ghost.PopFault();
  ASSERT_TRUE(fault);
  EXPECT_NE(fault->find("behind"), std::string::npos);
  EXPECT_FALSE(ghost.PopFault());
}

}  // namespace
}  // namespace fork1s::test
