#include <fork1s/parallel/parallel_for.hpp>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

namespace fork1s {

void ParallelFor(int first, int last, int grain, const std::function<void(int begin, int end)>& body) {
  if (last - first <= grain) {
    if (last > first) body(first, last);
    return;
  }
  tbb::parallel_for(
      tbb::blocked_range<int>(first, last, static_cast<std::size_t>(grain)),
      [&](const tbb::blocked_range<int>& range) { body(range.begin(), range.end()); },
      tbb::simple_partitioner());
}

void WithThreads(int threads, const std::function<void()>& work) {
  if (threads <= 0) return work();
  tbb::task_arena(threads).execute(work);
}

}  // namespace fork1s
