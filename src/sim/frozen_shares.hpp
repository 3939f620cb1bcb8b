// How frozen contacts share a load that the balance alone does not divide.
#pragma once

#include <fork1s/base/types.hpp>
#include <functional>
#include <vector>

namespace fork1s::internal {

/// The rows of one frozen contact among the multipliers of a mechanism: normal first, minus what acts on the
/// held body; tangents follow unless it is frictionless.
struct FrozenContactRows {
  Eigen::Index first = 0;
  double friction = 0;
  bool frictionless = false;
};

/// `balanced` solves the balance, and so does `balance(x)`, the solution nearest to any x. Where some contact
/// of `balanced` pulls or leaves its cone of friction: a solution in which none does, near to `balanced`, if
/// there is one; else one that is as near to the cones as was found. Contacts that are not frozen share in
/// that way: they slip and part only where no sharing keeps all of them within friction.
VectorX ShareWithinFriction(const VectorX& balanced, const std::vector<FrozenContactRows>& contacts,
                            const std::function<VectorX(const VectorX&)>& balance);

}  // namespace fork1s::internal
