#include "base/system_error.hpp"

#include <cerrno>
#include <system_error>

namespace fork1s {

std::string CauseAndRemedy(int error, const std::string& remedy) {
  const auto with = [&](const std::string& what) {
    std::string out = "(";
    return out.append(std::generic_category().message(error)).append("); ").append(what);
  };
  switch (error) {
    case EMFILE:
      return with("this process may open no more files, raise its limit (ulimit -n)");
    case ENFILE:
      return with("this machine has no file descriptors left, close other programs");
    case ENOMEM:
      return with("memory is used up, close other programs or raise the limit (ulimit -v)");
    case EAGAIN:  // of fork and pthread_create
      return with(
          "no more processes or threads can be started, close other programs or raise the limit (ulimit -u)");
    default:
      return with(remedy);
  }
}

}  // namespace fork1s
