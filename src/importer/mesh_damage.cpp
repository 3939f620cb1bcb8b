#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <string_view>

#include "mesh_file.hpp"

namespace fork1s::internal {
namespace {

constexpr const char* kWriteAgain = "write the mesh again from the program it comes from";

std::vector<std::string_view> WordsOf(std::string_view line) {
  std::vector<std::string_view> words;
  constexpr const char* kSpace = " \t\r";
  for (std::size_t at = line.find_first_not_of(kSpace); at != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kSpace, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kSpace, end);
  }
  return words;
}

template <class Number>
bool ReadNumber(std::string_view word, Number& value) {
  if (!word.empty() && word[0] == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

// For a message: a word may fill the file.
std::string Short(std::string_view word) {
  constexpr std::size_t kMost = 40;
  return word.size() <= kMost ? std::string(word) : fmt::format("{}...", word.substr(0, kMost));
}

MeshFault AtLine(int line, const std::string& what) {
  return {ErrorCode::kFormat, fmt::format("its line {} has {}", line, what), kWriteAgain};
}

// What a Wavefront file has said up to some line.
struct ObjScan {
  std::string clean;
  long long vertices = 0;
  long long largest = 0;  // index that a face names
  int line_of_largest = 0;
};

std::optional<MeshFault> ScanVertex(ObjScan& scan, const std::vector<std::string_view>& words, int line) {
  if (words.size() < 4) return AtLine(line, "a vertex without three coordinates");
  scan.clean += 'v';
  for (std::size_t i = 1; i < 4; ++i) {
    double value = 0;
    if (!ReadNumber(words[i], value) || !std::isfinite(value))
      return AtLine(line, fmt::format("the coordinate '{}', which is no finite number", Short(words[i])));
    fmt::format_to(std::back_inserter(scan.clean), " {:.9g}", value);  // as many digits as a float has
  }
  scan.clean += '\n';
  ++scan.vertices;
  return std::nullopt;
}

std::optional<MeshFault> ScanFace(ObjScan& scan, const std::vector<std::string_view>& words, int line) {
  if (words.size() < 4)
    return AtLine(line, fmt::format("a face with {} vertices; it needs three", words.size() - 1));
  scan.clean += 'f';
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::string_view word = words[i].substr(0, words[i].find('/'));
    long long index = 0;
    if (!ReadNumber(word, index) || index == 0)
      return AtLine(line,
                    fmt::format("the vertex '{}' in a face, which is no number from 1 up", Short(words[i])));
    // Negative ones count back from the vertex that was written last.
    if (index < 0 && -index > scan.vertices)
      return AtLine(line,
                    fmt::format("a face with vertex {}, and only {} come before it", index, scan.vertices));
    if (index > scan.largest) scan.largest = index, scan.line_of_largest = line;
    fmt::format_to(std::back_inserter(scan.clean), " {}", index > 0 ? index : scan.vertices + 1 + index);
  }
  scan.clean += '\n';
  return std::nullopt;
}

}  // namespace

tl::expected<std::string, MeshFault> CleanObj(const std::string& content) {
  ObjScan scan;
  int line = 0;
  for (std::size_t at = 0; at < content.size();) {
    const int first_line = ++line;
    std::string text;
    while (true) {  // a backslash at the end continues the line
      const std::size_t end = std::min(content.find('\n', at), content.size());
      text.append(content, at, end - at);
      at = end + 1;
      while (!text.empty() && text.back() == '\r') text.pop_back();
      if (text.empty() || text.back() != '\\' || at >= content.size()) break;
      text.back() = ' ';
      ++line;
    }
    const std::vector<std::string_view> words = WordsOf(text);
    if (words.empty()) continue;
    std::optional<MeshFault> fault;
    if (words[0] == "v") fault = ScanVertex(scan, words, first_line);
    if (words[0] == "f") fault = ScanFace(scan, words, first_line);
    if (fault) return tl::unexpected<MeshFault>(std::move(*fault));
  }
  if (scan.largest > scan.vertices)
    return tl::unexpected<MeshFault>(
        AtLine(scan.line_of_largest,
               fmt::format("a face with vertex {}, but the file has {}", scan.largest, scan.vertices)));
  return std::move(scan.clean);
}

std::optional<std::size_t> BinaryStlSize(const std::string& content) {
  constexpr std::size_t kHeader = 84, kTriangle = 50;
  if (content.size() < kHeader) return std::nullopt;
  std::uint32_t count = 0;
  std::memcpy(&count, content.data() + 80, 4);
  const std::size_t size = kHeader + kTriangle * static_cast<std::size_t>(count);
  // Some programs begin binary files with "solid" too: there the count decides.
  const std::size_t first = content.find_first_not_of(" \t\r\n");
  const bool says_text = first != std::string::npos && content.compare(first, 5, "solid") == 0;
  if (says_text && size != content.size()) return std::nullopt;
  return size;
}

std::optional<MeshFault> FindStlDamage(const std::string& content) {
  const std::optional<std::size_t> size = BinaryStlSize(content);
  if (size && *size > content.size()) {
    return MeshFault{ErrorCode::kFormat,
                     fmt::format("it says that it has {} triangles, and there is room for {}",
                                 (*size - 84) / 50, (content.size() - 84) / 50),
                     kWriteAgain};
  }
  const std::size_t first = content.find_first_not_of(" \t\r\n");
  if (!size && (first == std::string::npos || content.compare(first, 5, "solid") != 0)) {
    return MeshFault{ErrorCode::kFormat, "it is neither a binary STL (84 bytes at least) nor one in text",
                     kWriteAgain};
  }
  return std::nullopt;
}

}  // namespace fork1s::internal
