// The HTML page: whole, on its own, and legible in light and dark.
#include <gtest/gtest.h>

#include <unistd.h>
#include <cmath>
#include <filesystem>
#include <fork1s/study/compare.hpp>
#include <fstream>
#include <sstream>

namespace fork1s {
namespace {

Comparison Example() {
  Comparison c;
  c.scene = "a <scene> & more";
  c.other = "full";
  c.dt_s = c.other_dt_s = 0.01;
  c.time_s = 1;
  c.interface = {{"tip", 0.1, 0.2, 0.3, 0.4}};
  ComparedTrace trace;
  trace.body = "tip";
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.01 * i;
    c.times_s.push_back(t);
    trace.reduced_m.emplace_back(0.1 * std::sin(6 * t), 0, 0);
    trace.other_m.emplace_back(0.101 * std::sin(6 * t), 0, 0);
    trace.force_reduced_N.emplace_back(0, 0, i > 50 ? 2 : 0);
    trace.force_other_N.emplace_back(0, 0, i > 50 ? 2.1 : 0);
    c.gap_reduced_mm.push_back(1e-12 * (i + 1));
    c.gap_other_mm.push_back(0);
  }
  c.traces = {trace};
  c.costs = {{"reduced", 0.01, 1e-3, 0.5, 1}, {"full", 0.01, 1e-1, 0.4, 1}};
  return c;
}

std::string Page(const Comparison& c) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / ("fork1s_report_" + std::to_string(getpid()) + ".html");
  const auto written = WriteComparisonReport(c, path.string());
  EXPECT_TRUE(written);
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  std::filesystem::remove(path);
  return text.str();
}

int Count(const std::string& text, const std::string& part) {
  int count = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST(Report, HoldsEveryPlotAndNothingFromElsewhere) {
  const std::string page = Page(Example());
  EXPECT_EQ(Count(page, "<svg "), 5);  // path, difference, force, gap, error against cost
  EXPECT_EQ(Count(page, "<svg "), Count(page, "</svg>"));
  EXPECT_NE(page.find("prefers-color-scheme: dark"), std::string::npos);
  for (const char* outside : {"http://", "https://", "<script", "<link", "@import"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  EXPECT_NE(page.find("a &lt;scene&gt; &amp; more"), std::string::npos);
  EXPECT_EQ(page.find("nan"), std::string::npos);
  EXPECT_EQ(page.find("inf"), std::string::npos);
}

TEST(Report, SaysWhereThereIsNothingToShow) {
  Comparison c = Example();
  c.costs.clear();
  EXPECT_NE(Page(c).find("nothing to show"), std::string::npos);
}

TEST(Report, CannotBeWrittenWhereThereIsNoFolder) {
  const auto written = WriteComparisonReport(Example(), "/no such folder/report.html");
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kFile);
}

}  // namespace
}  // namespace fork1s
