#include "inspect_folder.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fstream>

#include "output.hpp"
#include "print.hpp"
#include "study/posed_mechanism.hpp"

namespace fork1s::app {
namespace {

namespace fs = std::filesystem;

// Files that may be models: URDF, and MJCF that is not only there to be included.
bool IsModel(const fs::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".urdf") return true;
  if (extension != ".xml" && extension != ".mjcf") return false;
  std::ifstream stream(path);
  if (!stream) return true;  // its row says why it cannot be read
  const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  return text.find("<mujoco") != std::string::npos && text.find("<mujocoinclude") == std::string::npos &&
         (text.find("<worldbody") != std::string::npos || text.find("<include") != std::string::npos);
}

Expected<std::vector<fs::path>> ModelsBelow(const std::string& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  const auto options = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator it(folder, options, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored) && IsModel(it->path())) found.push_back(it->path());
  }
  if (error) return Fail(ErrorCode::kFile, folder, fmt::format("cannot be listed: {}", error.message()));
  std::sort(found.begin(), found.end());
  return found;
}

void Simulate(const ImportedScene& imported, double time, Json& row) {
  SimulationOptions options;
  options.initial_keyframe = imported.initial_keyframe;
  auto simulation = Simulation::Create(imported.scene, options);
  if (!simulation) {
    row["ran"] = simulation.error().Text();
    return;
  }
  int reduced = 0;
  for (const auto& m : simulation->world().mechanisms()) reduced += m.model().size();
  row["reduced_coordinates"] = reduced;
  if (time <= 0) return;
  double gap = 0, deepest = 0;
  std::vector<double> spent;
  int unconverged = 0;
  const auto steps = static_cast<std::int64_t>(std::llround(time / simulation->dt()));
  for (std::int64_t i = 0; i < steps; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const StepReport report = simulation->Step();
    spent.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    if (!report.finite) {
      row["ran"] = fmt::format("not finite at {:.4g} s", simulation->time());
      return;
    }
    gap = std::max(gap, simulation->JointGap());
    unconverged += report.IsSolved() ? 0 : 1;
    deepest = std::max(deepest, report.max_penetration);
  }
  std::nth_element(spent.begin(), spent.begin() + static_cast<std::ptrdiff_t>(spent.size() / 2), spent.end());
  row["ran"] = "to the end";
  row["joint_gap_max_m"] = gap;
  row["penetration_max_m"] = deepest;
  row["unconverged_steps"] = unconverged;
  row["step_us_median"] = spent.empty() ? 0 : spent[spent.size() / 2];
}

Json Summarize(const ModelArguments& arguments, double time) {
  Json row;
  const auto imported = arguments.Load();
  row["opens"] = static_cast<bool>(imported);
  if (!imported) {
    row["error"] = imported.error().Text();
    return row;
  }
  int coordinates = 0;
  std::size_t loops = 0;
  const auto posed = PoseMechanisms(*imported);
  if (!posed) {
    row["opens"] = false;
    row["error"] = posed.error().Text();
    return row;
  }
  for (const PosedMechanism& p : *posed) {
    coordinates += p.mechanism->num_coordinates();
    loops += p.mechanism->definition().closures.size() + p.mechanism->definition().couplings.size();
  }
  row["coordinates"] = coordinates;
  row["loops"] = loops;
  row["free_bodies"] = imported->scene.free_bodies.size();
  row["dropped"] = Json::array();
  for (const ImportNote& note : imported->report.notes)
    if (note.kind == ImportNote::Kind::kDropped) row["dropped"].push_back(note.where);
  Simulate(*imported, time, row);
  return row;
}

// One file in a process of its own, so that a file that brings its reader down costs one row of the table.
Json LookApart(const ModelArguments& arguments, double time) {
  int ends[2];
  if (pipe(ends) != 0) return Summarize(arguments, time);
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) {
    close(ends[0]), close(ends[1]);
    return Summarize(arguments, time);
  }
  if (child == 0) {
    close(ends[0]);
    const std::string text = ToText(Summarize(arguments, time));
    for (std::size_t at = 0; at < text.size();) {
      const ssize_t wrote = write(ends[1], text.data() + at, text.size() - at);
      if (wrote <= 0) break;
      at += static_cast<std::size_t>(wrote);
    }
    _exit(0);
  }
  close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t got = 0; (got = read(ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  Json row = Json::parse(text, nullptr, false);
  if (!row.is_discarded() && WIFEXITED(status)) return row;
  return {{"opens", false},
          {"error", WIFSIGNALED(status) ? fmt::format("the reader crashed: {}", strsignal(WTERMSIG(status)))
                                        : std::string("the reader ended without a word")}};
}

std::string Join(const Json& list) {
  std::string all;
  for (const Json& item : list) all += (all.empty() ? "" : "; ") + item.get<std::string>();
  return all.empty() ? "nothing" : all;
}

void Print(const Json& row, std::size_t width, bool ran) {
  PrintText("{:<{}}  ", row["file"].get<std::string>(), width);
  if (!row["opens"].get<bool>()) {
    PrintText("refused: {}\n", row["error"].get<std::string>());
    return;
  }
  const auto whole = [&](const char* key) { return row.contains(key) ? row[key].get<int>() : 0; };
  PrintText("{:>5} {:>7} {:>5} {:>5}", whole("coordinates"), whole("reduced_coordinates"), whole("loops"),
            whole("free_bodies"));
  if (ran && row.contains("joint_gap_max_m"))
    PrintText(" {:>9.2g} {:>8.2g} {:>6} {:>8.1f}", 1e3 * row["joint_gap_max_m"].get<double>(),
              1e3 * row["penetration_max_m"].get<double>(), whole("unconverged_steps"),
              row["step_us_median"].get<double>());
  else if (row.contains("ran"))
    PrintText("  {}", row["ran"].get<std::string>());
  PrintText("  {}\n", Join(row["dropped"]));
}

}  // namespace

int InspectFolder(const ModelArguments& given, double time) {
  const auto files = ModelsBelow(given.path);
  if (!files) return Report(files.error(), given.json);
  if (files->empty()) {
    return Report(
        {ErrorCode::kFile, given.path, "no MJCF (.xml, .mjcf) or URDF (.urdf) file is below this folder"},
        given.json);
  }
  Json table = Json::array();
  std::size_t width = 4;
  for (const fs::path& file : *files) width = std::max(width, fs::relative(file, given.path).string().size());
  if (!given.json) {
    PrintText("{:<{}}  {:>5} {:>7} {:>5} {:>5}", "file", width, "coord", "reduced", "loops", "free");
    if (time > 0) PrintText(" {:>9} {:>8} {:>6} {:>8}", "gap mm", "sink mm", "uncnv", "us/step");
    PrintText("  dropped\n");
  }
  int open = 0;
  for (const fs::path& file : *files) {
    ModelArguments one = given;
    one.path = file.string();
    Json row = {{"file", fs::relative(file, given.path).string()}};
    row.update(LookApart(one, time));
    open += row["opens"].get<bool>() ? 1 : 0;
    if (!given.json) Print(row, width, time > 0);
    std::fflush(stdout);
    table.push_back(std::move(row));
  }
  if (given.json)
    PrintText("{}\n", ToText(table, 2));
  else
    PrintText("{} of {} open\n", open, table.size());
  return kDone;
}

}  // namespace fork1s::app
