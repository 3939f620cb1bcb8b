// Preloaded into a program: lets the n-th allocation of its main() fail, n from FORK1S_FAIL_NEW_AT, and with
// FORK1S_FAIL_NEW_ON=1 every one after it too. Counted is operator new, and malloc where the program itself
// calls it, as Eigen does for its matrices. What MuJoCo and libraries in C ask for is left out: they are not
// ours, and some end the program.
#include <dlfcn.h>
#include <link.h>
#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>

extern "C" void* __libc_malloc(std::size_t size);

namespace {

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;
std::atomic<bool> started{false};  // before main() nobody could catch what fails

// Where the program itself lies, not its libraries.
std::uintptr_t program_first = 0, program_last = 0;

int TakeProgram(dl_phdr_info* info, std::size_t, void*) {
  program_first = info->dlpi_addr;
  for (int i = 0; i < info->dlpi_phnum; ++i)
    program_last = std::max<std::uintptr_t>(
        program_last, info->dlpi_addr + info->dlpi_phdr[i].p_vaddr + info->dlpi_phdr[i].p_memsz);
  return 1;  // the first is the program
}

bool IsFromProgram(void* caller) {
  const auto at = reinterpret_cast<std::uintptr_t>(caller);
  return at >= program_first && at < program_last;
}

long Number(const char* name) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atol(text) : 0;
}

bool IsFrom(void* caller, const char* library) {
  Dl_info info;
  return dladdr(caller, &info) != 0 && info.dli_fname != nullptr &&
         std::strstr(info.dli_fname, library) != nullptr;
}

// Whether this allocation is to fail.
bool Fails() {
  if (!started) return false;
  static const long fail_at = Number("FORK1S_FAIL_NEW_AT"), on = Number("FORK1S_FAIL_NEW_ON");
  static std::atomic<long> count{0};
  const long n = ++count;
  return fail_at > 0 && (n == fail_at || (on != 0 && n > fail_at));
}

void* Allocate(std::size_t size, std::size_t alignment, void* caller) {
  if (Fails() && !IsFrom(caller, "libmujoco")) return nullptr;
  if (size == 0) size = 1;
  if (alignment <= alignof(std::max_align_t)) return __libc_malloc(size);
  return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

void* AllocateOrThrow(std::size_t size, std::size_t alignment, void* caller) {
  void* memory = Allocate(size, alignment, caller);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

extern "C" void* malloc(std::size_t size) noexcept {
  void* const caller = __builtin_return_address(0);
  if (started && IsFromProgram(caller) && Fails()) {
    errno = ENOMEM;
    return nullptr;
  }
  return __libc_malloc(size);
}
extern "C" int __libc_start_main(Main main, int argc, char** argv, void (*init)(), void (*fini)(),
                                 void (*unload)(), void* stack) {
  const auto next = reinterpret_cast<decltype(&__libc_start_main)>(dlsym(RTLD_NEXT, "__libc_start_main"));
  real_main = main;
  const Main counted = [](int count, char** arguments, char** environment) {
    dl_iterate_phdr(TakeProgram, nullptr);
    started = true;
    const int code = real_main(count, arguments, environment);
    started = false;
    return code;
  };
  return next(counted, argc, argv, init, fini, unload, stack);
}
void* operator new(std::size_t size) { return AllocateOrThrow(size, 1, __builtin_return_address(0)); }
void* operator new[](std::size_t size) { return AllocateOrThrow(size, 1, __builtin_return_address(0)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return AllocateOrThrow(size, static_cast<std::size_t>(alignment), __builtin_return_address(0));
}
void* operator new[](std::size_t size, std::align_val_t alignment) {
  return AllocateOrThrow(size, static_cast<std::size_t>(alignment), __builtin_return_address(0));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return Allocate(size, 1, __builtin_return_address(0));
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return Allocate(size, 1, __builtin_return_address(0));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
