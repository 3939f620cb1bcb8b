// MuJoCo's model compiler keeps global state (locale, XML schema, where it reports to), and two rooms use it:
// whoever compiles holds this lock, so that a model may be read on one thread while another builds its
// collision model.
#pragma once

#include <mutex>

namespace fork1s::internal {

inline std::mutex& CompilerLock() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace fork1s::internal
