// Which instruction sets the kernels run by, for tests of all of them.
#pragma once

#include <cstdint>
#include <vector>

namespace fork1s::internal {

/// Those that were compiled and this processor has, in Highway's numbers.
std::vector<std::int64_t> RecoveryInstructionSets();
/// From now on by this one alone; 0: by the best, as ever.
void UseInstructionSet(std::int64_t set);

}  // namespace fork1s::internal
