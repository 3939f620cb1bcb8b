// Names that differ by case alone.
#pragma once

#include <string>

namespace fork1s {

/// The letters A to Z of a text as a to z, whatever the locale.
inline std::string LowerCase(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + ('a' - 'A'));
  return text;
}

}  // namespace fork1s
