// Mechanisms and contacts whose answer is known: a closed form or a published benchmark.
//
// Each quantity is reached by two methods, the reduced simulator and the full-coordinate one. Where implicit
// Euler at one step size cannot reach the digits that are known, runs at h, h/2, h/4, ... are extrapolated to
// h = 0 and the row says so.
#pragma once

#include <fork1s/base/error.hpp>
#include <span>
#include <string>
#include <vector>

namespace fork1s {

/// One number by one method.
struct KnownAnswer {
  std::string case_name, quantity, unit;
  std::string method;  // "reduced" or "full"
  double expected = 0, measured = 0;
  double tolerance = 0;  // of |measured - expected|, in the same unit
  std::string why_tolerance, source;

  /// False for numbers that are not finite.
  bool Holds() const;
};

enum class Refinement {
  kCoarse,  ///< for tests: the three long cases with longer steps and wider tolerances
  kFine,    ///< for the validation page: most of a minute in all
};

struct KnownAnswerCase {
  const char* name;
  const char* title;  // for the reader
  /// Errors: kNumerics, naming what did not converge.
  Expected<std::vector<KnownAnswer>> (*run)(Refinement);
};

/// All cases, in the order of the validation page.
std::span<const KnownAnswerCase> KnownAnswerCases();

}  // namespace fork1s
