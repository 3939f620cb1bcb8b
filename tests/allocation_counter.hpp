// Counts allocations of the whole program. Include it in one file of a test program only: it defines malloc.
#pragma once

#include <atomic>
#include <cstdlib>

namespace fork1s::testing {

inline std::atomic<long> allocations{0};

// Sanitizers bring a malloc of their own; there the count stays zero and only the code under test is watched.
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
inline constexpr bool kCountsAllocations = true;
#else
inline constexpr bool kCountsAllocations = false;
#endif

}  // namespace fork1s::testing

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// Every method to the heap ends here, that of Eigen, MuJoCo and operator new.
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
  fork1s::testing::allocations.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
#endif
