// Parallel loops on one persistent pool.
#pragma once

#include <functional>

namespace fork1s {

/// Calls body(begin, end) on disjoint ranges that cover [first, last), on all cores where the range holds
/// more than `grain` items, else at once on this thread. Ranges are cut the same way for any number of
/// threads, so results that depend only on their own items are the same bits.
void ParallelFor(int first, int last, int grain, const std::function<void(int begin, int end)>& body);

/// Calls body(i) for first <= i < last on all cores in fixed equal shares, which go to the same threads each
/// time where that can be. For loops that replace what they allocated before: memory then stays with the
/// allocator's arena of one thread instead of spreading over those of all.
void ParallelForFixedShares(int first, int last, const std::function<void(int i)>& body);

/// Runs `work` so that loops in it use at most that many threads, this one among them, and no more than
/// there are cores; 0: all cores.
void WithThreads(int threads, const std::function<void()>& work);

}  // namespace fork1s
