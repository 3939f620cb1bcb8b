// Errors of data from outside as an exception, for interfaces to other languages, which catch it at their border.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <type_traits>
#include <utility>

namespace fork1s::internal {

/// An Error on its way to the caller.
struct Refused {
  Error error;
};

/// The value, or Refused. `file`: what the command line would put before the sentence.
template <class T>
T ValueOrThrow(Expected<T> expected, const std::string& file = {}) {
  if (!expected) {
    Error error = std::move(expected.error());
    if (!file.empty() && error.where.rfind(file, 0) != 0)
      error.where = error.where.empty() ? file : file + ": " + error.where;
    throw Refused{std::move(error)};
  }
  if constexpr (!std::is_void_v<T>) return std::move(*expected);
}

}  // namespace fork1s::internal
