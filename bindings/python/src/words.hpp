// Words of the API for enumerations, as the command line has them.
#pragma once

#include <fork1s/sim/fidelity.hpp>
#include <string>

#include "errors.hpp"

namespace fork1s::python {

inline DetailLevel ReadDetail(const std::string& word) {
  for (const DetailLevel level :
       {DetailLevel::kObject, DetailLevel::kInterface, DetailLevel::kParents, DetailLevel::kAll})
    if (word == Name(level)) return level;
  throw Refused{{ErrorCode::kUsage, "detail", "'" + word + "' is none of: object, interface, parents, all"}};
}

inline Recovery ReadRecovery(const std::string& word) {
  if (word == "exact") return Recovery::kExact;
  if (word == "twist") return Recovery::kTwist;
  throw Refused{{ErrorCode::kUsage, "recovery", "'" + word + "' is none of: exact, twist"}};
}

}  // namespace fork1s::python
