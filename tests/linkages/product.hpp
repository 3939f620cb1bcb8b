// What the library says about a linkage at its reference.
#pragma once

#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <string>

#include "sketch.hpp"

namespace fork1s::linkages {

InterfaceCompliance Walk(const Written& linkage);
InterfaceCompliance Dense(const Written& linkage);
/// The model without modes.
Expected<ReducedModel> ReduceAtReference(const Written& linkage);
/// The joint that an error names, "" for errors of another kind.
std::string JointOf(const Error& error);
/// All frequencies of the library's full coordinates [Hz].
std::vector<double> AllFrequencies(const Written& linkage);

}  // namespace fork1s::linkages
