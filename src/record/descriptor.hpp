// An open file of the system that closes itself.
#pragma once

#include <unistd.h>

#include <utility>

namespace fork1s::internal {

class Descriptor {
 public:
  explicit Descriptor(int file = -1) : file_(file) {}
  Descriptor(Descriptor&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    if (this != &other) Close(), file_ = std::exchange(other.file_, -1);
    return *this;
  }
  ~Descriptor() { Close(); }
  explicit operator bool() const { return file_ >= 0; }
  int get() const { return file_; }
  /// False where what was written did not arrive.
  bool Close() {
    const int file = std::exchange(file_, -1);
    return file < 0 || close(file) == 0;
  }

 private:
  int file_;
};

}  // namespace fork1s::internal
