// Models that attach others (<model file>), which the reader reads again wherever they are named.
#pragma once

#include <fork1s/base/error.hpp>
#include <optional>
#include <string>

namespace fork1s::internal {

/// Refuses a model that attaches itself, over others too, which the reader follows until its stack ends, and
/// one that makes it read more files than any scene has: twenty files that each name the next one twice are a
/// million.
std::optional<Error> CheckAttached(const std::string& path, const std::string& text);

}  // namespace fork1s::internal
