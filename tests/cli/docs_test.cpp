// Pages that a reader follows word by word: their files are written, their commands run in order in one
// folder, and every line of output that they show is said today, but for what a clock said.
#include <cmath>
#include <optional>
#include <regex>
#include <string>
#include <vector>

#include "command.hpp"

namespace fork1s::test {
namespace {

struct PageFence {
  std::string kind, name;  // the name that the text before it gives a file
  std::vector<std::string> lines;
};

std::vector<PageFence> FencesOf(const std::string& page) {
  std::vector<PageFence> fences;
  std::stringstream text(page);
  std::string said;  // what was last put in backticks before a fence
  bool inside = false;
  for (std::string line; std::getline(text, line);) {
    if (line.rfind("```", 0) == 0) {
      inside = !inside;
      if (inside) fences.push_back({line.substr(3), said, {}});
      continue;
    }
    if (inside) {
      fences.back().lines.push_back(line);
      continue;
    }
    static const std::regex kSave("[Ss]ave this as `([^`]+)`");
    if (std::smatch found; std::regex_search(line, found, kSave)) said = found[1];
  }
  EXPECT_FALSE(inside) << "a fence is never closed";
  return fences;
}

// Words and numbers of a line; a number stands as '#' among the words.
std::pair<std::string, std::vector<double>> Taken(const std::string& line) {
  static const std::regex kNumber("[-+]?(\\d+\\.?\\d*|\\.\\d+)([eE][-+]?\\d+)?"), kBlanks("\\s+");
  std::vector<double> numbers;
  for (std::sregex_iterator at(line.begin(), line.end(), kNumber), end; at != end; ++at)
    numbers.push_back(std::stod(at->str()));
  return {std::regex_replace(std::regex_replace(line, kNumber, "#"), kBlanks, " "), numbers};
}

bool SaysTheSame(const std::string& shown, const std::string& said) {
  const auto [words, numbers] = Taken(shown);
  const auto [other_words, others] = Taken(said);
  if (words != other_words) return false;
  if (shown.find("times real time") != std::string::npos) return true;
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (std::abs(numbers[i] - others[i]) > 0.02 * std::abs(numbers[i]) + 2e-5) return false;
  return true;
}

bool IsSaid(const std::string& line, const Outcome& o) {
  for (const std::string* stream : {&o.out, &o.err}) {
    std::stringstream text(*stream);
    for (std::string said; std::getline(text, said);)
      if (SaysTheSame(line, said)) return true;
  }
  return false;
}

void FollowPage(const std::string& name) {
  const std::filesystem::path source = FORK1S_SOURCE_DIR, folder = ScratchFolder() / name;
  std::filesystem::create_directories(folder);
  std::filesystem::create_directory_symlink(source / "scenes", folder / "scenes");
  int commands = 0, shown = 0;
  for (const PageFence& fence : FencesOf(Slurp(source / "docs" / name))) {
    if (fence.kind != "console") {
      ASSERT_FALSE(fence.name.empty()) << "no name for a fence of " << fence.kind;
      std::ofstream file(folder / fence.name);
      for (const std::string& line : fence.lines) file << line << '\n';
      continue;
    }
    Outcome o;
    bool skipped = false;
    for (const std::string& line : fence.lines) {
      if (line.rfind("$ python3 ", 0) == 0) {
        skipped = true;  // followed where the Python package is installed: tests/python/extras/test_fit.py
      } else if (line.rfind("$ ", 0) == 0) {
        std::string command = line.substr(2);
        if (command.rfind("fork1s ", 0) == 0) command = FORK1S_BINARY + command.substr(6);
        // Whoever reads the page has a browser, and ends the session himself.
        if (line.rfind("$ fork1s view ", 0) == 0) command += " --no-open --port 0 --time 0.2";
        o = Shell("cd '" + folder.string() + "' && " + command);
        skipped = o.err.find("built without its page") != std::string::npos;
        EXPECT_TRUE(o.code == 0 || skipped) << line << "\n" << o.err;
        ++commands;
      } else if (line != "..." && !skipped) {
        EXPECT_TRUE(IsSaid(line, o)) << "docs/" << name << " shows\n"
                                     << line << "\nand the program says\n"
                                     << o.out << o.err;
        ++shown;
      }
    }
  }
  EXPECT_GE(commands, 5);
  EXPECT_GE(shown, 10);
}

TEST(Docs, TheGripperPageSaysWhatRuns) { FollowPage("gripper_in_ten_minutes.md"); }
TEST(Docs, TheHandPageSaysWhatRuns) { FollowPage("hand_stiffness.md"); }
TEST(Docs, TheQuadrupedPageSaysWhatRuns) { FollowPage("urdf_quadruped.md"); }

// Text of the section "### HEADING" of a page.
std::string SectionOf(const std::string& page, const std::string& heading) {
  const std::size_t begin = page.find("\n### " + heading + "\n");
  if (begin == std::string::npos) return {};
  return page.substr(begin, page.find("\n##", begin + 5) - begin);
}

TEST(Docs, EveryKeyOfJsonHasARowInItsTable) {
  const std::string page = Slurp(std::filesystem::path(FORK1S_SOURCE_DIR) / "docs" / "formats.md");
  const std::string model = Write("finger.xml", FingerModel());
  const std::pair<const char*, std::string> commands[] = {
      {"inspect", ""},
      {"reduce", "--point tip:0,0,0 --along 1,0,0"},
      {"statics", "--body tip --force 0,0,0.01 --buckling 1"},
      {"run", "--time 0.05 --error"}};
  for (const auto& [command, options] : commands) {
    const Outcome o = Fork1s(std::string(command) + " --json " + model + " " + options);
    ASSERT_EQ(o.code, 0) << o.err;
    const std::string section = SectionOf(page, command);
    const auto check = [&](const nlohmann::json& object, const std::string& parent) {
      for (const auto& [key, value] : object.items())
        EXPECT_TRUE(section.find("`" + key + "`") != std::string::npos ||
                    section.find("`" + parent + "." + key + "`") != std::string::npos)
            << parent << " " << key << " is not in docs/formats.md, section " << command;
    };
    const auto json = o.Json();
    check(json, "");
    for (const char* part : {"loaded", "coordinates", "assumed", "energy_J", "contact_solver"})
      if (json.contains(part)) check(json[part], part);
    if (json.contains("points")) {
      check(json["points"][0], "points");
      check(json["points"][0]["springs"], "points.springs");
    }
    if (json.contains("mechanisms")) {
      check(json["mechanisms"][0], "mechanisms");
      if (json["mechanisms"][0].contains("gain")) check(json["mechanisms"][0]["gain"], "gain");
    }
  }
}

// Cells of a row of a table: the first is what the row is of.
std::vector<std::string> CellsOf(const std::string& line) {
  std::vector<std::string> cells;
  std::stringstream text(line.substr(1));
  for (std::string cell; std::getline(text, cell, '|');) {
    const std::size_t begin = cell.find_first_not_of(' ');
    cells.push_back(begin == std::string::npos ? ""
                                               : cell.substr(begin, cell.find_last_not_of(' ') + 1 - begin));
  }
  return cells;
}

// What a row of a scene's table says, in its unit, as the run has it.
std::optional<double> FigureOf(const std::string& row, const nlohmann::json& run) {
  const auto begins = [&](const char* text) { return row.rfind(text, 0) == 0; };
  if (begins("contacts at most")) return run["contacts_max"].get<double>();
  if (begins("penetration at most")) return 1e3 * run["penetration_max_m"].get<double>();
  if (begins("loop gap at most") || begins("joint gap at most"))
    return 1e3 * run["joint_gap_max_m"].get<double>();
  if (begins("steps not converged")) return run["unconverged_steps"].get<double>();
  if (begins("steps halved for an impact")) return run["halved_steps"]["impact"].get<double>();
  if (begins("refreshes")) return run["refreshes"].get<double>();
  if (begins("load factor at least") && run["load_factor_min"].is_number())
    return run["load_factor_min"].get<double>();
  return std::nullopt;
}

// How much a figure of a run may be off the cell that shows it. Processors round otherwise, and heaps, gaits and
// blows multiply that: counts may be off by a tenth and two, lengths and load factors by a fifth, gaps by a half.
// No step unsolved means none, on every processor.
double AllowedDifference(const std::string& row, const std::string& cell) {
  const double shown = std::stod(cell);
  if (row.rfind("steps not converged", 0) == 0 && shown == 0) return 0;
  if (row.find("gap") != std::string::npos) return 0.5 * shown;
  const bool is_count =
      cell.find_first_not_of("0123456789") == std::string::npos && row.rfind("load", 0) != 0;
  return is_count ? 2 + 0.1 * shown : 0.2 * shown;
}

TEST(Docs, NoUnsolvedStepMeansNone) {
  EXPECT_EQ(AllowedDifference("steps not converged, of 720", "0"), 0);
  EXPECT_EQ(AllowedDifference("steps not converged", "10"), 3);
  EXPECT_EQ(AllowedDifference("contacts at most", "10"), 3);
  EXPECT_EQ(AllowedDifference("refreshes", "0"), 2);
  EXPECT_DOUBLE_EQ(AllowedDifference("loop gap at most [mm]", "0.2"), 0.1);
  EXPECT_DOUBLE_EQ(AllowedDifference("load factor at least", "5"), 1);
}

// Tables of scenes beside the first command above them: the rows that FigureOf knows.
TEST(Docs, TablesOfScenesSayWhatTheirCommandsSay) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "ten seconds of runs without a sanitizer, and other digits with one";
#endif
  const std::filesystem::path source = FORK1S_SOURCE_DIR;
  int tables = 0, figures = 0;
  for (const auto& page : std::filesystem::directory_iterator(source / "docs" / "scenes")) {
    if (page.path().extension() != ".md") continue;
    std::string command;
    std::vector<nlohmann::json> runs;  // a column each, empty of columns that are of something else
    std::stringstream text(Slurp(page.path()));
    for (std::string line; std::getline(text, line);) {
      if (command.empty() && line.rfind("    fork1s run scenes/", 0) == 0) command = line.substr(11);
      if (line.empty() || line[0] != '|') {
        runs.clear();
        continue;
      }
      const std::vector<std::string> cells = CellsOf(line);
      if (cells.size() > 1 && cells[1] == "own stiffness") {
        ASSERT_FALSE(command.empty()) << page.path();
        ++tables;
        for (std::size_t i = 1; i < cells.size(); ++i) {
          const std::string scale =
              cells[i].rfind("x ", 0) == 0 ? " --stiffness-scale " + cells[i].substr(2) : "";
          const Outcome o =
              Shell("cd '" + source.string() + "' && " + FORK1S_BINARY + " " + command + scale + " --json");
          ASSERT_EQ(o.code, 0) << command << scale << "\n" << o.err;
          runs.push_back(o.Json());
        }
        continue;
      }
      for (std::size_t i = 1; i < cells.size() && i <= runs.size(); ++i) {
        const std::optional<double> now = FigureOf(cells[0], runs[i - 1]);
        if (!now || cells[i].empty()) continue;
        ++figures;
        EXPECT_NEAR(std::stod(cells[i]), *now, AllowedDifference(cells[0], cells[i]))
            << page.path().filename() << ", '" << cells[0] << "', column " << i << " of fork1s " << command;
      }
    }
  }
  EXPECT_GE(tables, 9);
  EXPECT_GE(figures, 60);
}

// FollowPage finds what is out of date: a line with another word or number is not what was said.
TEST(Docs, AnotherNumberIsNotTheSame) {
  EXPECT_TRUE(SaysTheSame("  held by 7.31 N,  0.0000 mm", "  held by 7.312 N, -0.00001 mm"));
  EXPECT_FALSE(SaysTheSame("  held by 7.31 N", "  held by 7.51 N"));
  EXPECT_FALSE(SaysTheSame("  held by 7.31 N", "  kept by 7.31 N"));
}

}  // namespace
}  // namespace fork1s::test
