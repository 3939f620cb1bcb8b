// The oracle's cases by three methods, as on the validation page. The two largest take seconds and are left to
// it.
#include <gtest/gtest.h>

#include <filesystem>
#include <lab/oracle.hpp>

namespace fork1s {
namespace {

const char* const kFolder = FORK1S_SOURCE_DIR "/../shared/oracle/dev";

class Oracle : public ::testing::TestWithParam<const char*> {};

TEST_P(Oracle, IsReachedByEveryMethod) {
  if (!std::filesystem::exists(std::string(kFolder) + "/" + GetParam() + ".json"))
    GTEST_SKIP() << "the oracle case " << GetParam() << " is not beside the sources (../shared/oracle/dev)";
  const auto rows = CompareWithOracle(kFolder, GetParam());
  ASSERT_TRUE(rows) << rows.error().Text();
  ASSERT_FALSE(rows->empty());
  for (const OracleRow& row : *rows) {
    SCOPED_TRACE(row.quantity);
    // Frequencies and matrices are rounding; what a step brings to rest stops at 1e-11 m of motions that are
    // 1e-5 m in the smallest case, and the full method's compliances are differences over 3e-5.
    constexpr double kShare = 2e-6;
    for (const OracleDeviation* d : {&row.reduced, &row.full, &row.mujoco}) {
      EXPECT_LT(d->value.value_or(0), kShare);
      EXPECT_EQ(d->value.has_value(), d->why_not.empty());
    }
    EXPECT_TRUE(row.reduced.value);
  }
}

INSTANTIATE_TEST_SUITE_P(Case, Oracle,
                         ::testing::Values("chain10_planar", "fourbar_planar", "fourbar_spatial",
                                           "hand3_fixed_wrist", "hand5_one_tip", "hexapod_floating",
                                           "overconstrained_fourbar", "refused_hand3", "stewart_cubic",
                                           "two_link_arm"),
                         [](const auto& p) { return std::string(p.param); });

TEST(OracleFolder, ThatIsNotThereHasNoCases) { EXPECT_TRUE(OracleCases("/no such folder").empty()); }

}  // namespace
}  // namespace fork1s
