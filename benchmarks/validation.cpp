// Writes docs/validation.md: known answers and the oracle's cases, each number by several methods.
//
//     build/release/benchmarks/validation [--oracle DIR] [--out docs/validation.md]
//
// DIR holds the oracle's cases (NAME.xml with NAME.json); without it, or where it is not there, the table of
// a page that exists already is kept. Ends with 1 if a known answer is missed.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <lab/known_answers.hpp>
#include <lab/oracle.hpp>
#include <map>
#include <string>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::validation {
namespace {

const char* const kOracleTitle = "## Oracle cases\n";

// What is below 1e-10 of `scale` is rounding, which differs between machines and would change the page.
std::string Deviation(double d, double scale = 1) {
  const double rounding = 1e-10 * scale;
  return std::abs(d) < rounding ? fmt::format("< {:.0e}", rounding) : fmt::format("{:.1e}", std::abs(d));
}

std::string Number(double x) { return std::abs(x) < 1e-10 ? "0" : fmt::format("{:.8g}", x); }

// Distinct texts become numbered footnotes.
class Footnotes {
 public:
  int Of(const std::string& text) {
    for (std::size_t i = 0; i < texts_.size(); ++i)
      if (texts_[i] == text) return static_cast<int>(i) + 1;
    texts_.push_back(text);
    return static_cast<int>(texts_.size());
  }
  std::string List() const {
    std::string out;
    for (std::size_t i = 0; i < texts_.size(); ++i) out += fmt::format("{}. {}\n", i + 1, texts_[i]);
    return out;
  }

