// What every function of the C interface does: no exception leaves it, and an error has its status and its sentence.
#pragma once

#include <fork1s/fork1s.h>

#include <string>
#include <type_traits>
#include <utility>

#include "base/refused.hpp"

namespace fork1s::c {

using internal::Refused;
using internal::ValueOrThrow;

[[noreturn]] void Misuse(std::string message);

/// Status and message of the exception at hand, in a catch block. The message begins with `function`.
fork1s_status StoreError(const char* function) noexcept;

/// Calls f, whose exceptions become a status.
template <class F>
fork1s_status Guard(const char* function, F&& f) noexcept {
  try {
    f();
    return FORK1S_OK;
  } catch (...) {
    return StoreError(function);
  }
}

/// Refuses NULL.
void RequireGiven(const void* pointer, const char* argument);
/// Refuses an array of another length than `count`, and NULL unless that is 0.
void RequireLength(const void* array, std::size_t length, std::size_t count, const char* argument);
/// Refuses an index that is not below `count`.
std::size_t RequireIndex(const char* what, std::int32_t index, std::size_t count);

}  // namespace fork1s::c
