#include <fork1s/reduction/rank_doubt.hpp>

#include <fmt/format.h>

namespace fork1s {

std::string RankDoubt::Text() const {
  std::string names;
  for (const std::string& joint : joints) names += (names.empty() ? "'" : ", '") + joint + "'";
  return fmt::format(
      "what {} hangs on the last digits: the weakest effect taken as real is {:.1e}, the strongest taken as "
      "none {:.1e}, in one unit; look at the positions and axes of {}",
      what, kept, dropped, names.empty() ? "its joints" : names);
}

}  // namespace fork1s
