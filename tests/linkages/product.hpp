// What the library says about a linkage, in the words that these tests compare.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <optional>
#include <string>

#include "sketch.hpp"

namespace fork1s::linkages {

struct ComplianceAnswer {
  bool exists = false;
  MatrixX C;                    // projected off the free directions
  std::optional<MatrixX> free;  // 6e x f; none where the library does not say
  int rank = 0;
  bool doubtful = false;
};
ComplianceAnswer Walk(const Written& linkage);
ComplianceAnswer Dense(const Written& linkage);

/// The model at q = 0 without modes.
Expected<ReducedModel> ReduceAtReference(const Written& linkage);
bool IsDoubtful(const ReducedModel& model);
/// The joint that an error names, "" for errors of another kind.
std::string JointOf(const Error& error);
/// All frequencies of the library's full coordinates [Hz].
std::vector<double> AllFrequencies(const Written& linkage);

}  // namespace fork1s::linkages
