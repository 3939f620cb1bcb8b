// Simulators outside: which scenes they get, and what becomes of one that fails.
#include "study/bench.hpp"

#include <gtest/gtest.h>

#include <fork1s/importer/importer.hpp>

namespace fork1s {
namespace {

std::string WhyNot(const std::string& scene) {
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/" + scene + ".xml");
  return imported ? WhyNoPlainTree(imported->scene) : imported.error().Text();
}

TEST(Bench, PeersOutsideGetPlainTreesAlone) {
  EXPECT_EQ(WhyNot("two_link_arm"), "");
  EXPECT_EQ(WhyNot("hand"), "it is not one mechanism alone");
  EXPECT_NE(WhyNot("hexapod"), "");
  EXPECT_NE(WhyNot("firemen"), "");
}

TEST(Bench, APeerThatFailsSaysWhyInItsRow) {
  BenchOptions options;
  options.name = "arm";
  options.model_path = FORK1S_SOURCE_DIR "/scenes/two_link_arm.xml";
  options.time = 0.05;
  options.rounds = 1;
  options.truth_substeps = 2;
  options.substeps = {1};
  options.mujoco = false;
  options.outside = {
      {"missing", {}, "is not installed"},
      {"failing", {"/bin/sh", "-c", "echo oh >&2; exit 3"}, ""},
      {"silent", {"/bin/true"}, ""},
      {"honest", {"/bin/sh", "-c", R"(printf '{"error": "has no springs"}')"}, ""},
      {"short", {"/bin/sh", "-c", R"(printf '{"step_s": [1], "positions": [[[0,0,0]]]}')"}, ""}};
  const auto scene = MeasureBench(options);
  ASSERT_TRUE(scene) << scene.error().Text();
  const auto end = [&](const char* peer) {
    const PeerRow* row = scene->At(peer);
    return row ? row->end : "no row";
  };
  EXPECT_EQ(end("missing"), "is not installed");
  EXPECT_EQ(end("failing"), "ended with exit code 3: oh");
  EXPECT_EQ(end("silent"), "gave no answer");
  EXPECT_EQ(end("honest"), "has no springs");
  EXPECT_EQ(end("short"), "gave another number of steps than asked for");
  EXPECT_EQ(end("fork1s"), "");
  ASSERT_NE(scene->At("full"), nullptr);
  EXPECT_TRUE(scene->At("full")->survived);
}

}  // namespace
}  // namespace fork1s
