// A hash that is the same on every machine and in every version of a library.
#pragma once

#include <cstdint>
#include <string_view>

namespace fork1s {

/// FNV-1a of 64 bits; `value` goes on from bytes before.
inline std::uint64_t Fnv1a(std::string_view bytes, std::uint64_t value = 0xcbf29ce484222325ull) {
  for (const char c : bytes) value = (value ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return value;
}

}  // namespace fork1s
