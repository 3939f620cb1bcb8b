// Parallel loops on one persistent pool.
#pragma once

#include <functional>

namespace fork1s {

/// Calls body(begin, end) on disjoint ranges that cover [first, last), on all cores where the range holds
/// more than `grain` items, else at once on this thread. Ranges are cut the same way for any number of
/// threads, so results that depend only on their own items are the same bits.
void ParallelFor(int first, int last, int grain, const std::function<void(int begin, int end)>& body);

}  // namespace fork1s
