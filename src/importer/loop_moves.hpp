// Moves coordinates of a mechanism to where they are wanted, with its loops closed.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/definition.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s::internal {

/// A coordinate that is to have a displacement from the reference [rad or m].
struct WantedCoordinate {
  std::string joint;
  FreedomRef freedom;
  double displacement = 0;
};

/// Place of a freedom in q.
int CoordinateOf(const MechanismDef& mechanism, const FreedomRef& freedom);

/// Sets the wanted coordinates in q. Where the mechanism has loops or couplings the others follow, in small steps from q,
/// so that a linkage stays on its branch. Errors: kUsage at `where` where a loop stays open; q is then undefined.
std::optional<Error> MoveCoordinates(const MechanismDef& mechanism,
                                     const std::vector<WantedCoordinate>& wanted, const std::string& where,
                                     VectorX& q);

}  // namespace fork1s::internal
