// Words of names and paths.
#pragma once

#include <string>
#include <vector>

#include "base/near_names.hpp"

namespace fork1s::internal {

std::vector<std::string> SplitWords(const std::string& text);

/// The last part of a path, without its extension.
std::string Stem(const std::string& path);

}  // namespace fork1s::internal
