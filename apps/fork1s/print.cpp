#include "print.hpp"

#include <cstddef>

namespace fork1s::app {
namespace {

struct Letter {
  std::size_t bytes = 0;  // 0: no UTF-8
  unsigned code = 0;
};

// The first letter of a text in UTF-8 that is not empty; overlong and surrogate forms are not looked for.
Letter FirstLetter(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned first = byte(0);
  if (first < 0x80) return {1, first};
  const std::size_t bytes = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || text.size() < bytes) return {};
  unsigned code = first & (0x7Fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0u) != 0x80u) return {};
    code = code << 6 | (byte(i) & 0x3Fu);
  }
  return {bytes, code};
}

bool IsControl(unsigned code) {
  if (code == '\n' || code == '\t') return false;
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x061C || code == 0x200E || code == 0x200F ||
         (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

}  // namespace

std::string EscapeControls(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Letter letter = FirstLetter(text);
    if (letter.bytes == 0)
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[0]));
    else if (IsControl(letter.code))
      out += fmt::format("\\u{:04x}", letter.code);
    else
      out += text.substr(0, letter.bytes);
    text.remove_prefix(letter.bytes == 0 ? 1 : letter.bytes);
  }
  return out;
}

void WriteText(std::FILE* stream, std::string_view text) {
  const std::string safe = EscapeControls(text);
  static_cast<void>(std::fwrite(safe.data(), 1, safe.size(), stream));
}

}  // namespace fork1s::app
