// What recovery and chains cost. Times are asked to be there, not to be short.
#include <gtest/gtest.h>

#include <algorithm>
#include <lab/chain_cost.hpp>
#include <lab/recovery_cost.hpp>
#include <set>
#include <string>

namespace fork1s {
namespace {

TEST(RecoveryCost, OfChainsAndFourBarsBesideTheCeiling) {
  const auto rows = MeasureRecovery({100});
  ASSERT_TRUE(rows) << rows.error().Text();
  int of_twist = 0;
  std::set<std::string> modes;
  for (const RecoveryCost& row : *rows) {
    SCOPED_TRACE(row.mechanism + " " + row.mode);
    modes.insert(row.mechanism + " " + row.mode);
    EXPECT_GT(row.ns_per_body, 0);
    EXPECT_GE(row.coordinates, row.interfaces);
    if (row.mode != "twist") continue;
    ++of_twist;
    EXPECT_GT(row.percent_of_ceiling.value_or(0), 0);
  }
  EXPECT_GT(of_twist, 0);
  for (const char* mode :
       {"chain exact, arrays", "four-bars exact, arrays, 1024 states", "four-bars curved, arrays"})
    EXPECT_TRUE(modes.contains(mode)) << mode;
  const std::string csv = RecoveryCsv(*rows);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), static_cast<std::ptrdiff_t>(rows->size()) + 1);
}

TEST(ChainCost, GrowsWithTheJoints) {
  std::vector<ChainCost> rows;
  for (const int joints : {20, 200}) {
    const auto cost = MeasureChain(joints);
    ASSERT_TRUE(cost) << cost.error().Text();
    EXPECT_GT(cost->refresh_ms, 0);
    rows.push_back(*cost);
  }
  EXPECT_GT(rows[1].heap_MB, rows[0].heap_MB);
  const std::string csv = ChainsCsv(rows), plot = DrawChains(rows);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  EXPECT_NE(plot.find("a refresh"), std::string::npos);
}

}  // namespace
}  // namespace fork1s
