// fork1s bench: what it measures and where it writes it. Times are asked to be there, not to be short.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(Bench, ASceneBesideMuJoCoAndTheConvergedRun) {
  const Outcome o = Fork1s("bench " + Write("bench_finger.xml", FingerModel()) +
                               " --json --time 0.1 --rounds 2 --truth 64 --only scenes,precision",
                           "PATH=/nowhere");
  ASSERT_EQ(o.code, 0) << o.err;
  const auto scene = o.Json()["scenes"]["bench_finger"];
  EXPECT_GT(scene["step_us"], 0) << scene.dump(1);
  EXPECT_GE(scene["p99_us"], 0.1 * scene["step_us"].get<double>());
  EXPECT_GE(scene["worst_us"], scene["p99_us"]);
  EXPECT_NEAR(scene["simulated_s"].get<double>(), 0.1, 1e-9);
  // The finger and the ball fall: the step's error is some hundredths of a percent, the truth's far less.
  const double error = scene["error_percent"];
  EXPECT_GT(error, 0.01);
  EXPECT_LT(error, 1);
  EXPECT_LT(scene["truth_error_percent"], 0.3 * error);
  for (const char* peer : {"MuJoCo discrete", "MuJoCo implicitfast", "full", "full euler"}) {
    const auto row = scene["peers"][peer];
    EXPECT_GT(row["step_us"], 0) << peer;
    EXPECT_GT(row["ratio"], 0) << peer;
    // Of second order as ours, or of first.
    EXPECT_GT(row["error_percent"], peer == std::string("full") ? 0.01 : 0.1) << peer;
  }
  EXPECT_EQ(scene["integrator"], "two-stage");
  const auto euler = scene["peers"]["fork1s euler"];
  ASSERT_TRUE(euler.is_object()) << scene["peers"].dump(1);
  EXPECT_GT(euler["step_us"], 0);
  EXPECT_GT(euler["error_percent"], error);
  // Steps of second order: half the step, about a quarter of the error.
  double half = 0;
  for (const auto& point : scene["precision"])
    if (point["simulator"] == "fork1s" && point["dt_s"] < 0.01 && half == 0) half = point["error_percent"];
  EXPECT_GT(half, 0.1 * error);
  EXPECT_LT(half, 0.4 * error);
  // Without valgrind there are no instructions, and a sentence says why.
  EXPECT_TRUE(scene["step_instructions"].is_null());
  EXPECT_NE(scene["why_no_instructions"].get<std::string>().find("valgrind"), std::string::npos);
}

// A model that is named: its own table and nothing else, errors in millimetres too, and what moves it is
// said.
TEST(Bench, AModelAloneIsAnsweredWithItsTable) {
  const std::string model = Write("bench_alone.xml", FingerModel());
  const std::string options = " --time 0.1 --rounds 1 --truth 2 --peers none";
  const Outcome o = Fork1s("bench " + model + options, "PATH=/nowhere");
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_EQ(o.out.find("bench_alone, 0.1 s"), 0u) << o.out;
  EXPECT_NE(o.out.find("error, mm"), std::string::npos) << o.out;
  for (const char* part : {"largest stable step", "many at a time"})
    EXPECT_EQ(o.out.find(part), std::string::npos) << o.out;
  EXPECT_NE(o.err.find("bench_alone.csv'"), std::string::npos) << o.err;
  const auto scene =
      Fork1s("bench " + model + options + " --json", "PATH=/nowhere").Json()["scenes"]["bench_alone"];
  EXPECT_TRUE(scene["controls"].is_null());
  EXPECT_GT(scene["rms_mm"].get<double>(), 0);
  const std::string table = Write("bench_alone.csv", "time,bend\n0,0\n0.1,0.2\n");
  const Outcome moved = Fork1s("bench " + model + options + " --json", "PATH=/nowhere");
  EXPECT_EQ(moved.Json()["scenes"]["bench_alone"]["controls"], table);
  EXPECT_EQ(moved.err.find("no controls"), std::string::npos) << moved.err;
}

