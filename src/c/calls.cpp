#include "calls.hpp"

#include <exception>
#include <new>
#include <stdexcept>

namespace fork1s::c {
namespace {

thread_local std::string stored_message;
thread_local const char* last_message = "";

fork1s_status StatusOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kFile:
      return FORK1S_ERROR_FILE;
    case ErrorCode::kFormat:
      return FORK1S_ERROR_FORMAT;
    case ErrorCode::kModel:
      return FORK1S_ERROR_MODEL;
    case ErrorCode::kUnderdetermined:
      return FORK1S_ERROR_UNDERDETERMINED;
    case ErrorCode::kNumerics:
      return FORK1S_ERROR_NUMERICS;
    case ErrorCode::kUsage:
      return FORK1S_ERROR_USAGE;
  }
  return FORK1S_ERROR_INTERNAL;
}

fork1s_status Store(const char* function, fork1s_status status, const std::string& text) {
  stored_message = std::string(function) + ": " + text;
  last_message = stored_message.c_str();
  return status;
}

}  // namespace

void Misuse(std::string message) { throw Refused{{ErrorCode::kUsage, "", std::move(message)}}; }

fork1s_status StoreError(const char* function) noexcept {
  try {
    try {
      throw;
    } catch (const Refused& refused) {
      return Store(function, StatusOf(refused.error.code), refused.error.Text());
    } catch (const std::invalid_argument& misuse) {
      return Store(function, FORK1S_ERROR_USAGE, misuse.what());
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& fault) {
      return Store(
          function, FORK1S_ERROR_INTERNAL,
          std::string("an error of the library itself (") + fault.what() + "); report it with the model");
    } catch (...) {
      return Store(function, FORK1S_ERROR_INTERNAL,
                   "an error of the library itself; report it with the model");
    }
  } catch (...) {
    last_message = "out of memory; free simulations and snapshots, or simplify the model";
    return FORK1S_ERROR_MEMORY;
  }
}

void RequireGiven(const void* pointer, const char* argument) {
  if (!pointer) Misuse(std::string(argument) + " is NULL; give what it is to point to");
}

void RequireLength(const void* array, std::size_t length, std::size_t count, const char* argument) {
  if (length != count)
    Misuse(std::string(argument) + " has length " + std::to_string(length) + " and needs " +
           std::to_string(count));
  if (count > 0) RequireGiven(array, argument);
}

std::size_t RequireIndex(const char* what, std::int32_t index, std::size_t count) {
  if (index < 0 || static_cast<std::size_t>(index) >= count)
    Misuse(std::string(what) + ' ' + std::to_string(index) + " of " + std::to_string(count) +
           "; indices count from 0");
  return static_cast<std::size_t>(index);
}

}  // namespace fork1s::c

extern "C" {

int32_t fork1s_version(void) { return FORK1S_C_VERSION; }
const char* fork1s_version_text(void) { return FORK1S_VERSION; }
const char* fork1s_last_error(void) { return fork1s::c::last_message; }

}  // extern "C"
