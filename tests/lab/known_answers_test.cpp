// Every known answer of the validation page, by both methods.
#include <gtest/gtest.h>

#include <lab/known_answers.hpp>

namespace fork1s {
namespace {

class KnownAnswers : public ::testing::TestWithParam<KnownAnswerCase> {};

TEST_P(KnownAnswers, AreReached) {
  const auto rows = GetParam().run(Refinement::kCoarse);
  ASSERT_TRUE(rows) << rows.error().Text();
  ASSERT_FALSE(rows->empty());
  for (const KnownAnswer& row : *rows) {
    EXPECT_TRUE(row.Holds()) << row.quantity << ", " << row.method << ": " << row.measured << " " << row.unit
                             << " instead of " << row.expected << " within " << row.tolerance << " ("
                             << row.why_tolerance << ")";
    EXPECT_FALSE(row.why_tolerance.empty()) << row.quantity;
    EXPECT_FALSE(row.source.empty()) << row.quantity;
  }
}

INSTANTIATE_TEST_SUITE_P(Case, KnownAnswers,
                         ::testing::ValuesIn(KnownAnswerCases().begin(), KnownAnswerCases().end()),
                         [](const auto& p) { return std::string(p.param.name); });

}  // namespace
}  // namespace fork1s
