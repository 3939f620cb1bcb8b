// Loops side by side that do not allocate.
#pragma once

#include "parallel/parallel_for.hpp"

namespace fork1s {

/// act(i) for 0 to count - 1, side by side where they are more than `grain`: each on its own data alone.
template <class Act>
void ForAll(std::size_t count, int grain, const Act& act) {
  ParallelFor(0, static_cast<int>(count), grain, [&act](int begin, int end) {
    for (int i = begin; i < end; ++i) act(static_cast<std::size_t>(i));
  });
}

}  // namespace fork1s
