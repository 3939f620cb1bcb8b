// The error that a run tells of itself beside the error it has, over families of random mechanisms: the second
// table of docs/accuracy.md, section 5.
//
//     build/release/benchmarks/error_families [--seeds N] [--first SEED] [--family NAME] [--truth modes|full]
//                                             [--worst FILE.csv]
//
// N motions (40 unless said), one family after the other; a minute or two.
#include <fmt/format.h>

#include <charconv>
#include <fstream>
#include <lab/error_families.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::error_families {
namespace {

constexpr int kUsage = 3;

int Refuse(const std::string& why) {
  fmt::print(stderr,
             "error_families: {}\nusage: error_families [--seeds N] [--first SEED] [--family NAME] "
             "[--truth modes|full] [--worst FILE.csv]\n",
             why);
  return kUsage;
}

bool ReadNumber(std::string_view text, unsigned& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

int Main(int argc, char** argv) {
  unsigned seeds = 40, first = 1;
  std::string worst;
  ErrorTruth truth = ErrorTruth::kAllModes;
  std::vector<ErrorFamily> families(std::begin(kErrorFamilies), std::end(kErrorFamilies));
  for (int i = 1; i < argc; i += 2) {
    const std::string name = argv[i];
    if (name != "--seeds" && name != "--first" && name != "--family" && name != "--truth" &&
        name != "--worst")
      return Refuse(fmt::format("there is no option '{}'", name));
    if (i + 1 == argc) return Refuse(fmt::format("'{}' needs a value", name));
    const std::string value = argv[i + 1];
    if (name == "--seeds" || name == "--first") {
      unsigned& number = name == "--seeds" ? seeds : first;
      if (!ReadNumber(value, number))
        return Refuse(fmt::format("{} '{}' is not a whole number from 0 on", name, value));
    } else if (name == "--family") {
      families.clear();
      std::string names;
      for (const ErrorFamily family : kErrorFamilies) {
        names += fmt::format("{}'{}'", names.empty() ? "" : ", ", Name(family));
        if (value == Name(family)) families.push_back(family);
      }
      if (families.empty()) return Refuse(fmt::format("there is no family '{}'; there are {}", value, names));
    } else if (name == "--truth") {
      if (value != "modes" && value != "full")
        return Refuse(fmt::format("--truth '{}' is neither 'modes' nor 'full'", value));
      truth = value == "full" ? ErrorTruth::kFull : ErrorTruth::kAllModes;
    } else {
      worst = value;
    }
  }
  auto measured = MeasureErrorFamilies(families, first, seeds, truth);
  if (!measured) {
    fmt::print(stderr, "{}\n", measured.error().Text());
    return 1;
  }
  const std::vector<ErrorCaseResult>& results = *measured;
  fmt::print("{}", ErrorFamiliesMarkdown(results));
  if (!worst.empty()) {
    std::ofstream file(worst);
    file << WorstEstimatesCsv(results);
    if (!file.flush()) return Refuse(fmt::format("--worst '{}' cannot be written", worst));
  }
  return 0;
}

}  // namespace fork1s::benchmarks::error_families
