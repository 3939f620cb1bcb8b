// The live error estimate beside the error itself, over families of random mechanisms.
#pragma once

#include <lab/accuracy.hpp>
#include <string>
#include <vector>

namespace fork1s {

enum class ErrorFamily { kTree, kLoop, kFloating, kDriven, kRolling, kGrasp, kLanding, kSliding };
constexpr ErrorFamily kErrorFamilies[] = {
    ErrorFamily::kTree,    ErrorFamily::kLoop,  ErrorFamily::kFloating, ErrorFamily::kDriven,
    ErrorFamily::kRolling, ErrorFamily::kGrasp, ErrorFamily::kLanding,  ErrorFamily::kSliding};
const char* Name(ErrorFamily family);

/// A random motion of one second. The same seed gives the same one everywhere.
TransientCase DrawErrorCase(ErrorFamily family, unsigned seed);

/// Body-frames of a case or of a family, by what the estimate tells. Errors below 0.02 % of the motion do not
/// count.
struct ErrorShares {
  int small = 0;                         // error and estimate below 0.02 % of the motion
  int without_truth = 0;                 // runs by smaller steps do not approach each other
  int not_quantified = 0;                // told above 10 % of the motion, and the error is above 5 %
  int inside = 0, below = 0, above = 0;  // told over true within [0.5, 3], below, above

  int told() const { return inside + below + above; }
  ErrorShares& operator+=(const ErrorShares& other);
};

/// The worst frame of a body.
struct WorstEstimate {
  ErrorFamily family = ErrorFamily::kTree;
  unsigned seed = 0;
  std::string body;
  double time = 0;                          // s
  double shown = 0, error = 0, motion = 0;  // m
  double interior = 0, step = 0;            // m, parts of what is shown
  double order = 0;                         // observed, of the runs that make the truth
  double ratio() const { return shown / error; }
};

/// Whose run by small steps is the truth.
enum class ErrorTruth {
  kAllModes,  // the same simulator, all fixed-interface modes kept
  kFull,      // the full-coordinate simulator, which shares no code of the step
};

struct ErrorCaseResult {
  ErrorFamily family = ErrorFamily::kTree;
  unsigned seed = 0;
  ErrorShares shares;
  std::vector<WorstEstimate> worst;  // a body that has been told wrongly, where it is worst
};

/// Runs of `c` by two stages of 1/60 s, and by 1/8, 1/16 and 1/32 of that for the truth.
Expected<ErrorCaseResult> MeasureErrorCase(const TransientCase& c, ErrorFamily family, unsigned seed,
                                           ErrorTruth truth);

/// `count` motions, one family of `families` after the other, of seeds from `first` on.
Expected<std::vector<ErrorCaseResult>> MeasureErrorFamilies(const std::vector<ErrorFamily>& families,
                                                            unsigned first, unsigned count, ErrorTruth truth);

/// A row for each family and one for all.
std::string ErrorFamiliesMarkdown(const std::vector<ErrorCaseResult>& results);
/// Bodies that were told wrongly, the worst first.
std::string WorstEstimatesCsv(const std::vector<ErrorCaseResult>& results);

}  // namespace fork1s
