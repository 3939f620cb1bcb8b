// The only way to standard output and standard error, apart from the progress bar.
#pragma once

#include <fmt/format.h>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

namespace fork1s::app {

/// Control characters except newline and tab, direction marks (U+200E, U+202A..., with which a name reads as
/// another) and bytes that are no UTF-8 become \u001b or \x9b: names of files must not command a terminal.
/// Within a string of JSON \u001b is the character itself.
std::string EscapeControls(std::string_view text);

/// Writes `text` escaped. What fails is noticed at the end of the program, by the stream's error flag.
void WriteText(std::FILE* stream, std::string_view text);

template <class... Values>
void PrintText(fmt::format_string<Values...> format, Values&&... values) {
  WriteText(stdout, fmt::format(format, std::forward<Values>(values)...));
}

template <class... Values>
void PrintText(std::FILE* stream, fmt::format_string<Values...> format, Values&&... values) {
  WriteText(stream, fmt::format(format, std::forward<Values>(values)...));
}

}  // namespace fork1s::app
