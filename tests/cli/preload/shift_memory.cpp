// Preloaded into a program: every block of memory that is not asked for at a larger alignment lies at an
// address that is FORK1S_SHIFT (0 or 16) modulo 32. Sums in vector registers begin at the first aligned
// number where they may.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

extern "C" {
void* __libc_memalign(std::size_t alignment, std::size_t size);
void __libc_free(void* memory);
}

namespace {

// What lies before each block.
struct Head {
  std::size_t size;
  void* raw;
};

void* Place(std::size_t alignment, std::size_t size) {
  static const char* const shift = std::getenv("FORK1S_SHIFT");
  const std::size_t before = alignment > 16 ? alignment : 32 + (shift && *shift == '1' ? 16 : 0);
  auto* raw = static_cast<char*>(__libc_memalign(std::max<std::size_t>(alignment, 32), before + size));
  if (raw == nullptr) return nullptr;
  const Head head{size, raw};
  std::memcpy(raw + before - sizeof head, &head, sizeof head);
  return raw + before;
}

Head HeadOf(void* memory) {
  Head head;
  std::memcpy(&head, static_cast<char*>(memory) - sizeof head, sizeof head);
  return head;
}

}  // namespace

extern "C" {
void* malloc(std::size_t size) noexcept { return Place(16, size); }
void free(void* memory) noexcept {
  if (memory != nullptr) __libc_free(HeadOf(memory).raw);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
  if (size != 0 && count > SIZE_MAX / size) return nullptr;
  void* memory = Place(16, count * size);
  if (memory != nullptr) std::memset(memory, 0, count * size);
  return memory;
}
void* realloc(void* memory, std::size_t size) noexcept {
  void* larger = Place(16, size);
  if (larger == nullptr || memory == nullptr) return larger;
  std::memcpy(larger, memory, std::min(size, HeadOf(memory).size));
  free(memory);
  return larger;
}
void* memalign(std::size_t alignment, std::size_t size) noexcept { return Place(alignment, size); }
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept { return Place(alignment, size); }
int posix_memalign(void** out, std::size_t alignment, std::size_t size) noexcept {
  *out = Place(alignment, size);
  return *out != nullptr ? 0 : 12;  // ENOMEM
}
std::size_t malloc_usable_size(void* memory) noexcept { return memory != nullptr ? HeadOf(memory).size : 0; }
}
