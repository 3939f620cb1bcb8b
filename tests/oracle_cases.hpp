// Cases with expected numbers that lie beside the sources, each a model file and a table of values.
#pragma once

#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/kinematics.hpp>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace fork1s::testing {

using nlohmann::json;

inline const char* const kOracleCases[] = {
    "chain10_planar",   "chain90_spatial",         "firemen_trampoline", "fourbar_planar",
    "fourbar_spatial",  "hand3_fixed_wrist",       "hand5_all_tips",     "hand5_one_tip",
    "hexapod_floating", "overconstrained_fourbar", "refused_hand3",      "stewart_cubic",
    "two_link_arm"};

/// One case, loaded. Tests skip where the folder of cases is not there.
class OracleTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const auto folder = std::filesystem::path(FORK1S_SOURCE_DIR) / "../shared/oracle/dev";
    const std::string name = GetParam();
    if (!std::filesystem::exists(folder / (name + ".json")))
      GTEST_SKIP() << "the oracle case " << name << " is not beside the sources (../shared/oracle/dev)";
    std::ifstream(folder / (name + ".json")) >> expected_;
    auto loaded = LoadMechanism((folder / (name + ".xml")).string());
    ASSERT_TRUE(loaded) << loaded.error().Text();
    ASSERT_EQ(loaded->scene.mechanisms.size(), 1u);
    auto built = BuildMechanism(loaded->scene.mechanisms[0]);
    ASSERT_TRUE(built) << built.error().Text();
    mechanism_ = std::make_shared<const Mechanism>(std::move(*built));
    ASSERT_EQ(mechanism_->definition().interfaces, expected_["interfaces"].get<std::vector<std::string>>());
    for (const std::string& body : mechanism_->definition().interfaces)
      interfaces_.push_back(mechanism_->FindBody(body));
    q0_ = VectorX::Zero(mechanism_->num_coordinates());
  }

  bool Refused() const { return !expected_["refused"].is_null(); }
  const RigidTransform& X_WR() const { return mechanism_->definition().X_WR; }
  Vector3 InRoot(const json& v) const { return X_WR().rotation().transpose() * Vec3(v); }
  BodyIndex Body(const json& name) const { return mechanism_->FindBody(name.get<std::string>()); }

  static Vector3 Vec3(const json& v) { return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()}; }
  static MatrixX Mat(const json& v) {
    MatrixX m(static_cast<Eigen::Index>(v.size()), static_cast<Eigen::Index>(v.at(0).size()));
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index k = 0; k < m.cols(); ++k)
        m(i, k) = v[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)].get<double>();
    return m;
  }

  json expected_;
  std::shared_ptr<const Mechanism> mechanism_;
  std::vector<BodyIndex> interfaces_;
  VectorX q0_;
};

inline std::string OracleName(const ::testing::TestParamInfo<const char*>& info) { return info.param; }

}  // namespace fork1s::testing
