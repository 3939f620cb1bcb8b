#include "parallel/parallel_for.hpp"

#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>

#ifdef FORK1S_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif

namespace fork1s {
namespace {

// The library of threads is not compiled with the thread sanitizer, which therefore does not see what a loop
// promises: the caller's writes come before every range, and every range before the return. Between two
// ranges nothing is promised.
class LoopOrder {
 public:
#ifdef FORK1S_THREAD_SANITIZER
  LoopOrder() { __tsan_release(&begun_); }
  ~LoopOrder() { __tsan_acquire(&ended_); }
  void BeginRange() { __tsan_acquire(&begun_); }
  void EndRange() { __tsan_release(&ended_); }

 private:
  char begun_ = 0, ended_ = 0;
#else
  void BeginRange() {}
  void EndRange() {}
#endif
};

}  // namespace

void ParallelFor(int first, int last, int grain, const std::function<void(int begin, int end)>& body) {
  if (last - first <= grain) {
    if (last > first) body(first, last);
    return;
  }
  LoopOrder order;
  tbb::parallel_for(
      tbb::blocked_range<int>(first, last, static_cast<std::size_t>(grain)),
      [&](const tbb::blocked_range<int>& range) {
        order.BeginRange();
        body(range.begin(), range.end());
        order.EndRange();
      },
      tbb::simple_partitioner());
}

void ParallelForFixedShares(int first, int last, const std::function<void(int i)>& body) {
  LoopOrder order;
  tbb::parallel_for(
      tbb::blocked_range<int>(first, last),
      [&](const tbb::blocked_range<int>& range) {
        order.BeginRange();
        for (int i = range.begin(); i < range.end(); ++i) body(i);
        order.EndRange();
      },
      tbb::static_partitioner());
}

void WithThreads(int threads, const std::function<void()>& work) {
  if (threads <= 0) return work();
  // More than there are cores would be refused with a warning where the first arena had fewer.
  tbb::task_arena(std::min(threads, tbb::info::default_concurrency())).execute(work);
}

}  // namespace fork1s
