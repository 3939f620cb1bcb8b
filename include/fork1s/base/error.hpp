// How things that go wrong are told: outside data by Expected, callers by exceptions.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace fork1s {

enum class ErrorCode {
  kFile,             ///< a file that cannot be read or written
  kFormat,           ///< a file whose content cannot be understood
  kModel,            ///< a model that cannot be simulated as given
  kUnderdetermined,  ///< a joint that neither a spring nor an interface holds
  kNumerics,         ///< a computation that did not end in finite, converged numbers
  kUsage,            ///< an option or argument that makes no sense here
};

/// What went wrong with data from outside: `where` names file, line or element,
/// `message` says the cause and the remedy in one sentence.
struct Error {
  ErrorCode code = ErrorCode::kModel;
  std::string where;
  std::string message;

  std::string Text() const { return where.empty() ? message : where + ": " + message; }
};

template <class T>
using Expected = tl::expected<T, Error>;

inline tl::unexpected<Error> Fail(ErrorCode code, std::string where, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(where), std::move(message)});
}

namespace internal {

template <class... Values>
[[noreturn]] void ThrowRequirement(const char* condition, const char* file, int line,
                                   const Values&... values) {
  std::ostringstream text;
  text << "requirement not met: " << condition;
#ifdef NDEBUG  // whoever runs a release has no use for a place in our sources
  static_cast<void>(file), static_cast<void>(line);
#else
  text << " (" << file << ':' << line << ')';
#endif
  ((text << ' ' << values), ...);
  throw std::invalid_argument(text.str());
}

}  // namespace internal
}  // namespace fork1s

/// Checks what a caller of the API promised; throws std::invalid_argument, in every build.
#define FORK1S_REQUIRE(condition, ...)                                                                 \
  do {                                                                                                 \
    if (!(condition))                                                                                  \
      ::fork1s::internal::ThrowRequirement(#condition, __FILE__, __LINE__ __VA_OPT__(, ) __VA_ARGS__); \
  } while (false)

/// Checks an invariant of our own; only in builds with assertions.
#ifdef NDEBUG
#define FORK1S_ASSERT(condition) static_cast<void>(0)
#else
#define FORK1S_ASSERT(condition) FORK1S_REQUIRE(condition)
#endif
