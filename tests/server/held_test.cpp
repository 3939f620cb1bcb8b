// The level of detail that simulates what is held, live: what viewers are told, and what they say, in the
// order of the wire.
#include <algorithm>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <thread>

#include "../sim/gripper.hpp"
#include "support.hpp"

namespace fork1s::test {
namespace {

// A free body before the one that will be held: taking that one into the gripper changes the order.
LiveSimulation LiveGripper() {
  Scene scene = fork1s::testing::Gripper().Make();
  FreeBodyDef other = scene.free_bodies[0];
  other.name = "other";
  other.X_WB = RigidTransform(Vector3(0.3, 0, 0));
  scene.free_bodies.insert(scene.free_bodies.begin(), other);
  GeometryDef floor;
  floor.shape = Plane{};
  floor.X_BG = RigidTransform(Vector3(0, 0, -0.3));
  scene.world.push_back(floor);
  auto live = LiveSimulation::Create(scene, {}, "gripper");
  if (!live) throw std::runtime_error(live.error().Text());
  live->Handle(Set("control", 0.02, 0));
  live->Handle(Set("control", 0.02, 1));
  for (int i = 0; i < 60; ++i) live->Advance(kNoLimit);
  return std::move(*live);
}

nlohmann::json SceneOf(LiveSimulation& live) { return nlohmann::json::parse(*live.Capture(1).scene); }

int OnWire(LiveSimulation& live, const std::string& name) {
  const nlohmann::json scene = SceneOf(live);
  for (std::size_t i = 0; i < scene["bodies"].size(); ++i)
    if (scene["bodies"][i]["name"] == name) return static_cast<int>(i);
  return -1;
}

std::vector<Vector3> Origins(const LiveSimulation& live) {
  std::vector<Vector3> p_WB;
  for (std::size_t b = 0; b < live.simulation().bodies().size(); ++b)
    p_WB.push_back(live.simulation().Pose(static_cast<int>(b)).translation());
  return p_WB;
}

double Largest(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

// The number of a frame's scalars that has this name.
double ScalarOf(const std::string& frame, const std::string& name) {
  const auto names = ScalarNames();
  const auto at = std::find(names.begin(), names.end(), name) - names.begin();
  double value = 0;
  std::memcpy(&value, frame.data() + 16 + 8 * at, sizeof value);
  return value;
}

TEST(LiveHeld, TheLoadFactorIsToldOfFrozenContactsToo) {
  fork1s::testing::Gripper gripper;
  gripper.tip = 0.01;
  gripper.friction = 1;
  auto live = LiveSimulation::Create(gripper.Make(), {}, "gripper");
  ASSERT_TRUE(live) << live.error().Text();
  const double by = 0.006;  // m: 3 N of the 6 N that eject, docs/method.md, section 6
  for (int side : {0, 1}) live->Handle(Set("control", by, side));
  const auto factor = [&] {
    double told = 0;
    for (int i = 0; i < 11; ++i) {  // it is asked for with every tenth frame
      live->Advance(kNoLimit);
      told = ScalarOf(*live->Capture(1).frame, "load_factor");
    }
    return told;
  };
  for (int i = 0; i < 60; ++i) live->Advance(kNoLimit);
  const double rolling = factor();
  EXPECT_NEAR(rolling, 2, 0.1);
  const auto refusal = live->Handle(Set("detail", 0));
  ASSERT_FALSE(refusal) << refusal->sentence;
  EXPECT_NEAR(factor() / rolling, 1, 0.01);
}

TEST(LiveHeld, ViewersGetTheHeldBodyAsOneOfItsHolder) {
  LiveSimulation live = LiveGripper();
  const std::uint32_t shapes = live.Capture(1).geometry_version;
  EXPECT_EQ(OnWire(live, "ball"), 4);
  const std::vector<Vector3> before = Origins(live);
  const auto refusal = live.Handle(Set("detail", 0));
  ASSERT_FALSE(refusal) << refusal->sentence;
  EXPECT_LT(Largest(before, Origins(live)), 1e-9);
  EXPECT_EQ(OnWire(live, "ball"), 3);
  EXPECT_EQ(OnWire(live, "other"), 4);
  const Snapshot s = live.Capture(1);
  EXPECT_GT(s.geometry_version, shapes);
  const auto scene = nlohmann::json::parse(*s.scene), geometry = nlohmann::json::parse(*s.geometry);
  EXPECT_EQ(scene["geometry"], geometry["version"]);
  EXPECT_EQ(scene["bodies"][3]["root"], 0);
  EXPECT_TRUE(scene["bodies"][3]["interface"]);
  EXPECT_FALSE(scene["bodies"][1]["interface"]);
  int balls = 0;
  for (const auto& shape : geometry["shapes"]) balls += shape["body"] == 3 && shape["kind"] == "sphere";
  EXPECT_EQ(balls, 1);
  EXPECT_EQ(nlohmann::json::parse(*s.settings)["detail"], 0);
}

TEST(LiveHeld, PullsActOnTheBodyThatTheViewerSees) {
  LiveSimulation live = LiveGripper();
  ASSERT_FALSE(live.Handle(Set("detail", 0)));
  const int ball = live.simulation().FindBody("ball");
  const Vector3 start = live.simulation().Pose(ball).translation();
  const int wire = OnWire(live, "ball");
  ASSERT_NE(wire, ball);
  ASSERT_FALSE(live.Handle(Pull(wire, Vector3::Zero(), start + Vector3(0, 0.01, 0))));
  for (int i = 0; i < 60; ++i) live.Advance(kNoLimit);
  ASSERT_EQ(live.pulls().size(), 1u);
  EXPECT_EQ(live.pulls()[0].body, ball);
  EXPECT_GT((live.simulation().Pose(ball).translation() - start).y(), 1e-3);
  EXPECT_TRUE(live.Handle(Pull(5, Vector3::Zero(), start)));
}

TEST(LiveHeld, WhatIsHeldStaysHeldWhenTheModelIsBuiltAnew) {
  LiveSimulation live = LiveGripper();
  ASSERT_FALSE(live.Handle(Set("detail", 0)));
  const std::vector<Vector3> before = Origins(live);
  for (const Command& change : {Set("friction", 0.5), Set("dt", 0.01), Set("recovery", 1)}) {
    const auto refusal = live.Handle(change);
    ASSERT_FALSE(refusal) << change.setting << ": " << refusal->sentence;
    EXPECT_EQ(live.simulation().frozen_grasps().size(), 1u) << change.setting;
    EXPECT_LT(Largest(before, Origins(live)), 1e-6) << change.setting;
  }
  ASSERT_FALSE(live.Handle(Of(Command::Kind::kReset)));
  EXPECT_TRUE(live.simulation().frozen_grasps().empty());
  EXPECT_EQ(nlohmann::json::parse(*live.Capture(1).settings)["detail"], 1);
  EXPECT_EQ(OnWire(live, "ball"), 4);
  // Nothing touches yet: a sentence, and nothing changes.
  const auto refusal = live.Handle(Set("detail", 0));
  ASSERT_TRUE(refusal);
  EXPECT_NE(refusal->sentence.find("holds nothing at present"), std::string::npos) << refusal->sentence;
  EXPECT_EQ(live.settings().detail, DetailLevel::kInterface);
}

TEST(LiveHeld, AGhostBesideItTouchesWithTheFingers) {
  LiveSimulation live = LiveGripper();
  ASSERT_FALSE(live.Handle(Set("detail", 0)));
  ASSERT_FALSE(live.Handle(Of(Command::Kind::kGhost, true)));
  for (int i = 0; i < 30; ++i) live.Advance(kNoLimit);
  ASSERT_NE(live.ghost(), nullptr);
  std::optional<GhostView> view;
  for (int i = 0; i < 2000 && (!view || view->steps < 30); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    view = live.ghost()->Newest();
  }
  ASSERT_TRUE(view);
  ASSERT_EQ(view->steps, 30);
  EXPECT_LT(view->distance, 1e-4);  // the ball has not slipped out of the fingers
}

// Two mechanisms that hold the ball together are one on the wire, with the sliders in the order of before.
TEST(LiveHeld, MechanismsThatHoldTogetherAreOneOnTheWire) {
  auto made = LiveSimulation::Create(fork1s::testing::Apart(fork1s::testing::Gripper()), {}, "apart");
  ASSERT_TRUE(made) << made.error().Text();
  LiveSimulation& live = *made;
  const int right = live.simulation().FindControl("right");
  live.Handle(Set("control", 0.02, live.simulation().FindControl("left")));
  live.Handle(Set("control", 0.02, right));
  for (int i = 0; i < 60; ++i) live.Advance(kNoLimit);
  const std::vector<Vector3> before = Origins(live);
  const auto refusal = live.Handle(Set("detail", 0));
  ASSERT_FALSE(refusal) << refusal->sentence;
  EXPECT_LT(Largest(before, Origins(live)), 1e-9);
  const nlohmann::json scene = SceneOf(live);
  std::vector<std::string> names;
  for (const auto& body : scene["bodies"]) names.push_back(body["name"]);
  EXPECT_EQ(names, (std::vector<std::string>{"frame", "left", "other frame", "right", "ball", "by-frame",
                                             "by-left", "place of other frame"}));
  EXPECT_EQ(scene["bodies"][4]["root"], 0);
  for (int i = 0; i < 3; ++i) {
    const auto& control = scene["controls"][static_cast<std::size_t>(i)];
    EXPECT_EQ(control["name"], live.simulation().control_names()[static_cast<std::size_t>(i)]);
    const auto joint = control["joints"][0].get<std::size_t>();
    EXPECT_EQ(scene["joints"][joint]["name"], control["name"].get<std::string>() + "_grip");
  }
  // It acts on the finger that it names; what stands in an empty place cannot be pulled.
  live.Handle(Set("control", 0.03, right));
  for (int i = 0; i < 60; ++i) live.Advance(kNoLimit);
  const int ball = live.simulation().FindBody("ball");
  EXPECT_LT(live.simulation().Pose(ball).translation().x(),
            before[static_cast<std::size_t>(ball)].x() - 1e-3);
  EXPECT_TRUE(live.Handle(Pull(7, Vector3::Zero(), Vector3::Zero())));
  ASSERT_FALSE(live.Handle(Pull(4, Vector3::Zero(), Vector3(0, 0, 1))));
  live.Advance(kNoLimit);
  EXPECT_EQ(live.pulls()[0].body, ball);
  ASSERT_FALSE(live.Handle(Set("friction", 0.5)));
  EXPECT_EQ(live.simulation().frozen_grasps().size(), 1u);
  EXPECT_EQ(live.simulation().place(2).mechanism, 0);
  ASSERT_FALSE(live.Handle(Set("detail", 1)));
  EXPECT_EQ(live.simulation().place(2).mechanism, 2);
  EXPECT_EQ(OnWire(live, "ball"), 6);
}

}  // namespace
}  // namespace fork1s::test