 private:
  std::vector<std::string> texts_;
};

std::string Introduction() {
  return "# Is it right?\n\n"
         "Two questions are asked here. Does the program reproduce answers that are known, in closed form "
         "or\n"
         "published? And do independent computations of the same number agree? Each row has a number by "
         "several\n"
         "methods: the *reduced* simulator (`Simulation`, what users run), the *full*-coordinate one\n"
         "(`FullSimulation`, which shares no reduction, recovery, contact or dynamics code with it), and in "
         "the "
         "second\n"
         "table MuJoCo.\n\n"
         "`build/release/benchmarks/validation --oracle DIR --out docs/validation.md` writes this page. The "
         "test\n"
         "`lab` asks the same questions, the long runs with longer steps and wider tolerances.\n\n"
         "Both simulators take steps of backward Euler, which is of first order: its error at a step h is\n"
         "proportional to h. Where more digits are published than one run can reach, runs at h, h/2, h/4 and "
         "h/8\n"
         "are extrapolated to h = 0 (Richardson); the row then shows that the scheme converges to the right\n"
         "motion, not that a run at 1/60 s has these digits.\n\n";
}

// Returns the number of answers that were missed; -1 for an error.
int WriteKnownAnswers(std::string& page) {
  int missed = 0;
  Footnotes notes;
  page +=
      "## Known answers\n\n"
      "The deviation is the larger of the two methods', in the unit of the row; it must stay within the\n"
      "tolerance, for the reason numbered behind it. \"Missed\" marks a deviation that does not.\n\n";
  for (const KnownAnswerCase& c : KnownAnswerCases()) {
    std::fprintf(stderr, "%s\n", c.name);
    const auto rows = c.run(Refinement::kFine);
    if (!rows) {
      std::fprintf(stderr, "validation: %s: %s\n", c.name, rows.error().Text().c_str());
      return -1;
    }
    page += fmt::format("### {}\n\nExpected: {}", c.title, rows->front().source);
    for (std::size_t i = 1; i < rows->size(); ++i) {
      bool seen = false;
      for (std::size_t k = 0; k < i; ++k) seen = seen || (*rows)[k].source == (*rows)[i].source;
      if (!seen) page += "; " + (*rows)[i].source;
    }
    page +=
        ".\n\n| quantity | unit | expected | reduced | full | deviation | tolerance |\n"
        "|---|---|---|---|---|---|---|\n";
    // Rows of one quantity follow each other, one a method.
    for (std::size_t i = 0; i < rows->size();) {
      const KnownAnswer& first = (*rows)[i];
      std::map<std::string, std::string> measured{{"reduced", "–"}, {"full", "–"}};
      double deviation = 0;
      bool holds = true;
      for (; i < rows->size() && (*rows)[i].quantity == first.quantity; ++i) {
        const KnownAnswer& row = (*rows)[i];
        measured[row.method] = Number(row.measured);
        deviation = std::max(deviation, std::abs(row.measured - row.expected));
        if (!row.Holds()) {
          ++missed;
          holds = false;
          std::fprintf(stderr, "validation: missed: %s, %s, %s: %.9g instead of %.9g\n", c.name,
                       row.quantity.c_str(), row.method.c_str(), row.measured, row.expected);
        }
      }
      page += fmt::format(
          "| {} | {} | {} | {} | {} | {}{} | {} ({}) |\n", first.quantity, first.unit, Number(first.expected),
          measured["reduced"], measured["full"],
          Deviation(deviation, first.expected != 0 ? std::abs(first.expected) : 1), holds ? "" : ", missed",
          first.tolerance > 0 ? fmt::format("{:.1e}", first.tolerance) : "0", notes.Of(first.why_tolerance));
    }
    page += "\n";
  }
  page += "Why these tolerances:\n\n" + notes.List() + "\n";
  return missed;
}

bool WriteOracle(const std::string& folder, std::string& page) {
  Footnotes notes;
  auto cell = [&](const OracleDeviation& d) {
    return d.value ? Deviation(*d.value) : fmt::format("– ({})", notes.Of(d.why_not));
  };
  page += kOracleTitle;
  page +=
      "\nMechanisms whose numbers were computed apart from this program, twice each. Reduced, full and "
      "MuJoCo\n"
      "(" FORK1S_MUJOCO_VERSION
      ") are deviations from the oracle: the largest, as a share of the largest number compared. "
      "Statics\n"
      "are poses of the full mechanism at rest under dead loads, compared as a share of the motion. The "
      "reduced\n"
      "method steps with four modes until it rests, the full one takes a step so long that only springs "
      "count,\n"
      "MuJoCo's forces and constraint residuals are brought to zero by Newton's method.\n\n"
      "| case | quantity | oracle | reduced | full | MuJoCo |\n|---|---|---|---|---|---|\n";
  for (const std::string& name : OracleCases(folder)) {
    std::fprintf(stderr, "%s\n", name.c_str());
    const auto rows = CompareWithOracle(folder, name);
    if (!rows) {
      std::fprintf(stderr, "validation: %s: %s\n", name.c_str(), rows.error().Text().c_str());
      return false;
    }
    for (const OracleRow& row : *rows)
      page += fmt::format("| {} | {} | {} | {} | {} | {} |\n", row.case_name, row.quantity, row.oracle,
                          cell(row.reduced), cell(row.full), cell(row.mujoco));
  }
  page += "\nWhere a method has no number:\n\n" + notes.List();
  return true;
}

// The oracle's part of a page that was written before; a sentence where there is none.
std::string OracleOf(const std::string& path) {
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const auto at = text.find(kOracleTitle);
  if (at != std::string::npos) return text.substr(at);
  return std::string(kOracleTitle) + "\nThe folder of cases was not there when this page was written.\n";
}

}  // namespace

int Main(int argc, char** argv) {
  std::string oracle, out = "docs/validation.md";
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--oracle") == 0)
      oracle = argv[i + 1];
    else if (std::strcmp(argv[i], "--out") == 0)
      out = argv[i + 1];
    else {
      std::fprintf(stderr, "usage: validation [--oracle DIR] [--out FILE]\n");
      return 2;
    }
  }
  std::string page = Introduction();
  const int missed = WriteKnownAnswers(page);
  if (missed < 0) return 4;
  if (OracleCases(oracle).empty()) {
    std::fprintf(stderr, "validation: no oracle cases; their table is kept as it is\n");
    page += OracleOf(out);
  } else if (!WriteOracle(oracle, page)) {
    return 4;
  }
  std::ofstream file(out);
  if (!(file << page)) {
    std::fprintf(stderr, "validation: '%s' cannot be written\n", out.c_str());
    return 3;
  }
  return missed > 0 ? 1 : 0;
}

}  // namespace fork1s::benchmarks::validation
