// A folder of models, as a user asks for it.
#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(InspectFolder, HasARowForEveryModelAndGoesOnAfterABadOne) {
  const auto folder = ScratchFolder() / "robots";
  std::filesystem::create_directories(folder / "deeper");
  Write("robots/finger.xml", FingerModel());
  Write("robots/deeper/four.xml", R"(<mujoco><worldbody>
    <body name="a"><joint name="ja" stiffness="1"/><geom size=".01" pos=".1 0 0"/>
      <body name="b" pos=".2 0 0"><joint name="jb" stiffness="1"/><geom size=".01" pos=".1 0 0"/></body></body>
    </worldbody><equality><joint joint1="jb" joint2="ja"/></equality>
    <sensor><jointpos joint="ja"/><user name="own" dim="1"/></sensor></mujoco>)");
  Write("robots/bad.xml", "<mujoco><worldbody><body wobble=\"1\"/></worldbody></mujoco>");
  Write("robots/part.xml", "<mujocoinclude><default/></mujocoinclude>");
  Write("robots/notes.txt", "no model");
  const Outcome table = Fork1s("inspect " + folder.string() + " --time 0.1 --json");
  ASSERT_EQ(table.code, 0) << table.err;
  const auto rows = table.Json();
  ASSERT_EQ(rows.size(), 3u);  // parts and other files are no models
  EXPECT_EQ(rows[0]["file"], "bad.xml");
  EXPECT_FALSE(rows[0]["opens"].get<bool>());
  EXPECT_NE(rows[0]["error"].get<std::string>().find("wobble"), std::string::npos);
  EXPECT_EQ(rows[1]["file"], "deeper/four.xml");
  EXPECT_EQ(rows[1]["coordinates"], 2);
  EXPECT_EQ(rows[1]["reduced_coordinates"], 1);
  EXPECT_EQ(rows[1]["loops"], 1);
  EXPECT_EQ(rows[1]["dropped"][0], "sensor 'own'");
  EXPECT_EQ(rows[2]["ran"], "to the end");
  const Outcome text = Fork1s("inspect " + folder.string());
  ASSERT_EQ(text.code, 0);
  EXPECT_NE(text.out.find("2 of 3 open"), std::string::npos) << text.out;
}

TEST(InspectFolder, SaysWhereNothingIs) {
  const auto folder = ScratchFolder() / "empty";
  std::filesystem::create_directories(folder);
  const Outcome outcome = Fork1s("inspect " + folder.string());
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.err.find("no MJCF"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace fork1s::test
