// A rank that the numbers do not settle.
#pragma once

#include <string>
#include <vector>

namespace fork1s {

/// A decision between motions that exist and motions that do not, where the smallest singular value taken as
/// real is less than a thousand times the largest taken as zero (docs/method.md, section 4).
struct RankDoubt {
  std::string what;                 ///< what was decided: "loops hold", "springs hold", ...
  double kept = 0;                  ///< smallest singular value taken as real, in scaled units
  double dropped = 0;               ///< largest taken as zero
  std::vector<std::string> joints;  ///< that move most in the doubtful direction

  /// One sentence for a user.
  std::string Text() const;
};

}  // namespace fork1s
