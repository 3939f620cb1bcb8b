// Another model in the place of the one that viewers watch.
#include <nlohmann/json.hpp>

#include "support.hpp"

namespace fork1s::test {
namespace {

using nlohmann::json;

TEST(Replace, TellsViewersEverythingAnew) {
  LiveSimulation live = Live("hand.xml");
  live.Handle(Of(Command::Kind::kPause, true));
  live.Handle(Set("speed", 0.5));
  const Snapshot before = live.Capture(1);
  live.Replace(Live("hexapod.xml"));
  const Snapshot after = live.Capture(1);
  EXPECT_GT(after.geometry_version, before.geometry_version);
  EXPECT_GT(after.epoch, before.epoch);
  EXPECT_GT(after.settings_version, before.settings_version);
  EXPECT_GT(after.sequence, before.sequence);
  const json scene = json::parse(*after.scene);
  EXPECT_EQ(scene["title"], "hexapod.xml");
  EXPECT_EQ(scene["epoch"].get<std::uint32_t>(), after.epoch);
  EXPECT_EQ(scene["geometry"].get<std::uint32_t>(), after.geometry_version);
  EXPECT_EQ(json::parse(*after.geometry)["version"].get<std::uint32_t>(), after.geometry_version);
  EXPECT_NE(*after.geometry, *before.geometry);
  // What belongs to who watches stays.
  EXPECT_TRUE(live.paused());
  EXPECT_EQ(json::parse(*after.settings)["speed"], 0.5);
}

TEST(Replace, WhatIsWrongWithTheFileStaysUntilItIsGood) {
  LiveSimulation live = Live("hand.xml");
  EXPECT_EQ(live.Capture(1).problem_version, 0u);
  live.SetFileProblem("hand.xml:3: is wrong");
  const auto hash = live.simulation().HashState();
  const Snapshot bad = live.Capture(1);
  EXPECT_EQ(json::parse(*bad.problem)["message"], "hand.xml:3: is wrong");
  EXPECT_EQ(live.simulation().HashState(), hash);
  live.Replace(Live("hand.xml"));
  const Snapshot good = live.Capture(1);
  EXPECT_GT(good.problem_version, bad.problem_version);
  EXPECT_EQ(json::parse(*good.problem)["message"], "");
}

TEST(Replace, ARefusalSendsTheSlidersBack) {
  LiveSimulation live = Live("hand.xml");
  const Snapshot before = live.Capture(1);
  ASSERT_TRUE(live.Handle(Set("dt", 5)));
  const Snapshot after = live.Capture(1);
  EXPECT_GT(after.settings_version, before.settings_version);
  EXPECT_EQ(*after.settings, *before.settings);
}

}  // namespace
}  // namespace fork1s::test
