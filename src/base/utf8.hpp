// Letters of a text in UTF-8 (RFC 3629).
#pragma once

#include <cstddef>
#include <string_view>

namespace fork1s {

struct Letter {
  std::size_t bytes = 0;  // 0: no UTF-8
  char32_t code = 0;
};

/// What stands for a byte that is no UTF-8.
inline constexpr char32_t kReplacementLetter = 0xFFFD;

/// The first letter of a text that is not empty. Overlong forms, surrogates and codes above U+10FFFF are no UTF-8.
inline Letter FirstLetter(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const char32_t first = byte(0);
  if (first < 0x80) return {1, first};
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < bytes) return {};
  char32_t code = first & (0x7Fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0u) != 0x80u) return {};
    code = code << 6 | (byte(i) & 0x3Fu);
  }
  const char32_t least = bytes == 4 ? 0x10000 : bytes == 3 ? 0x800 : 0x80;
  if (code < least || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return {};
  return {bytes, code};
}

}  // namespace fork1s
