// The scene table: three simulators on one scene, and the page it goes into.
#include <lab/scene_table.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace fork1s {
namespace {

std::string Scratch(const std::string& name, const std::string& text) {
  const auto path = std::filesystem::path(::testing::TempDir()) / name;
  std::ofstream(path) << text;
  return path.string();
}
std::string ReadBack(const std::string& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(SceneTable, ThreeSimulatorsOnOneScene) {
  const auto rows = MeasureScene(FORK1S_SOURCE_DIR "/scenes", "two_link_arm", 0.5);
  ASSERT_TRUE(rows) << rows.error().Text();
  ASSERT_EQ(rows->size(), 4u);
  const SceneRow &reduced = (*rows)[0], &full = (*rows)[1], &mujoco = (*rows)[2], &discrete = (*rows)[3];
  EXPECT_EQ(reduced.simulator + full.simulator + mujoco.simulator, "reducedfullmujoco");
  EXPECT_EQ(discrete.simulator, "mujoco_discrete");
  EXPECT_NEAR(reduced.largest_stable_dt_s, 1.0 / 60, 1e-12);
  EXPECT_EQ(reduced.stable_stiff, std::optional(true));
  EXPECT_LT(reduced.rms_mm, 0.01);
  EXPECT_GT(full.coordinates, reduced.coordinates);
  EXPECT_DOUBLE_EQ(reduced.step_ratio, 1);
  for (const SceneRow& row : *rows) {
    EXPECT_NEAR(row.time_s, 0.5, 1e-9);
    EXPECT_GT(row.step_us, 0) << row.simulator;
  }
  const std::string csv = SceneTableCsv(*rows);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5);
  EXPECT_NE(SceneTableMarkdown(*rows).find("[two_link_arm](two_link_arm.md)"), std::string::npos);
  EXPECT_NE(ScenePageMarkdown(*rows).find("| MuJoCo |"), std::string::npos);
  EXPECT_NE(ScenePageMarkdown(*rows).find("| MuJoCo discrete |"), std::string::npos);
}

// A simulator that never was stable has no cost and no distance, and the table says from where on it might
// be.
TEST(SceneTable, WhatNeverWasStableHasNoFigures) {
  SceneRow row;
  row.scene = "s";
  row.simulator = "mujoco";
  const std::string page = ScenePageMarkdown({row});
  EXPECT_NE(page.find("| MuJoCo | 0 | < 1/"), std::string::npos) << page;
  EXPECT_NE(page.find("| - | - | - |"), std::string::npos) << page;
}

TEST(SceneTable, GoesBetweenItsMarkers) {
  const std::string page =
      Scratch("page.md", "before\n<!-- table: begin -->\nold\nolder\n<!-- table: end -->\nafter\n");
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(ReplaceTable(page, "new\n"));
  EXPECT_EQ(ReadBack(page), "before\n<!-- table: begin -->\nnew\n<!-- table: end -->\nafter\n");
}

TEST(SceneTable, PagesWithoutMarkersStayAsTheyAre) {
  const std::string page = Scratch("plain.md", "text\n");
  const auto done = ReplaceTable(page, "new\n");
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kFormat);
  EXPECT_EQ(ReadBack(page), "text\n");
  EXPECT_EQ(ReplaceTable(page + ".missing", "new\n").error().code, ErrorCode::kFile);
}

TEST(SceneTable, MissingScenesAreErrors) {
  EXPECT_FALSE(MeasureScene(FORK1S_SOURCE_DIR "/scenes", "no_such_scene", 0.1));
}

}  // namespace
}  // namespace fork1s
