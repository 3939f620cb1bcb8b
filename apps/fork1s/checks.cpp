#include "checks.hpp"
#include "base/near_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string_view>

namespace fork1s::app {
namespace {

// Also "nan" and "inf": they are numbers, and the message says what is wrong with them.
bool ReadNumber(const std::string& text, double& value) {
  char* end = nullptr;
  value = std::strtod(text.c_str(), &end);
  return !text.empty() && end == text.c_str() + text.size() && text.find_first_of(" \t\n") != 0;
}

// A number, or a quotient of two.
bool ReadSeconds(const std::string& text, double& value) {
  const std::size_t slash = text.find('/');
  if (slash == std::string::npos) return ReadNumber(text, value);
  double divisor = 0;
  if (!ReadNumber(text.substr(0, slash), value) || !ReadNumber(text.substr(slash + 1), divisor)) return false;
  value /= divisor;
  return true;
}

// `read` understands `what`; its text of a quotient has all digits of the value.
CLI::Validator Check(bool (*read)(const std::string&, double&), const std::string& what,
                     const std::string& range, std::function<bool(double)> holds) {
  return CLI::Validator(
      [read, what, range, holds = std::move(holds)](std::string& text) {
        double value = 0;
        if (!read(text, value) || !std::isfinite(value) || !holds(value))
          return fmt::format("'{}' is no {} {}", text, what, range);
        if (text.find('/') != std::string::npos) text = fmt::format("{}", value);
        return std::string();
      },
      "NUMBER");
}

CLI::Validator CheckNumber(const std::string& range, std::function<bool(double)> holds) {
  return Check(ReadNumber, "number", range, std::move(holds));
}
CLI::Validator CheckSeconds(const std::string& range, std::function<bool(double)> holds) {
  return Check(ReadSeconds, "number of seconds, nor a quotient such as 1/60,", range, std::move(holds));
}

std::string ClosedRange(double least, double most) { return fmt::format("from {:g} to {:g}", least, most); }
std::string PositiveRange(double most) { return fmt::format("above 0 and up to {:g}", most); }

}  // namespace

CLI::Validator NumberWithin(double least, double most) {
  return CheckNumber(ClosedRange(least, most), [least, most](double v) { return v >= least && v <= most; });
}

CLI::Validator PositiveUpTo(double most) {
  return CheckNumber(PositiveRange(most), [most](double v) { return v > 0 && v <= most; });
}

CLI::Validator SecondsWithin(double least, double most) {
  return CheckSeconds(ClosedRange(least, most), [least, most](double v) { return v >= least && v <= most; });
}

CLI::Validator PositiveSecondsUpTo(double most) {
  return CheckSeconds(PositiveRange(most), [most](double v) { return v > 0 && v <= most; });
}

CLI::Validator OneOf(std::vector<std::string> words) {
  return CLI::Validator(
      [words = std::move(words)](const std::string& text) {
        if (std::find(words.begin(), words.end(), text) != words.end()) return std::string();
        return fmt::format("'{}' is none of {}{}", text, Quoted(words, words.size()),
                           NearNames(text, words).empty() ? "" : Suggestion(text, words));
      },
      "WORD");
}

Expected<double> ParseNumber(const std::string& text, const std::string& option) {
  double value = 0;
  if (!ReadNumber(text, value) || !std::isfinite(value))
    return Fail(ErrorCode::kUsage, option, fmt::format("'{}' is not a finite number", text));
  if (std::abs(value) > kMostNumber)
    return Fail(ErrorCode::kUsage, option,
                fmt::format("'{}' is beyond {:g}, which no quantity here can be", text, kMostNumber));
  return value;
}

Expected<std::int64_t> CountSteps(double time, double dt) {
  const double steps = std::round(time / dt);
  constexpr double kMost = std::numeric_limits<int>::max();
  if (!(steps <= kMost))
    return Fail(ErrorCode::kUsage, "--time",
                fmt::format("{:g} s are {:.3g} steps of {:g} s, and {:.0f} is the most; shorten --time or "
                            "lengthen --dt",
                            time, steps, dt, kMost));
  return static_cast<std::int64_t>(steps);
}

bool IsHdf5(const std::string& path) {
  static constexpr std::string_view kSignature = "\211HDF\r\n\032\n";
  std::string start(kSignature.size(), ' ');
  std::ifstream file(path, std::ios::binary);
  return file.read(start.data(), static_cast<std::streamsize>(start.size())) && start == kSignature;
}

Expected<void> RefuseInputs(const std::string& out, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code none;
    if (out.empty() || input.empty() || !std::filesystem::equivalent(out, input, none)) continue;
    return Fail(
        ErrorCode::kUsage, out,
        fmt::format("would be overwritten, and it is '{}' that this command reads; choose another name",
                    input));
  }
  return {};
}

}  // namespace fork1s::app
