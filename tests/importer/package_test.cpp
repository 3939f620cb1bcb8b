// Where package:// is looked for, and in which order.
#include <cstdlib>

#include "helpers.hpp"
#include "mesh_writers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

// Sets a variable of the environment and puts the old value back.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    setenv(name, value.c_str(), 1);
  }
  ~Variable() {
    if (old_) {
      setenv(name_, old_->c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
  std::optional<std::string> old_;
};

std::string FolderOf(const std::string& file) { return std::filesystem::path(file).parent_path().string(); }

// A tetrahedron whose size tells which of the files was taken.
std::string WriteSized(const std::string& file, double size) {
  return WriteFile(file, BinaryStl(CornerTetrahedron(size, size, size)));
}

double SizeOf(const Expected<ImportedScene>& loaded) {
  if (!loaded) throw std::runtime_error(loaded.error().Text());
  const auto& mesh = *std::get<MeshShape>(loaded->scene.mechanisms[0].bodies[1].geometries.at(0).shape).mesh;
  float most = 0;
  for (const auto& a : mesh.vertices)
    for (const auto& b : mesh.vertices) most = std::max(most, (a - b).norm());
  return most / std::sqrt(2.0);
}

class ImportPackages : public ::testing::Test {
 protected:
  ImportPackages() {
    // Files of an earlier run would be found.
    std::filesystem::remove_all(FolderOf(WriteFile("mark", "")));
    urdf_ = WriteFile("work/urdf/arm.urdf", Arm(MeshPart("collision", "package://robot/meshes/a.stl")));
  }
  std::string urdf_;
  ImportOptions options_;
  Variable ament_{"AMENT_PREFIX_PATH", ""}, ros_{"ROS_PACKAGE_PATH", ""};
};

constexpr double kSame = 1e-6;  // m; sizes pass through floats

TEST_F(ImportPackages, OptionThenAmentThenRosThenAbove) {
  // Each is put behind those that win over it, so that each step shows its own precedence.
  WriteSized("work/robot/meshes/a.stl", .1);
  EXPECT_NEAR(SizeOf(LoadMechanism(urdf_)), .1, kSame);
  const std::string ros = FolderOf(FolderOf(FolderOf(WriteSized("ros/robot/meshes/a.stl", .2))));
  setenv("ROS_PACKAGE_PATH", ("/no/such/folder:" + ros).c_str(), 1);
  EXPECT_NEAR(SizeOf(LoadMechanism(urdf_)), .2, kSame);
  const std::string ament =
      FolderOf(FolderOf(FolderOf(FolderOf(WriteSized("install/share/robot/meshes/a.stl", .3)))));
  setenv("AMENT_PREFIX_PATH", ("/no/such/prefix::" + ament).c_str(), 1);
  EXPECT_NEAR(SizeOf(LoadMechanism(urdf_)), .3, kSame);
  options_.packages["robot"] = FolderOf(FolderOf(WriteSized("mine/meshes/a.stl", .4)));
  EXPECT_NEAR(SizeOf(LoadMechanism(urdf_, options_)), .4, kSame);
}

TEST_F(ImportPackages, AnEntryMayBeThePackage) {
  const std::string by_name = FolderOf(FolderOf(WriteSized("a/robot/meshes/a.stl", .2)));
  setenv("ROS_PACKAGE_PATH", (by_name + "/").c_str(), 1);
  EXPECT_NEAR(SizeOf(LoadMechanism(urdf_)), .2, kSame);
  const std::string by_manifest = FolderOf(FolderOf(WriteSized("checkout_of_robot/meshes/a.stl", .3)));
  WriteFile("checkout_of_robot/package.xml", "<package format=\"2\"><name>robot</name></package>");
  setenv("ROS_PACKAGE_PATH", by_manifest.c_str(), 1);
  EXPECT_NEAR(SizeOf(LoadMechanism(urdf_)), .3, kSame);
}

TEST_F(ImportPackages, WhatIsMissingIsSaid) {
  const auto missing = LoadMechanism(urdf_);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kModel);
  EXPECT_CONTAINS(missing.error().message,
                  "package 'robot' was not found below AMENT_PREFIX_PATH and ROS_PACKAGE_PATH");
  EXPECT_CONTAINS(missing.error().message, "the option package, robot=DIR");
  // The user's folder is final, also where another would have the file.
  WriteSized("work/robot/meshes/a.stl", .1);
  options_.packages["robot"] = FolderOf(urdf_);
  const auto elsewhere = LoadMechanism(urdf_, options_);
  ASSERT_FALSE(elsewhere);
  EXPECT_CONTAINS(elsewhere.error().message, "where no file 'meshes/a.stl' is");
  options_.packages["robot"] = "/no/such/folder";
  const auto nowhere = LoadMechanism(urdf_, options_);
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::kUsage);
  EXPECT_CONTAINS(nowhere.error().Text(), "option package 'robot': there is no folder '/no/such/folder'");
}

TEST_F(ImportPackages, UnusedOnesAreSaid) {
  WriteSized("work/robot/meshes/a.stl", .1);
  options_.packages["robt"] = FolderOf(urdf_);
  const auto loaded = LoadMechanism(urdf_, options_);
  ASSERT_TRUE(loaded) << loaded.error().Text();
  EXPECT_TRUE(
      HasNote(loaded->report, ImportNote::Kind::kDropped, "'robt': no mesh of the file is of that package"));
  EXPECT_TRUE(HasNote(loaded->report, ImportNote::Kind::kDropped, "near names are 'robot'"));
  const Error mjcf = MustFail("<mujoco><worldbody/></mujoco>", options_);
  EXPECT_EQ(mjcf.code, ErrorCode::kUsage);
  EXPECT_CONTAINS(mjcf.message, "only URDF");
}

}  // namespace
}  // namespace fork1s::testing_importer
