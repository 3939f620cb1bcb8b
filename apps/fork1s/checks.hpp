// What is asked of arguments before anything is read or written.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <fork1s/base/error.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::app {

/// Numbers of this program are far smaller; what is larger is a slip, or would overflow when it is squared.
inline constexpr double kMostNumber = 1e12;
inline constexpr double kMostSeconds = 1e9;  // 30 years
inline constexpr double kMostStep = 1000;    // s

/// A finite number from `least` to `most`. CLI11's own checks compare, and nan passes every comparison.
CLI::Validator NumberWithin(double least, double most);
/// The same above 0.
CLI::Validator PositiveUpTo(double most);
/// The same of times in s: numbers or quotients of two, such as 1/60, which become numbers. For Option::transform.
CLI::Validator SecondsWithin(double least, double most);
CLI::Validator PositiveSecondsUpTo(double most);
/// One of these words; the message has near ones.
CLI::Validator OneOf(std::vector<std::string> words);
/// The same, and the number of the enumerator in place of the word, as CLI11 reads enumerations. Any case.
template <class Value>
CLI::Validator OneOf(const std::map<std::string, Value>& values) {
  std::vector<std::string> words;
  for (const auto& [word, value] : values) words.push_back(word);
  const CLI::Validator known = OneOf(std::move(words));
  return CLI::Validator(
      [values, known](std::string& text) {
        for (const auto& [word, value] : values)
          if (CLI::detail::to_lower(word) == CLI::detail::to_lower(text)) {
            text = std::to_string(static_cast<int>(value));
            return std::string();
          }
        return known(text);
      },
      "WORD");
}
/// The number that a text is, if it is one, finite and no larger than kMostNumber. Errors: kUsage.
Expected<double> ParseNumber(const std::string& text, const std::string& option);

/// Steps of `dt` that make `time`. Errors: kUsage where they are more than can be counted.
Expected<std::int64_t> CountSteps(double time, double dt);

/// Whether the file begins as recordings do; false where it cannot be read.
bool IsHdf5(const std::string& path);

/// Refuses to write to a file that the same command reads, by whatever name. Errors: kUsage.
Expected<void> RefuseInputs(const std::string& out, const std::vector<std::string>& inputs);

}  // namespace fork1s::app
