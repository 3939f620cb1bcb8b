// Gaps of the twist recovery in the oracle cases.
#include <fork1s/recovery/recover.hpp>
#include <fork1s/reduction/statics.hpp>
#include <oracle_cases.hpp>

namespace fork1s {
namespace {

using testing::json;

class Gaps : public testing::OracleTest {};
INSTANTIATE_TEST_SUITE_P(Oracle, Gaps, ::testing::ValuesIn(testing::kOracleCases), testing::OracleName);

TEST_P(Gaps, TwistRecovery) {
  if (Refused() || expected_["twist_recovery_gap_percent"].is_null()) return;
  const json& load = expected_["twist_recovery_load"];
  const auto linear =
      LinearDeflection(*mechanism_, q0_, {{Body(load["body"]), InRoot(load["force_direction"])}});
  ASSERT_TRUE(linear) << linear.error().Text();
  // Turns of hinges and balls, both to first order.
  double largest = 0;
  for (const auto& joint : mechanism_->joints())
    if (joint.kind == JointKind::kHinge || joint.kind == JointKind::kBall)
      largest = std::max(largest, linear->segment(joint.offset, joint.size).norm());
  ASSERT_GT(largest, 0);
  Kinematics kinematics(*mechanism_);
  ComputeKinematics(*mechanism_, q0_, kinematics);
  for (const json& row : expected_["twist_recovery_gap_percent"]) {
    SCOPED_TRACE(row["deflection_deg"].get<double>());
    const VectorX q = *linear * (row["deflection_deg"].get<double>() * M_PI / 180 / largest);
    std::vector<RigidTransform> X_RB;
    for (int b = 0; b < mechanism_->num_bodies(); ++b)
      X_RB.push_back(Exp(BodyJacobian(*mechanism_, kinematics, BodyIndex(b)) * q) *
                     kinematics.X_RB[static_cast<std::size_t>(b)]);
    const auto gaps = MeasureJointGaps(*mechanism_, X_RB);
    ASSERT_FALSE(gaps.empty());
    const double percent = 100 * gaps.front().gap / expected_["mean_link_length_m"].get<double>();
    // Within one per cent of the value: the anchors of universal joints may be chosen apart.
    EXPECT_NEAR(percent, row["gap"].get<double>(), 0.01 * row["gap"].get<double>())
        << gaps.front().name << " instead of " << row["at"];
  }
}

}  // namespace
}  // namespace fork1s
