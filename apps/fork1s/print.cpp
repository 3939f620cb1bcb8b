#include "print.hpp"

#include "base/utf8.hpp"

namespace fork1s::app {
namespace {

bool IsControl(char32_t code) {
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
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(letter.code));
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
