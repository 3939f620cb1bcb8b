// Preloaded into a program: its steady clock runs 10,000 times as fast, so that ten seconds last a millisecond.
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

extern "C" int clock_gettime(clockid_t clock, timespec* now) noexcept {
  const long code = syscall(SYS_clock_gettime, clock, now);
  if (code != 0 || clock != CLOCK_MONOTONIC) return static_cast<int>(code);
  constexpr long kFactor = 10000, kNanosecondsPerSecond = 1000000000;
  static const time_t start = now->tv_sec;
  const long scaled = now->tv_nsec * kFactor;
  now->tv_sec = (now->tv_sec - start) * kFactor + scaled / kNanosecondsPerSecond;
  now->tv_nsec = scaled % kNanosecondsPerSecond;
  return 0;
}
