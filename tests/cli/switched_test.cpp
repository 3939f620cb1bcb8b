// Equalities that a control switches, from the command line.
#include <cmath>
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

// A crate of 3 kg under the tip of a mast; the weld is on in the file.
std::string Crane(const std::string& custom = "") {
  return Write(custom.empty() ? "crane.xml" : "crane_custom.xml",
               "<mujoco><custom>" + custom + R"(</custom><worldbody><body name="mast" pos="0 0 2">
  <joint name="swing" axis="0 1 0" stiffness="1e6" damping="5e4"/>
  <geom type="capsule" fromto="0 0 0 1 0 0" size="0.03" mass="5" contype="0" conaffinity="0"/></body>
  <body name="crate" pos="1 0 1.5"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="3"/></body></worldbody>
  <equality><weld name="hook" body1="mast" body2="crate"/></equality></mujoco>)");
}

TEST(Switched, EqualityThatStartsOn_IsReleasedByAControlTable) {
  const std::string table = Write("release.csv", "time,hook\n0,1\n0.5,1\n0.5001,0\n"),
                    options = "run --json --dt 0.005 --controls " + table + " --time ";
  const auto height = [](const nlohmann::json& run) {
    for (const auto& body : run["free_bodies"])
      if (body["body"] == "crate") return body["position_m"][2].get<double>();
    throw std::runtime_error("no crate: " + run.dump());
  };
  const std::string named = Crane("<text name=\"fork1s_switched\" data=\"hook\"/>");
  const Outcome held = Fork1s(options + "0.5 --switched hook " + Crane()),
                fallen = Fork1s(options + "0.75 --switched hook " + Crane()),
                by_file = Fork1s(options + "0.75 " + named);
  for (const Outcome* o : {&held, &fallen, &by_file}) ASSERT_EQ(o->code, 0) << o->err;
  // The mast turns by (5 kg 0.5 m + 3 kg 1 m) g / 1e6 N m = 5.4e-5 rad, of which 1 % is left to move after 0.5 s.
  EXPECT_NEAR(height(held.Json()), 1.5 - 5.4e-5, 1e-5);
  EXPECT_NEAR(height(held.Json()) - height(fallen.Json()), 0.5 * 9.81 * 0.25 * 0.25, 1e-5);
  EXPECT_EQ(height(by_file.Json()), height(fallen.Json()));
  // Without a word it is a closure, and no control has its name.
  const Outcome closed = Fork1s(options + "0.5 " + Crane());
  EXPECT_EQ(closed.code, 3);
  EXPECT_NE(closed.err.find("hook"), std::string::npos) << closed.err;
  const Outcome wrong = Fork1s(options + "0.5 --switched hock " + Crane());
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("--switched"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("near names are 'hook'"), std::string::npos) << wrong.err;
}

}  // namespace
}  // namespace fork1s::test
