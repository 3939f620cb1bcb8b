// All that docs/accuracy.md shows, and its plots and tables.
#pragma once

#include <lab/accuracy.hpp>
#include <lab/error_families.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

struct AccuracyResults {
  std::vector<StaticCurve> statics;
  /// The firemen's exact mode with more and more modes kept: error [%] at each of `truncation_angles_deg`.
  struct Truncation {
    int modes = 0, size = 0;
    std::vector<double> percent;
  };
  std::vector<double> truncation_angles_deg;
  std::vector<Truncation> truncation;
  std::vector<GapCurve> gaps;
  std::vector<RestCurve> rests;             // of every rest case, all loads
  std::vector<FrequencyCurve> frequencies;  // per mechanism: lowest, then contribution
  std::vector<TransientCurve> transients;
  TransientCurve firemen_without_modes, firemen_with_all;
  std::vector<ErrorEstimateCurve> estimates;  // of every transient case, both integrators
  std::vector<ErrorCaseResult> families;      // random motions, twenty of each family
};

// Fits of the gap's slope: below, rounding would show; above, the next terms of the series do.
constexpr double kSlopeLow = 1, kSlopeHigh = 10;  // degrees

Expected<AccuracyResults> MeasureAccuracy(const std::string& scenes);
std::string AccuracyPage(const AccuracyResults& results);
Expected<void> WriteAccuracyPlots(const AccuracyResults& results, const std::string& folder);
Expected<void> WriteAccuracyTables(const AccuracyResults& results, const std::string& folder);
Expected<void> WriteText(const std::string& path, const std::string& text);

}  // namespace fork1s::internal
