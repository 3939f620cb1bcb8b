#include <fork1s/parallel/parallel_for.hpp>

#include <oneapi/tbb/parallel_for.h>

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

}  // namespace fork1s
