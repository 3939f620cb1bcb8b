// Nonlinear equilibria of the oracle cases.
#include <fork1s/reduction/statics.hpp>
#include <oracle_cases.hpp>

namespace fork1s {
namespace {

using testing::json;

class Statics : public testing::OracleTest {
 protected:
  // The table's two computations agree to 1e-12; Newton stops at 1e-11 of the largest force.
  static constexpr double kPose = 1e-8;  // m and rad

  void ExpectPose(const Kinematics& kinematics, BodyIndex b, const json& expected) const {
    const RigidTransform X = X_WR() * kinematics.X_RB[b.u()];
    const Matrix3 R_ref = (X_WR() * mechanism_->body(b).X_RB0).rotation();
    EXPECT_LT((X.translation() - Vec3(expected["position_m"])).norm(), kPose) << mechanism_->body(b).name;
    // Compared as rotations, since a vector of half a turn has two signs.
    const Matrix3 R = ExpRotation(Vec3(expected["rotation_vector_rad"])) * R_ref;
    EXPECT_LT(LogRotation(R.transpose() * X.rotation()).norm(), kPose) << mechanism_->body(b).name;
  }
};
INSTANTIATE_TEST_SUITE_P(Oracle, Statics, ::testing::ValuesIn(testing::kOracleCases), testing::OracleName);

TEST_P(Statics, EndLoads) {
  if (Refused()) return;
  ASSERT_FALSE(expected_["statics"].empty());
  for (const json& load : expected_["statics"]) {
    SCOPED_TRACE(load["force_N"].dump());
    const BodyIndex body = Body(load["body"]);
    const auto result = SolveStatics(*mechanism_, q0_, {{body, InRoot(load["force_N"])}});
    ASSERT_TRUE(result.converged) << result.residual;
    EXPECT_EQ(result.tangent.IsStable(), load["stable"].get<bool>());
    Kinematics kinematics(*mechanism_);
    ComputeKinematics(*mechanism_, result.q, kinematics);
    ExpectPose(kinematics, body, load);
    EXPECT_LT(ClosureGap(*mechanism_, kinematics, result.q), 1e-11);
    const double turn = MaxJointRotation(*mechanism_, q0_, result.q) * 180 / M_PI;
    EXPECT_NEAR(turn, load["max_joint_rotation_deg"].get<double>(), 1e-6);
  }
}

TEST_P(Statics, Gravity) {
  if (Refused()) return;
  const json& expected = expected_["gravity_static"];
  if (expected.is_null()) GTEST_SKIP() << "the case has no equilibrium under gravity";
  StaticsOptions options;
  options.gravity_R = InRoot(expected["gravity_m_per_s2"]);
  const auto result = SolveStatics(*mechanism_, q0_, {}, options);
  ASSERT_TRUE(result.converged) << result.residual;
  EXPECT_TRUE(result.tangent.IsStable());
  Kinematics kinematics(*mechanism_);
  ComputeKinematics(*mechanism_, result.q, kinematics);
  for (const auto& [name, pose] : expected["interfaces"].items()) ExpectPose(kinematics, Body(name), pose);
  const double turn = MaxJointRotation(*mechanism_, q0_, result.q) * 180 / M_PI;
  EXPECT_NEAR(turn, expected["max_joint_rotation_deg"].get<double>(), 1e-6);
}

}  // namespace
}  // namespace fork1s
