// Loading small models twice: by the importer and by MuJoCo itself.
#pragma once

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/mechanism/mechanism.hpp>

#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>

namespace fork1s::testing_importer {

/// Writes a file into a folder of this test and returns its path.
inline std::string WriteFile(const std::string& name, const std::string& text) {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string folder = std::string(info->test_suite_name()) + "_" + info->name();
  for (char& c : folder) {
    if (c == '/') c = '_';
  }
  const std::filesystem::path path =
      std::filesystem::path(::testing::TempDir()) / "fork1s_importer" / folder / name;
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
  return path.string();
}

inline ImportedScene MustLoad(const std::string& mjcf, const ImportOptions& options = {}) {
  auto loaded = LoadMechanismFromString(mjcf, "test.xml", options);
  if (!loaded) throw std::runtime_error(loaded.error().Text());
  return std::move(*loaded);
}

inline Error MustFail(const std::string& mjcf, const ImportOptions& options = {}) {
  auto loaded = LoadMechanismFromString(mjcf, "test.xml", options);
  if (loaded) throw std::runtime_error("the model loaded, but should not");
  return loaded.error();
}

inline Mechanism MustBuild(const MechanismDef& definition) {
  auto built = BuildMechanism(definition);
  if (!built) throw std::runtime_error(built.error().Text());
  return std::move(*built);
}

inline bool HasNote(const ImportReport& report, ImportNote::Kind kind, const std::string& part) {
  for (const ImportNote& note : report.notes) {
    if (note.kind == kind && (note.where + ": " + note.message).find(part) != std::string::npos) return true;
  }
  return false;
}

#define EXPECT_CONTAINS(text, part) \
  EXPECT_NE(std::string(text).find(part), std::string::npos) << "in: " << (text)

/// The same text in MuJoCo.
struct Peer {
  explicit Peer(const std::string& mjcf) {
    const std::string path = WriteFile("peer.xml", mjcf);
    char error[1000] = "";
    m.reset(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
    if (!m) throw std::runtime_error(error);
    d.reset(mj_makeData(m.get()));
  }
  RigidTransform Pose(const std::string& body) const {
    const int b = mj_name2id(m.get(), mjOBJ_BODY, body.c_str());
    const mjtNum *p = d->xpos + 3 * b, *q = d->xquat + 4 * b;
    return {Quaternion(q[0], q[1], q[2], q[3]), Vector3(p[0], p[1], p[2])};
  }
  std::string BodyOf(int dof) const { return mj_id2name(m.get(), mjOBJ_BODY, m->dof_bodyid[dof]); }
  int Dof(const std::string& joint) const {
    return m->jnt_dofadr[mj_name2id(m.get(), mjOBJ_JOINT, joint.c_str())];
  }

  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> m{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> d{nullptr, mj_deleteData};
};

inline double PoseDifference(const RigidTransform& a, const RigidTransform& b) {
  return Log(a.inverse() * b).norm();
}

}  // namespace fork1s::testing_importer
