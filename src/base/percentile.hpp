// Order statistics of measured times.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace fork1s {

/// The value below which a share of 0 to 1 of the values lies, the lower of two; NaN if there is none.
inline double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}
inline double Median(std::vector<double> values) { return Percentile(std::move(values), 0.5); }

}  // namespace fork1s
