// A chain of hinges with springs: the mechanism whose size is asked for. And one of loops.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <memory>

namespace fork1s::internal {

/// `joints` hinges about y and z in turn, 100 N·m/rad, 5 cm apart; `interfaces` bodies, the last one of them,
/// the others evenly before it.
std::shared_ptr<const Mechanism> MakeChain(int joints, int interfaces = 1);
/// Planar linkages of three bars on the base, turned about x one by one, their couplers the interfaces.
std::shared_ptr<const Mechanism> MakeFourBars(int count);

}  // namespace fork1s::internal
