// What must hold for every linkage, tried on 3000 random ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>

#include "compare.hpp"
#include "survey.hpp"

namespace fork1s::linkages {
namespace {

std::ostream& operator<<(std::ostream& out, const Sample& s) {
  return out << "seed " << s.seed << " (" << s.family << ", " << s.coordinates << " coordinates, loop rank "
             << s.loop_rank << ", free " << s.free << " of which seen " << s.interface_free << ", elastic "
             << s.elastic << " of which felt " << s.interface_rank << ", smallest kept " << s.smallest_kept
             << ")";
}

// Checks `holds` on the well-posed linkages that `concerns`; names the first few that fail and counts all.
void ExpectOfEach(const std::function<bool(const Sample&)>& concerns,
                  const std::function<bool(const Sample&)>& holds,
                  const std::function<std::string(const Sample&)>& found) {
  int concerned = 0, failed = 0;
  std::ostringstream text;
  for (const Sample& s : TheSurvey()) {
    if (!s.well_posed || !concerns(s)) continue;
    ++concerned;
    if (holds(s)) continue;
    if (++failed <= 10) text << "  " << s << ": " << found(s) << '\n';
  }
  if (failed > 0) text << "  ...\n";
  EXPECT_EQ(failed, 0) << "of " << concerned << " linkages; the first are\n" << text.str();
  EXPECT_GT(concerned, 0);
}

bool All(const Sample&) { return true; }
template <class... T>
std::string Text(const T&... values) {
  std::ostringstream out;
  ((out << values << ' '), ...);
  return out.str();
}

int CountOf(const std::function<bool(const Sample&)>& holds) {
  int count = 0;
  for (const Sample& s : TheSurvey()) count += s.well_posed && holds(s);
  return count;
}

TEST(Survey, HasManyOfEveryClass) {
  // Else the tests below would say nothing. Counted among the well-posed.
  const std::map<std::string, std::function<bool(const Sample&)>> classes = {
      {"held by springs", [](const Sample& s) { return s.free == 0 && s.interface_rank > 0; }},
      {"free at the interface", [](const Sample& s) { return s.interface_free > 0; }},
      {"hidden", [](const Sample& s) { return s.hidden() > 0; }},
      {"locked", [](const Sample& s) { return s.locked(); }},
      {"overconstrained", [](const Sample& s) { return s.overconstrained; }},
      {"two freedoms or more in loops with unsprung pins",
       [](const Sample& s) { return s.has_loops && s.elastic >= 2 && s.springs < s.coordinates; }},
      {"interface held by rigid loops",
       [](const Sample& s) { return s.elastic > 0 && s.interface_rank == 0; }}};
  const std::map<std::string, int> least = {{"held by springs", 1000},
                                            {"free at the interface", 300},
                                            {"hidden", 300},
                                            {"locked", 30},
                                            {"overconstrained", 1000},
                                            {"two freedoms or more in loops with unsprung pins", 300},
                                            {"interface held by rigid loops", 50}};
  for (const auto& [name, belongs] : classes) {
    const int count = CountOf(belongs);
    std::cout << name << ": " << count << '\n';
    EXPECT_GE(count, least.at(name)) << name;
  }
  std::map<std::string, int> families;
  for (const Sample& s : TheSurvey()) families[s.family] += s.well_posed;
  for (const auto& [family, count] : families) EXPECT_GE(count, 100) << family;
  EXPECT_EQ(families.size(), 7u);
}

TEST(Survey, NineOfTenAreWellPosed) {
  const int count = CountOf(All);
  std::cout << "well-posed: " << count << " of " << kSurveyed << '\n';
  EXPECT_GT(count, 0.9 * kSurveyed);
}

TEST(Survey, WalkIsThePlainMethod) {
  double walk = 0, dense = 0;
  for (const Sample& s : TheSurvey())
    if (s.well_posed) walk = std::max(walk, s.walk), dense = std::max(dense, s.dense);
  std::cout << "worst: walk " << walk << ", dense " << dense << '\n';
  ExpectOfEach(
      All, [](const Sample& s) { return s.walk < kSame; },
      [](const Sample& s) { return Text("off by", s.walk); });
}

TEST(Survey, DenseIsThePlainMethod) {
  ExpectOfEach(
      All, [](const Sample& s) { return s.dense < kSame; },
      [](const Sample& s) { return Text("off by", s.dense); });
}

TEST(Survey, WalkIsDense) {
  // As the library itself measures it, where neither is zero but for rounding.
  ExpectOfEach([](const Sample& s) { return s.interface_rank > 0; },
               [](const Sample& s) { return s.to_each_other < kSame; },
               [](const Sample& s) { return Text("off by", s.to_each_other); });
}

TEST(Survey, RanksOfTheComplianceAgree) {
  ExpectOfEach(
      All,
      [](const Sample& s) { return s.walk_rank == s.interface_rank && s.dense_rank == s.interface_rank; },
      [](const Sample& s) { return Text("walk", s.walk_rank, "dense", s.dense_rank); });
}

TEST(Survey, FreeDirectionsOfTheInterfaceAgree) {
  ExpectOfEach(
      All, [](const Sample& s) { return s.walk_free < kSame && s.dense_free < kSame; },
      [](const Sample& s) { return Text("walk", s.walk_free, "dense", s.dense_free); });
}

TEST(Survey, HiddenMotionsAreRefused) {
  ExpectOfEach(
      [](const Sample& s) { return s.hidden() > 0; }, [](const Sample& s) { return s.refused; },
      [](const Sample& s) { return Text("hidden", s.hidden(), "but reduced with", s.model_free, "free"); });
}

TEST(Survey, RefusalsNameAJointThatMoves) {
  // A thousandth of the largest joint's motion is far above rounding, and below what geometry gives a joint.
  ExpectOfEach([](const Sample& s) { return s.hidden() > 0 && s.refused; },
               [](const Sample& s) { return s.named_share > 1e-3; },
               [](const Sample& s) { return Text(s.refusal, "share", s.named_share); });
}

TEST(Survey, OnlyHiddenMotionsAreRefused) {
  ExpectOfEach([](const Sample& s) { return s.hidden() == 0; }, [](const Sample& s) { return !s.refused; },
               [](const Sample& s) { return s.refusal; });
}

TEST(Survey, ReducedModelHasTheRanksOfThePlainMethod) {
  ExpectOfEach([](const Sample& s) { return s.hidden() == 0 && !s.refused; },
               [](const Sample& s) { return s.model_loop_rank == s.loop_rank && s.model_free == s.free; },
               [](const Sample& s) { return Text("loop rank", s.model_loop_rank, "free", s.model_free); });
}

TEST(Survey, ReducedModelFeelsElasticMotionsOnly) {
  // Beside free directions it may count elastic motions that differ by a free one.
  ExpectOfEach([](const Sample& s) { return s.free == 0; },
               [](const Sample& s) {
                 return s.model_elastic <= s.interface_rank &&
                        (s.model_elastic > 0) == (s.interface_rank > 0);
               },
               [](const Sample& s) { return Text("the model feels", s.model_elastic); });
}

TEST(Survey, OtherRanksAreDoubted) {
  // Outside the well-posed, two methods may decide otherwise, but not silently.
  int other = 0;
  for (const Sample& s : TheSurvey()) {
    const bool same =
        s.walk_rank == s.interface_rank && s.dense_rank == s.interface_rank &&
        (s.refused ? s.hidden() > 0 : s.model_loop_rank == s.loop_rank && s.model_free == s.free);
    if (same) continue;
    ++other;
    EXPECT_FALSE(s.doubts.empty()) << Text(s);
  }
  std::cout << "other ranks: " << other << '\n';
}

TEST(Survey, EveryElasticMotionHasAFrequencyAndNoOther) {
  ExpectOfEach(
      All, [](const Sample& s) { return s.frequencies == s.elastic; },
      [](const Sample& s) { return Text(s.frequencies, "frequencies"); });
}

TEST(Survey, DoubtsAreKeptForTheIllPosed) {
  ExpectOfEach(
      All, [](const Sample& s) { return s.doubts.empty(); }, [](const Sample& s) { return s.doubts; });
}

}  // namespace
}  // namespace fork1s::linkages
