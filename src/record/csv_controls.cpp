#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "base/lower_case.hpp"
#include "base/system_error.hpp"

namespace fork1s {
namespace {

std::string Trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

// Cells of one line; empty where a quote does not end.
std::optional<std::vector<std::string>> Cells(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false, was_quoted = false;
  auto finish = [&] {
    if (!was_quoted) cells.back() = Trimmed(cells.back());
    was_quoted = false;
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
      cells.back() += '"';
      ++i;
    } else if (c == '"' && (quoted || Trimmed(cells.back()).empty())) {
      if (!quoted) cells.back().clear();
      quoted = !quoted;
      was_quoted = true;
    } else if (c == ',' && !quoted) {
      finish();
      cells.emplace_back();
    } else if (quoted || !was_quoted) {
      cells.back() += c;
    }
  }
  if (quoted) return std::nullopt;
  finish();
  return cells;
}

// What a header without a column 'time' lacks. Spreadsheets separate columns by ; where the decimal separator is a
// comma.
std::string NoTimeColumn(const std::vector<std::string>& header) {
  for (const char separator : {';', '\t'}) {
    if (header.size() > 1) break;
    std::istringstream names(header[0]);
    for (std::string name; std::getline(names, name, separator);)
      if (name.size() < header[0].size() && LowerCase(Trimmed(name)) == "time")
        return fmt::format(
            "has {} between its columns; write commas there, as in time,name1,name2, and points in numbers",
            separator == ';' ? "semicolons" : "tabs");
  }
  for (const std::string& name : header)
    if (LowerCase(name) == "time")
      return fmt::format("has no column named 'time' but one named '{}'; write it in lower case", name);
  return "has no column named 'time'; the first line must be a header such as time,name1,name2";
}

// from_chars takes a point whatever the language of the system.
std::optional<double> Number(const std::string& cell) {
  const char* first = cell.data() + (cell.size() > 1 && cell[0] == '+' && cell[1] != '-' ? 1 : 0);
  double value = 0;
  const auto [end, status] = std::from_chars(first, cell.data() + cell.size(), value);
  if (status != std::errc() || end != cell.data() + cell.size()) return std::nullopt;
  return value;
}

}  // namespace

Expected<ControlTrack> ReadControls(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return Fail(ErrorCode::kFile, path, "there is no such file");
  std::ifstream in;
  if (!std::filesystem::is_regular_file(path, error))  // a pipe would be waited for
    return Fail(ErrorCode::kFile, path, "cannot be read; check that it is a file");
  in.open(path, std::ios::binary);
  if (!in.is_open())
    return Fail(ErrorCode::kFile, path, "cannot be read " + CauseAndRemedy(errno, "check its permissions"));

  ControlTrack track;
  std::size_t time_column = 0;
  std::vector<std::string> header;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (number == 1 && line.rfind("\xEF\xBB\xBF", 0) == 0)
      line.erase(0, 3);  // mark that spreadsheets put first
    const std::string content = Trimmed(line);
    if (content.empty() || content[0] == '#') continue;
    auto refuse = [&](const std::string& what) {
      return Fail(ErrorCode::kFormat, fmt::format("{}, line {}", path, number), what);
    };
    const auto cells = Cells(content);
    if (!cells) return refuse("has a quote that does not end");

    if (header.empty()) {
      header = *cells;
      const auto time = std::find(header.begin(), header.end(), "time");
      if (time == header.end()) return refuse(NoTimeColumn(header));
      time_column = static_cast<std::size_t>(time - header.begin());
      std::set<std::string_view> named;
      for (std::size_t k = 0; k < header.size(); ++k) {
        if (header[k].empty()) return refuse(fmt::format("column {} has no name", k + 1));
        if (!named.insert(header[k]).second)
          return refuse(fmt::format("names the column '{}' twice", header[k]));
        if (k != time_column) track.names.push_back(header[k]);
      }
      if (track.names.empty()) return refuse("names no control beside the time");
      continue;
    }
    if (cells->size() != header.size())
      return refuse(fmt::format("has {} cells; the header has {}", cells->size(), header.size()));
    double time = 0;
    std::vector<double> row;
    for (std::size_t k = 0; k < header.size(); ++k) {
      const auto value = Number((*cells)[k]);
      if (!value)
        return refuse(fmt::format("column '{}' holds '{}', which is no number", header[k], (*cells)[k]));
      if (!std::isfinite(*value))
        return refuse(fmt::format("column '{}' holds {}; give finite numbers", header[k], (*cells)[k]));
      if (k == time_column)
        time = *value;
      else
        row.push_back(*value);
    }
    if (!track.times.empty() && !(time > track.times.back()))
      return refuse(
          fmt::format("has the time {} s after {} s; times must increase", time, track.times.back()));
    track.times.push_back(time);
    track.rows.push_back(std::move(row));
  }
  if (in.bad()) return Fail(ErrorCode::kFile, path, "cannot be read to its end");
  if (header.empty())
    return Fail(ErrorCode::kFormat, path,
                "is empty; write a header such as time,name1,name2 and at least one row");
  if (track.times.empty())
    return Fail(ErrorCode::kFormat, path, "has a header but no row; write at least one");
  return track;
}

}  // namespace fork1s
