#include "held_errors.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>

namespace fork1s::app {

HeldErrors::HeldErrors() {
  std::fflush(stderr);
  held_ = memfd_create("errors", MFD_CLOEXEC);
  if (held_ >= 0) before_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
  if (before_ >= 0) dup2(held_, STDERR_FILENO);
}

HeldErrors::~HeldErrors() {
  std::fflush(stderr);
  if (before_ >= 0) dup2(before_, STDERR_FILENO);
  char bytes[4096];
  off_t at = 0;
  while (before_ >= 0 && !dropped_) {
    const ssize_t got = pread(held_, bytes, sizeof bytes, at);
    if (got <= 0 || write(STDERR_FILENO, bytes, static_cast<std::size_t>(got)) != got) break;
    at += got;
  }
  for (const int file : {held_, before_})
    if (file >= 0) close(file);
}

}  // namespace fork1s::app
