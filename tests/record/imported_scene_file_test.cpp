// What the reader of a model found, through a file.

#include "record/imported_scene_file.hpp"
#include "record/scene_json.hpp"
#include "support.hpp"

namespace fork1s::testing {
namespace {

ImportedScene Imported() {
  ImportedScene imported{SceneWithEverything(3), {}, 1, {}, {}, {}};
  imported.report.format = "URDF";
  imported.report.notes = {{ImportNote::Kind::kDropped, "sensor 's'", "left out"},
                           {ImportNote::Kind::kChanged, "joint \xff", "not UTF-8"},
                           {ImportNote::Kind::kChosen, "", ""}};
  imported.report.holds = {{"knee", "spring 2 N·m/rad"}};
  imported.report.servos = {{1, "grip", 0.1, 1.0 / 3, -2, 5e-324}};
  imported.joints = {{"hip", FileJoint::Kind::kBall, -1, 1, 2, 3, {1, 0, 0, 1.0 / 3}},
                     {"cube", FileJoint::Kind::kFree, 0, -1, 0, -1, {}}};
  imported.frames = {
      {"tip", FileFrame::Kind::kCamera, {{0, BodyIndex(1), -1}, RigidTransform(Vector3(1, 2, 1.0 / 3))}}};
  return imported;
}

TEST(ImportedSceneFile, KeepsSceneAndReport) {
  const Folder folder;
  const ImportedScene imported = Imported();
  ASSERT_TRUE(SaveImportedScene(imported, folder / "scene.h5"));
  const auto read = LoadImportedScene(folder / "scene.h5");
  ASSERT_TRUE(read) << read.error().Text();
  EXPECT_EQ(WriteImportedScene(*read).json, WriteImportedScene(imported).json);
  EXPECT_EQ(read->initial_keyframe, 1);
  ASSERT_EQ(read->report.notes.size(), 3u);
  EXPECT_EQ(read->report.notes[1].Text(), imported.report.notes[1].Text());
  EXPECT_EQ(read->report.servos[0].at_reference, 5e-324);
  ASSERT_EQ(read->frames.size(), 1u);
  EXPECT_EQ(read->frames[0].frame.X_BF.translation().z(), 1.0 / 3);
  ASSERT_EQ(read->joints.size(), 2u);
  EXPECT_EQ(read->joints[0].reference[3], 1.0 / 3);
  EXPECT_EQ(read->joints[1].kind, FileJoint::Kind::kFree);
}

TEST(ImportedSceneFile, DamagedFilesAreRefused) {
  const Folder folder;
  EXPECT_EQ(LoadImportedScene(folder / "none.h5").error().code, ErrorCode::kFile);
  ASSERT_TRUE(SaveImportedScene(Imported(), folder / "scene.h5"));
  const std::string whole = Bytes(folder / "scene.h5");
  for (const std::size_t size : {std::size_t{0}, std::size_t{7}, whole.size() / 2, whole.size() - 1}) {
    WriteBytes(folder / "cut.h5", whole.substr(0, size));
    EXPECT_FALSE(LoadImportedScene(folder / "cut.h5")) << size;
  }
  EXPECT_FALSE(SaveImportedScene(Imported(), folder / "no/such/folder.h5"));
}

}  // namespace
}  // namespace fork1s::testing
