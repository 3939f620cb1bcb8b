// Every model file beside the checkout loads and builds, or is refused with a sentence.
#include <set>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> ModelFiles() {
  std::vector<std::string> files;
  const fs::path shared = fs::path(FORK1S_SOURCE_DIR) / ".." / "shared";
  for (const char* folder : {"oracle/dev", "models"}) {
    std::error_code missing;
    for (fs::recursive_directory_iterator it(shared / folder, missing), end; it != end;
         it.increment(missing)) {
      const std::string extension = it->path().extension().string();
      if (extension == ".xml" || extension == ".urdf")
        files.push_back(fs::relative(it->path(), shared).string());
    }
  }
  std::sort(files.begin(), files.end());
  if (files.empty()) files.push_back("missing");
  return files;
}

bool MustBeRefused(const std::string& file) {
  static const std::set<std::string> refused = {
      "models/mujoco_samples/hammock/hammock.xml",  // <composite> of old
      "models/urdf_malformed/hinge.urdf", "models/urdf_malformed/shadowhand_xmldecl_not_first.urdf"};
  return refused.count(file) > 0 || file.find("/orig/") != std::string::npos;
}

class ModelFile : public ::testing::TestWithParam<std::string> {};

TEST_P(ModelFile, LoadsOrSaysWhyNot) {
  if (GetParam() == "missing") GTEST_SKIP() << "the folder ../shared with models is not beside the sources";
  const auto loaded = LoadMechanism((fs::path(FORK1S_SOURCE_DIR) / ".." / "shared" / GetParam()).string());
  if (MustBeRefused(GetParam())) {
    ASSERT_FALSE(loaded);
    EXPECT_FALSE(loaded.error().where.empty());
    EXPECT_GT(loaded.error().message.size(), 30u) << loaded.error().Text();
    return;
  }
  ASSERT_TRUE(loaded) << loaded.error().Text();
  EXPECT_FALSE(loaded->scene.mechanisms.empty());
  for (const MechanismDef& mechanism : loaded->scene.mechanisms) {
    const auto built = BuildMechanism(mechanism);
    ASSERT_TRUE(built) << built.error().Text();
    EXPECT_FALSE(mechanism.interfaces.empty());
  }
}

// With the same compiler on both sides, mass and poses of MJCF models agree to the last digits.
TEST_P(ModelFile, AgreesWithMujoco) {
  if (GetParam() == "missing") GTEST_SKIP() << "the folder ../shared with models is not beside the sources";
  if (GetParam().find(".urdf") != std::string::npos || MustBeRefused(GetParam())) return;  // not MJCF
  const std::string path = (fs::path(FORK1S_SOURCE_DIR) / ".." / "shared" / GetParam()).string();
  const auto loaded = LoadMechanism(path);
  ASSERT_TRUE(loaded) << loaded.error().Text();
  char error[1000] = "";
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> m(
      mj_loadXML(path.c_str(), nullptr, error, sizeof error), mj_deleteModel);
  // For muscles, which are left out here, the reader seeks lengths that it does not find.
  if (!m && std::string(error).find("Lengthrange") != std::string::npos) return;
  ASSERT_TRUE(m) << error;
  std::unique_ptr<mjData, decltype(&mj_deleteData)> d(mj_makeData(m.get()), mj_deleteData);
  const auto keys = static_cast<int>(m->nkey);
  for (int key = -1; key < keys; ++key) {
    if (key >= 0) mj_resetDataKeyframe(m.get(), d.get(), key);
    mj_kinematics(m.get(), d.get());
    for (std::size_t i = 0; i < loaded->scene.mechanisms.size(); ++i) {
      const Mechanism mechanism = MustBuild(loaded->scene.mechanisms[i]);
      Kinematics kinematics(mechanism);
      KeyframeDef::MechanismState state;
      state.q = VectorX::Zero(mechanism.num_coordinates());
      state.X_WR = loaded->scene.mechanisms[i].X_WR;
      if (key >= 0) state = loaded->scene.keyframes[key].mechanisms[i];
      ComputeKinematics(mechanism, state.q, kinematics);
      for (std::size_t b = 0; b < mechanism.bodies().size(); ++b) {
        const int id = mj_name2id(m.get(), mjOBJ_BODY, mechanism.bodies()[b].name.c_str());
        if (id <= 0) continue;
        EXPECT_EQ(mechanism.bodies()[b].inertia_B.mass, m->body_mass[id]);
        const mjtNum *p = d->xpos + 3 * id, *q = d->xquat + 4 * id;
        const RigidTransform expected(Quaternion(q[0], q[1], q[2], q[3]), Vector3(p[0], p[1], p[2]));
        EXPECT_LT(PoseDifference(state.X_WR * kinematics.X_RB[b], expected), 1e-10)
            << mechanism.bodies()[b].name;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shared, ModelFile, ::testing::ValuesIn(ModelFiles()), [](const auto& test) {
  std::string name = test.param;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
});

}  // namespace
}  // namespace fork1s::testing_importer
