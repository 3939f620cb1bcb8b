// Names in messages: lists, near misses.
#pragma once

#include <string>
#include <vector>

namespace fork1s {

/// "'a', 'b', 'c' and 4 more"
std::string Quoted(const std::vector<std::string>& names, std::size_t most = 8);

/// The names most like `wanted`, nearest first.
std::vector<std::string> NearNames(const std::string& wanted, const std::vector<std::string>& names,
                                   std::size_t most = 5);

/// "; near names are 'x'" or a list of what there is; empty when there is nothing to offer.
std::string Suggestion(const std::string& wanted, const std::vector<std::string>& names);

}  // namespace fork1s
