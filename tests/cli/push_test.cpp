// Pushes from outside, in a table and on the command line; what is not taken as it stands is said.
#include <cmath>
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

// A block of 2 kg that floats, 10 cm long in x: what a push does to it is known.
std::string Block() {
  return Write("block.xml",
               "<mujoco><option gravity='0 0 0'/><worldbody><body name='block'><freejoint/>"
               "<geom type='box' size='.05 .05 .05' mass='2'/></body></worldbody></mujoco>");
}

double X(const Outcome& o) { return o.Json()["free_bodies"][0]["position_m"][0].get<double>(); }

TEST(Push, AccelerateByForceOverMass) {
  // 4 N for 0.5 s give 2 kg a velocity of 1 m/s, and 0.25 m + 0.5 m by the end of the first second.
  const Outcome o = Fork1s("run --json --time 1 --dt 0.001 --push block:4,0,0:0..0.5 " + Block());
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_NEAR(X(o), 0.75, 1e-3);  // of first order in the step
}

TEST(Push, AWindowWithinAStepGivesItsImpulse) {
  // 4 N for 10 ms within a step of 1/60 s: 0.02 m/s, from a step's end on.
  const Outcome o = Fork1s("run --json --time 1 --push block:4,0,0:0.502..0.512 " + Block());
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_NEAR(X(o), 0.02 * 0.5, 0.02 / 60);
}

TEST(Push, AtAPointItTurns) {
  const Outcome middle = Fork1s("run --json --time 0.2 --push block:0,0,1 " + Block());
  const Outcome corner = Fork1s("run --json --time 0.2 --push block:0,0,1@0.05,0,0 " + Block());
  ASSERT_EQ(corner.code, 0) << corner.err;
  EXPECT_NEAR(middle.Json()["free_bodies"][0]["quaternion_wxyz"][2].get<double>(), 0, 1e-12);
  // Moment 0.05 N m about -y on an inertia of m a²/6 = 2 * 0.01 / 6 kg m²: 15 rad/s², 0.3 rad after 0.2 s.
  EXPECT_NEAR(2 * std::asin(corner.Json()["free_bodies"][0]["quaternion_wxyz"][2].get<double>()), -0.3, 0.03);
}

TEST(Push, TableAndOptionAgree) {
  const std::string table = Write(
      "push.csv", "time,force:block:x,\"force:block@0.05,0,0:z\",torque:block:y\n0,4,1,0.05\n1,4,1,0.05\n");
  const Outcome by_table = Fork1s("run --json --time 0.5 --controls " + table + " " + Block());
  ASSERT_EQ(by_table.code, 0) << by_table.err;
  const Outcome by_option =
      Fork1s("run --json --time 0.5 --push block:4,0,0,0,0.05,0 --push block:0,0,1@0.05,0,0 " + Block());
  EXPECT_EQ(by_table.Json()["free_bodies"], by_option.Json()["free_bodies"]);
  EXPECT_GT(X(by_table), 0.2);
}

TEST(Push, IsRecordedAndReplays) {
  const std::string model = Write("finger.xml", FingerModel()), file = (ScratchFolder() / "push.h5").string();
  const Outcome still = Fork1s("run --json --time 1 " + model);
  const Outcome pushed =
      Fork1s("run --json --time 1 --push tip:0,0,0.2:0.2..0.8 --record " + file + " " + model);
  ASSERT_EQ(pushed.code, 0) << pushed.err;
  EXPECT_NE(still.Json()["interface"], pushed.Json()["interface"]);
  const Outcome replay = Fork1s("replay --json " + file);
  EXPECT_EQ(replay.code, 0) << replay.err;
  EXPECT_TRUE(replay.Json()["identical"].get<bool>());
}

TEST(Push, RefusalsNameWhatIsWrong) {
  const std::string model = Block();
  const struct {
    const char* text;
    const char* says;
  } cases[] = {{"block", "':'"},
               {"block:1,2", "three or six"},
               {"block:1,2,x", "three or six"},
               {"nobody:1,0,0", "block"},
               {"block:1,0,0:2..1", "begins"},
               {"block:1,0,0:a..b", "span of time"},
               {"block:inf,0,0", "three or six"}};
  for (const auto& c : cases) {
    const Outcome o = Fork1s(std::string("run --time 0.1 --push ") + c.text + " " + model);
    EXPECT_EQ(o.code, 2) << c.text << o.err;
    EXPECT_NE(o.err.find("--push"), std::string::npos) << o.err;
    EXPECT_NE(o.err.find(c.says), std::string::npos) << o.err;
  }
  for (const char* column : {"force:block", "force:block:w", "torque::x", "force:nobody:x"}) {
    const std::string table = Write("bad.csv", std::string("time,") + column + "\n0,1\n");
    const Outcome o = Fork1s("run --time 0.1 --controls " + table + " " + model);
    EXPECT_EQ(o.code, 3) << column << o.err;
    EXPECT_NE(o.err.find("bad.csv"), std::string::npos) << o.err;
  }
}

TEST(Push, CompareTakesThemToo) {
  const std::string model = Block();
  for (const char* against : {"full", "mujoco"}) {
    const Outcome o = Fork1s(std::string("compare --json --time 0.5 --dt 0.002 --refinements 0 --against ") +
                             against + " --push block:4,0,1@0.05,0,0:0..0.3 " + model);
    ASSERT_EQ(o.code, 0) << o.err;
    // The block moves by 0.2 m and turns; without the push on one side they would be that far apart.
    EXPECT_LT(o.Json()["free_bodies"][0]["max_mm"].get<double>(), 2) << against;
    EXPECT_LT(o.Json()["free_bodies"][0]["max_deg"].get<double>(), 2) << against;
  }
}

TEST(Clamps, AreSaid) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string table = Write("far.csv", "time,bend\n0,0\n0.5,1.8\n3,0\n");
  const Outcome o = Fork1s("run --time 1 --controls " + table + " --push tip:0,0,1:2..3 " + model);
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_NE(o.err.find("'bend' for 1.8 at 0.5 s"), std::string::npos) << o.err;
  EXPECT_NE(o.err.find("held at 1"), std::string::npos) << o.err;
  EXPECT_NE(o.err.find("goes on to 3 s"), std::string::npos) << o.err;
  EXPECT_NE(o.err.find("does nothing"), std::string::npos) << o.err;
  const auto warnings = Fork1s("run --json --time 1 --controls " + table + " " + model).Json()["warnings"];
  EXPECT_NE(warnings.dump().find("held at 1"), std::string::npos);
  // A comparison clamps the same on both sides, and says so.
  const Outcome compared = Fork1s("compare --json --time 1 --refinements 0 --controls " + table +
                                  " --push tip:0,0,1:0.5..3 " + model);
  ASSERT_EQ(compared.code, 0) << compared.err;
  const std::string said = compared.Json()["warnings"].dump();
  EXPECT_NE(said.find("held at 1"), std::string::npos) << said;
  EXPECT_NE(said.find("far.csv goes on to 3 s"), std::string::npos) << said;
  EXPECT_NE(said.find("0.5..3 goes on to 3 s"), std::string::npos) << said;
  const std::string short_run = Fork1s("run --time 1 --dt 0.7 " + model).err;
  EXPECT_NE(short_run.find("0.7 s are simulated"), std::string::npos) << short_run;
  // What is within range and time is no news.
  const std::string fine = Write("fine.csv", "time,bend\n0,0\n1,0.9\n");
  EXPECT_EQ(Fork1s("run --time 1 --controls " + fine + " " + model).err.find("warning"), std::string::npos);
}

}  // namespace
}  // namespace fork1s::test
