// Linear values of the oracle cases: sizes, compliance, stiffness, frequencies, refusal.
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <oracle_cases.hpp>

namespace fork1s {
namespace {

using testing::json;

class Linear : public testing::OracleTest {};
INSTANTIATE_TEST_SUITE_P(Oracle, Linear, ::testing::ValuesIn(testing::kOracleCases), testing::OracleName);

/// The two computations behind the table agree to about 1e-12.
constexpr double kCompliance = 1e-8;
/// Frequencies of the table agree to 1e-12; the reductions' rank decisions and modes leave 1e-9.
constexpr double kFrequency = 1e-6;

TEST_P(Linear, SizesAndRefusal) {
  EXPECT_NEAR(mechanism_->total_mass(), expected_["mass_kg"].get<double>(), 1e-12 * mechanism_->total_mass());
  const int base = mechanism_->base() == BaseKind::kFloating ? 6 : 0;
  EXPECT_EQ(mechanism_->base() == BaseKind::kFloating, expected_["floating_base"].get<bool>());
  EXPECT_EQ(mechanism_->num_coordinates() + base, expected_["tree_dofs"].get<int>());
  ReductionOptions options;
  const auto model = Reduce(mechanism_, q0_, options);
  if (Refused()) {
    ASSERT_FALSE(model);
    EXPECT_EQ(model.error().code, ErrorCode::kUnderdetermined);
    bool named = false;
    for (const json& joint : expected_["refused"]["acceptable_joint_names"])
      named = named || model.error().where == "joint '" + joint.get<std::string>() + "'";
    EXPECT_TRUE(named) << model.error().Text();
    options.promote_hidden = true;
    const auto promoted = Reduce(mechanism_, q0_, options);
    ASSERT_TRUE(promoted) << promoted.error().Text();
    EXPECT_FALSE(promoted->promoted.empty());
    EXPECT_FALSE(promoted->warnings.empty());
    return;
  }
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_EQ(model->loop_rank(), expected_["loop_rank"].get<int>());
  EXPECT_EQ(mechanism_->num_coordinates() + base - model->loop_rank(), expected_["dofs"].get<int>());
}

TEST_P(Linear, Compliance) {
  if (Refused()) return;
  const char* key =
      expected_["compliance_world"].is_null() ? "compliance_world_base_held" : "compliance_world";
  const auto walk = WalkCompliance(*mechanism_, q0_, interfaces_);
  const auto dense = DenseCompliance(*mechanism_, q0_, interfaces_);
  if (!expected_.contains(key) || expected_[key].is_null()) {
    // A spring-free motion that an interface follows.
    EXPECT_GT(walk.free.cols(), 0);
    EXPECT_GT(dense.free.cols(), 0);
    return;
  }
  EXPECT_EQ(walk.free.cols(), 0);
  EXPECT_EQ(dense.free.cols(), 0);
  const MatrixX C = Mat(expected_[key]);
  const double largest = C.cwiseAbs().maxCoeff();
  EXPECT_LT((walk.C - C).cwiseAbs().maxCoeff(), kCompliance * largest);
  EXPECT_LT((dense.C - C).cwiseAbs().maxCoeff(), kCompliance * largest);
  const double L = mechanism_->length_scale();
  if (expected_.contains("compliance_rank") && expected_["compliance_rank"].is_number()) {
    EXPECT_EQ(walk.rank, expected_["compliance_rank"].get<int>());
    EXPECT_EQ(dense.rank, expected_["compliance_rank"].get<int>());
  }
  const MatrixX K = StiffnessFromCompliance(walk, L);
  if (expected_["stiffness_world"].is_null()) {
    EXPECT_EQ(K.size(), 0);
  } else {
    const MatrixX K_expected = Mat(expected_["stiffness_world"]);
    ASSERT_EQ(K.rows(), K_expected.rows());
    // Inverting amplifies by the condition of C in comparable units.
    EXPECT_LT((K - K_expected).cwiseAbs().maxCoeff(), kCompliance * K_expected.cwiseAbs().maxCoeff());
  }
}

void ExpectFrequencies(const std::vector<double>& actual, const json& expected) {
  ASSERT_GE(actual.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    EXPECT_NEAR(actual[i], expected[i].get<double>(), kFrequency * expected[i].get<double>())
        << "number " << i;
}

TEST_P(Linear, FullFrequencies) {
  if (Refused()) return;
  ExpectFrequencies(FullFrequencies(*mechanism_, q0_, 8), expected_["frequencies_hz"]["full"]);
}

TEST_P(Linear, ReducedFrequencies) {
  if (Refused()) return;
  for (const auto& [modes, key] : {std::pair{0, "interface_only"}, {4, "modes_4"}, {8, "modes_8"}}) {
    SCOPED_TRACE(key);
    ReductionOptions options;
    options.modes = modes;
    const auto model = Reduce(mechanism_, q0_, options);
    ASSERT_TRUE(model) << model.error().Text();
    EXPECT_EQ(model->num_modes, std::min(modes, expected_["fixed_interface_modes_available"].get<int>()));
    ExpectFrequencies(ReducedFrequencies(*model, 8), expected_["frequencies_hz"][key]);
  }
}

}  // namespace
}  // namespace fork1s
