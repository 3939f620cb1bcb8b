// Refusals of the operating system, with what helps against them.
#pragma once

#include <string>

namespace fork1s {

/// "(CAUSE); REMEDY" of an errno value. Exhausted descriptors, memory and processes have remedies of their
/// own, whatever was asked for; any other error has the given one.
std::string CauseAndRemedy(int error, const std::string& remedy);

}  // namespace fork1s
