// The peer table: fork1s and MuJoCo's integrators against the converged full model.
#include <lab/peer_table.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace fork1s {
namespace {

TEST(PeerTable, EverySimulatorAgainstTheConvergedRun) {
  PeerOptions options;
  options.scene = "gripper";
  options.model_path = FORK1S_SOURCE_DIR "/scenes/fourbar_gripper.xml";
  // The jaws close a little and touch nothing.
  options.controls = {{"left_grip", "right_grip"}, {0, 0.2}, {{0, 0}, {0.05, 0.05}}};
  options.time = 0.2;
  options.dt = 1.0 / 240;
  options.truth_substeps = 16;
  options.entrants = PeerTableEntrants(16);
  options.rounds = 2;
  const auto rows = MeasurePeers(options);
  ASSERT_TRUE(rows) << rows.error().Text();
  std::string names;
  for (const PeerRow& row : *rows) names += row.simulator + ",";
  EXPECT_EQ(
      names,
      "fork1s,fork1s euler,MuJoCo Euler,MuJoCo implicitfast,MuJoCo discrete,MuJoCo discrete, tuned,full,"
      "full euler,"
      "fork1s,MuJoCo Euler,MuJoCo Euler, tuned,full,");
  for (const PeerRow& row : *rows) {
    EXPECT_EQ(row.scene, "gripper");
    EXPECT_NEAR(row.time_s, 0.2, 1e-12);
    EXPECT_EQ(row.survived, row.step_us > 0) << row.simulator;
    EXPECT_EQ(row.survived, row.end.empty()) << row.simulator;
  }
  const PeerRow &coarse = rows->front(), &euler = (*rows)[1], &full = (*rows)[6], &full_euler = (*rows)[7],
                &fine = (*rows)[8], &half = rows->back();
  EXPECT_DOUBLE_EQ(coarse.step_ratio, 1);
  EXPECT_NEAR(half.dt_s, 1.0 / 1920, 1e-12);
  // Steps of second order: against h/16, a run at h/8 is off by 1/85 of what a run at h is.
  EXPECT_LT(half.rms_mm, 0.1 * full.rms_mm);
  EXPECT_LT(full.rms_mm, 0.5 * full_euler.rms_mm);
  EXPECT_LT(coarse.rms_mm, 0.5 * euler.rms_mm);
  EXPECT_LT(fine.rms_mm, coarse.rms_mm);
  // Loops: solved by us, soft in MuJoCo.
  EXPECT_LT(coarse.loop_gap_mm, 1e-6);
  for (const PeerRow& row : *rows) {
    if (row.survived && row.simulator.starts_with("MuJoCo")) {
      EXPECT_GT(row.loop_gap_mm, 1e-6) << row.simulator;
    }
  }
  const std::string csv = PeerTableCsv(*rows);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 13);
}

TEST(PeerTable, SaysWhereARunEnded) {
  PeerRow row;
  row.scene = "s";
  row.simulator = "MuJoCo Euler";
  row.dt_s = 1.0 / 60;
  row.end = "became unstable at 0.5 s";
  const std::string table = PeerTableMarkdown({row});
  EXPECT_NE(table.find("| MuJoCo Euler | 1/60 | became unstable at 0.5 s | - | - | - |"), std::string::npos)
      << table;
  EXPECT_NE(PeerTableCsv({row}).find("\"MuJoCo Euler\",0.0166667,0,no,,,,,,"), std::string::npos);
}

TEST(PeerTable, RefusesWhatItCannotRun) {
  PeerOptions options;
  options.entrants = PeerTableEntrants();
  options.model_path = FORK1S_SOURCE_DIR "/scenes/no_such_scene.xml";
  EXPECT_FALSE(MeasurePeers(options));
  options.model_path = FORK1S_SOURCE_DIR "/scenes/two_link_arm.xml";
  options.controls.names = {"no such control"};
  options.controls.times = {0};
  options.controls.rows = {{0}};
  const auto unknown = MeasurePeers(options);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kModel);
}

}  // namespace
}  // namespace fork1s
