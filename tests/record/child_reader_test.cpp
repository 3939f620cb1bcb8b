// What the reader in a child process is told.

#include "record/child_reader.hpp"
#include "record/scene_json.hpp"
#include "support.hpp"

namespace fork1s::testing {
namespace {

TEST(ImportOptionsJson, RoundTrip) {
  ImportOptions options;
  EXPECT_EQ(WriteImportOptions(*ReadImportOptions(WriteImportOptions(options), "none")),
            WriteImportOptions(options));
  options.interfaces = {"a", "b \xff"};
  options.base = BaseKind::kFloating;
  options.modes = 3;
  options.mode_choice = ModeChoice::kContribution;
  options.stiffness_scale = 1.0 / 3;
  options.pd = PdGains{0.1, 5e-324};
  options.joint_pd = {{"knee=1,2", {1, 2}}};
  options.keyframe = "open";
  options.base_pose =
      RigidTransform(Quaternion(0.5, 0.5, -0.5, 0.5).toRotationMatrix(), Vector3(0.1, 1.0 / 3, -2));
  options.joint_coordinates = {{"hip", -0.1}};
  options.keep_start = options.hold = options.ground = true;
  options.ground_height = 0.3;
  options.packages = {{"robot", "/a=b"}};
  options.switched = {"hook, with a comma"};
  const auto read = ReadImportOptions(WriteImportOptions(options), "all");
  ASSERT_TRUE(read) << read.error().Text();
  EXPECT_EQ(WriteImportOptions(*read), WriteImportOptions(options));
  EXPECT_EQ(read->interfaces, options.interfaces);
  EXPECT_EQ(read->switched, options.switched);
  EXPECT_EQ(read->base, BaseKind::kFloating);
  EXPECT_EQ(read->pd->kv, 5e-324);
  EXPECT_EQ(read->joint_pd.at("knee=1,2").kv, 2);
  EXPECT_EQ(read->base_pose->rotation(), options.base_pose->rotation());
  EXPECT_EQ(read->ground_height, 0.3);
  EXPECT_TRUE(read->hold);
}

TEST(ChildReader, ProgramsThatAreNoReaderAreNamed) {
  const auto read = [](const std::string& program) {
    return ReadInChild({.program = program}, "model.xml", {}, [] { return false; }).error();
  };
  const Error none = read("/no/such/program");
  EXPECT_EQ(none.code, ErrorCode::kModel);
  EXPECT_NE(none.Text().find("/no/such/program"), std::string::npos) << none.Text();
  EXPECT_NE(none.Text().find("install fork1s again"), std::string::npos) << none.Text();
  const Error other = read("/bin/false");
  EXPECT_NE(other.Text().find("exit code 1"), std::string::npos) << other.Text();
}

TEST(ChildReader, EndsWhereItIsStoppedOrTakesTooLong) {
  const Folder folder;
  const std::string waits = folder / "waits.sh";
  WriteBytes(waits, "#!/bin/sh\nexec sleep 60\n");
  std::filesystem::permissions(waits, std::filesystem::perms::owner_all);
  const auto stopped = ReadInChild({.program = waits}, "model.xml", {}, [] { return true; });
  EXPECT_EQ(stopped.error().Text(), "model.xml: was not read to its end");
  const auto late = ReadInChild({.program = waits, .max_time = 0.05}, "model.xml", {}, [] { return false; });
  EXPECT_NE(late.error().Text().find("not read within 0.05 s"), std::string::npos) << late.error().Text();
}

}  // namespace
}  // namespace fork1s::testing
