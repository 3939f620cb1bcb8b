// How things that go wrong are told: outside data by Expected, callers by exceptions.
#pragma once

#include <source_location>
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

/// Throws std::invalid_argument "World::Step: TEXT" for the function at `place`.
[[noreturn]] void ThrowMisuse(const std::source_location& place, const std::string& text);

/// Throws so where an index is not below `count`: "Simulation::Pose: body 4 of 4; indices count from 0".
template <class Index, class Count>
void RequireIndex(const char* what, Index index, Count count,
                  const std::source_location& place = std::source_location::current()) {
  if (std::cmp_less(index, 0) || std::cmp_greater_equal(index, count))
    ThrowMisuse(place, std::string(what) + ' ' + std::to_string(index) + " of " + std::to_string(count) +
                           "; indices count from 0");
}

template <class... Values>
[[noreturn]] void ThrowRequirement(const std::source_location& place, const char* condition,
                                   const Values&... values) {
  std::ostringstream text;
  ((text << values << ' '), ...);
  text << "(required: " << condition << ')';
  ThrowMisuse(place, text.str());
}

}  // namespace internal
}  // namespace fork1s

/// Checks what a caller of the API promised; throws std::invalid_argument, in every build. The message is
/// "FUNCTION: VALUES (required: CONDITION)": values with the words between them are a sentence of cause and
/// remedy.
#define FORK1S_REQUIRE(condition, ...)                                             \
  do {                                                                             \
    if (!(condition))                                                              \
      ::fork1s::internal::ThrowRequirement(std::source_location::current(),        \
                                           #condition __VA_OPT__(, ) __VA_ARGS__); \
  } while (false)

/// Checks an invariant of our own; only in builds with assertions.
#ifdef NDEBUG
#define FORK1S_ASSERT(condition) static_cast<void>(0)
#else
#define FORK1S_ASSERT(condition) FORK1S_REQUIRE(condition)
#endif
