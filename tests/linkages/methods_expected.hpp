// One expectation for named linkages: every method gives the ranks stated, and the same numbers.
#pragma once

#include <gtest/gtest.h>

#include "compare.hpp"

namespace fork1s::linkages {

/// Counts known by hand.
struct Counts {
  int mobility = 0;        // motions that the loops leave
  int interface_rank = 0;  // elastic motions at the interface
  int interface_free = 0;  // spring-free ones there
  int hidden = 0;          // spring-free ones elsewhere: refused
};

inline void ExpectMethods(const Methods& r, const Counts& counts) {
  ASSERT_TRUE(r.plain.well_posed) << "kept " << r.plain.smallest_kept << " dropped "
                                  << r.plain.largest_dropped;
  EXPECT_EQ(r.mobility(), counts.mobility);
  EXPECT_EQ(r.plain.interface_rank, counts.interface_rank);
  EXPECT_EQ(r.plain.interface_free, counts.interface_free);
  EXPECT_EQ(r.plain.hidden(), counts.hidden);
  for (const InterfaceCompliance* answer : {&r.walk, &r.dense}) {
    const char* method = answer == &r.walk ? "walk" : "dense";
    const Compared c = CompareWithPlain(*answer, r.plain, r.size);
    EXPECT_LT(c.difference, kSame) << method;
    EXPECT_EQ(answer->rank, counts.interface_rank) << method;
    EXPECT_LT(c.free_distance, kSame) << method;
    EXPECT_TRUE(answer->doubts.empty()) << method << " " << answer->doubts[0].Text();
  }
  if (counts.hidden > 0) {
    ASSERT_FALSE(r.model) << "reduced with a motion that no interface body sees";
    EXPECT_EQ(r.model.error().code, ErrorCode::kUnderdetermined);
  } else {
    ASSERT_TRUE(r.model) << r.model.error().Text();
    EXPECT_EQ(r.linkage.mechanism->num_coordinates() - r.model->loop_rank(), counts.mobility);
    EXPECT_EQ(r.model->num_free, counts.interface_free);
    EXPECT_TRUE(r.model->doubts.empty()) << r.model->doubts[0].Text();
  }
  EXPECT_EQ(static_cast<int>(r.frequencies.size()), r.plain.elastic);
}

}  // namespace fork1s::linkages
