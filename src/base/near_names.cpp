#include "base/near_names.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/lower_case.hpp"

namespace fork1s {
namespace {

// Levenshtein distance of the lower-case names.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row.back();
}

}  // namespace

std::string Quoted(const std::vector<std::string>& names, std::size_t most) {
  std::string text;
  const std::size_t shown = std::min(most, names.size());
  for (std::size_t i = 0; i < shown; ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += '\'' + names[i] + '\'';
  }
  if (names.size() > shown) text += fmt::format(" and {} more", names.size() - shown);
  return text;
}

std::vector<std::string> NearNames(const std::string& wanted, const std::vector<std::string>& names,
                                   std::size_t most) {
  const std::string key = LowerCase(wanted);
  std::vector<std::pair<std::size_t, std::string>> ranked;
  for (const std::string& name : names) {
    const std::string low = LowerCase(name);
    std::size_t distance = EditDistance(key, low);
    const bool contained = !low.empty() && !key.empty() &&
                           (low.find(key) != std::string::npos || key.find(low) != std::string::npos);
    if (contained) distance = std::min<std::size_t>(distance, 2);
    if (distance <= std::max<std::size_t>(2, key.size() / 2)) ranked.emplace_back(distance, name);
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<std::string> near;
  for (const auto& [distance, name] : ranked) {
    if (near.size() == most) break;
    near.push_back(name);
  }
  return near;
}

std::string Suggestion(const std::string& wanted, const std::vector<std::string>& names) {
  const std::vector<std::string> near = NearNames(wanted, names);
  if (!near.empty()) return fmt::format("; near names are {}", Quoted(near));
  if (!names.empty()) return fmt::format("; there are {}", Quoted(names, 12));
  return "";
}

}  // namespace fork1s
