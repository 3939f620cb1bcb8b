// Takes the place of the C library's accept() in this test, and counts.
#include "failed_accepts.hpp"

#include <dlfcn.h>
#include <sys/socket.h>

#include <cerrno>

namespace fork1s::test {
std::atomic<long> failed_accepts{0};
}  // namespace fork1s::test

extern "C" int accept(int listener, sockaddr* __restrict address, socklen_t* __restrict size) {
  using Accept = int (*)(int, sockaddr*, socklen_t*);
  static const auto system_accept = reinterpret_cast<Accept>(dlsym(RTLD_NEXT, "accept"));
  const int socket = system_accept(listener, address, size);
  if (socket < 0 && errno != EAGAIN && errno != EWOULDBLOCK) ++fork1s::test::failed_accepts;
  return socket;
}
