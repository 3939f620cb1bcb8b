#pragma once

#include <fork1s/record/recording.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

/// One name per body, different from all others: its own, or MECHANISM/BODY where two share it.
std::vector<std::string> BodyNames(const RecordingHeader& recording);

}  // namespace fork1s::internal