TEST(Bench, CountsInstructionsByPart) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "valgrind runs no program with a sanitizer";
#endif
  if (Shell("command -v valgrind").code != 0) GTEST_SKIP() << "valgrind is not installed";
  const Outcome o = Fork1s(
      "bench two_link_arm --json --time 0.05 --rounds 1 --truth 2 --peers none --phases "
      "--only scenes");
  ASSERT_EQ(o.code, 0) << o.err;
  const auto scene = o.Json()["scenes"]["two_link_arm"];
  ASSERT_TRUE(scene["step_instructions"].is_number()) << scene.dump(1);
  const double all = scene["step_instructions"];
  EXPECT_GT(all, 1e3);
  EXPECT_LT(all, 1e5);
  double sum = 0;
  for (const auto& part : scene["phases"]) {
    EXPECT_GE(part, 0) << scene["phases"].dump(1);
    sum += part.get<double>();
  }
  EXPECT_NEAR(sum, all, 1e-6 * all);
  EXPECT_GT(scene["phases"]["free velocities"], 0.01 * all);  // of two coordinates
  EXPECT_GT(scene["phases"]["moving, poses, loops"], 0.05 * all);
  double us = 0;
  for (const auto& part : scene["phase_us"]) us += part["mean"].get<double>();
  EXPECT_GT(us, 0);
  EXPECT_EQ(scene["phase_us"].size(), scene["phases"].size());
  EXPECT_TRUE(scene["error_percent"].is_null());  // it stands still
  EXPECT_EQ(scene["peers"].size(), 3u);           // the full model by both integrators, and ours by the other
}

TEST(Bench, ManyAndItsFiles) {
  const auto folder = ScratchFolder() / "bench_out";
  const Outcome o = Fork1s("bench two_link_arm --json --only many --time 0.1 --out " + folder.string());
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_EQ(o.Json()["many"].size(), 2u);
  for (const char* name : {"bench_many.csv", "bench.html"})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
  EXPECT_NE(Slurp(folder / "bench.html").find("Many at a time"), std::string::npos);
  // Written again over itself.
  EXPECT_EQ(Fork1s("bench two_link_arm --only many --time 0.1 --out " + folder.string()).code, 0);
}

// Simulators that share no code: a step of springs by backward Euler has one answer. Only where tools/peers.sh
// was run.
TEST(Bench, DrakeDartAndBulletComeToTheSame) {
  const std::string source = FORK1S_SOURCE_DIR, python = source + "/build/peers/bin/python";
  if (!std::filesystem::exists(python)) GTEST_SKIP() << "tools/peers.sh was not run";
  const auto chain = (ScratchFolder() / "chain4.xml").string();
  ASSERT_EQ(Shell(python + " " + source + "/benchmarks/peers/chain.py 4 1 0.01 > " + chain).code, 0);
  const std::string way = " --json --rounds 1 --only scenes --peers drake,dart,bullet ";
  const Outcome o = Fork1s("bench " + chain + way + "--time 0.2", "PATH=/nowhere");
  ASSERT_EQ(o.code, 0) << o.err;
  const auto scene = o.Json()["scenes"]["chain4"];
  const auto error = [&](const char* peer) { return scene["peers"][peer]["error_percent"]; };
  for (const char* peer : {"Drake SAP", "DART"}) {
    ASSERT_TRUE(error(peer).is_number()) << scene["peers"].dump(1);
    EXPECT_NEAR(error(peer).get<double>() / error("fork1s euler").get<double>(), 1, 0.05) << peer;
  }
  // Bullet takes springs at the start of a step, and needs short ones.
  const Outcome fine = Fork1s("bench " + chain + way + "--time 0.05 --dt 1e-4 --truth 2", "PATH=/nowhere");
  ASSERT_EQ(fine.code, 0) << fine.err;
  const auto bullet = fine.Json()["scenes"]["chain4"]["peers"]["Bullet"];
  ASSERT_TRUE(bullet["error_percent"].is_number()) << bullet.dump(1);
  EXPECT_LT(bullet["error_percent"], 1) << bullet.dump(1);
}

TEST(Bench, RefusesWhatItCannotMeasure) {
  const Outcome unknown = Fork1s("bench no_such_scene");
  EXPECT_EQ(unknown.code, 3);
  EXPECT_NE(unknown.err.find("no_such_scene"), std::string::npos) << unknown.err;
  EXPECT_EQ(Fork1s("bench two_link_arm --truth 3").code, 2);
  EXPECT_EQ(Fork1s("bench two_link_arm --peers nobody").code, 2);
  EXPECT_EQ(Fork1s("bench two_link_arm --only chains").code, 2);
  const Outcome no_folder = Fork1s("bench two_link_arm --only scenes --out " + Write("a_file", "x"));
  EXPECT_EQ(no_folder.code, 3);
  EXPECT_NE(no_folder.err.find("give another to --out"), std::string::npos) << no_folder.err;
  const Outcome long_run = Fork1s("bench two_link_arm --only scenes --time 10000 --dt 1e-9");
  EXPECT_EQ(long_run.code, 2);
  EXPECT_NE(long_run.err.find("a million at most"), std::string::npos) << long_run.err;
}

}  // namespace
}  // namespace fork1s::test
