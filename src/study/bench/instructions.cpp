#include "instructions.hpp"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

#include "child.hpp"
#include "phases.hpp"
#include "world/step_times.hpp"

namespace fork1s::internal {
namespace {

constexpr double kLongest = 600;  // s, of a scene's steps under valgrind

struct Profile {
  double instructions = 0;
  int steps = 0;
  std::string annotated;  // empty: not asked for
  std::string problem;
};

// Runs the steps with `integrator` and collects within the functions that match `toggle`, and nothing else.
Profile Collect(const BenchOptions& options, const std::string& valgrind, const std::string& toggle,
                const std::string& integrator, bool annotate) {
  Profile out;
  const MemoryFile profile;
  std::vector<std::string> command{valgrind, "--tool=callgrind", "--callgrind-out-file=" + profile.Path(),
                                   "--toggle-collect=" + toggle};
  command.insert(command.end(), options.step_command.begin(), options.step_command.end());
  command.push_back(integrator);
  const ChildEnd end = RunChild(command, kLongest);
  if (!end.done) {
    out.problem = "the steps under valgrind " + end.how;
    return out;
  }
  out.steps = std::atoi(end.out.c_str());
  std::istringstream lines(profile.Read());
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("totals: ")) out.instructions = std::atof(line.c_str() + 8);
  if (out.steps <= 0 || out.instructions <= 0) {
    out.problem = "valgrind counted no step: the program has no symbols, or was built without them";
    return out;
  }
  const std::string annotator = annotate ? FindOnPath("callgrind_annotate") : "";
  if (!annotator.empty())
    out.annotated = RunChild({annotator, "--inclusive=yes", "--threshold=100", profile.Path()}, kLongest).out;
  return out;
}

// What World::Step is made of (src/world/step.cpp, stages.cpp), as callgrind names it.
void SetPhases(const Profile& profile, BenchScene& scene) {
  const auto of = [&](const char* function) {
    return InclusiveInstructions(profile.annotated, function) / profile.steps;
  };
  const double found = of("fork1s::World::Detail::FindContacts("),
               prepared = of("fork1s::World::Detail::PrepareContacts("),
               predicted = of("fork1s::SolveFreeStage("),
               solved = of("fork1s::World::Detail::SolveContacts("),
               begun = of("fork1s::BeginStep(") + of("fork1s::World::Detail::MoveAllToStagePoses("),
               integrated = of("fork1s::World::Detail::MoveAndComputeResiduals(") + of("fork1s::EndStep("),
               refreshed = of("fork1s::Refresh("), all = profile.instructions / profile.steps;
  StepPartTimes parts;  // instructions, of the same parts
  parts.finding = found;
  parts.rows = std::max(0.0, prepared - found);
  parts.free_velocities = predicted;
  parts.solving = solved;
  parts.moving = begun + integrated;
  parts.refreshing = refreshed;
  parts.all = all;
  for (const auto& [phase, count] : PartsOf(parts)) PhaseOf(scene, phase).instructions = std::max(0.0, count);
}

}  // namespace

double InclusiveInstructions(const std::string& annotated, const std::string& function) {
  std::istringstream lines(annotated);
  for (std::string line; std::getline(lines, line);) {
    const auto at = line.find(function);
    if (at == std::string::npos || at == 0 || line[at - 1] != ':') continue;
    std::string digits;
    for (const char c : line.substr(0, at)) {
      if (c >= '0' && c <= '9') digits += c;
      if (c == '(') break;
    }
    if (!digits.empty()) return std::atof(digits.c_str());
  }
  return 0;
}

void CountInstructions(const BenchOptions& options, BenchScene& scene) {
  if (options.step_command.empty()) return;
  const std::string valgrind = FindOnPath("valgrind");
  if (valgrind.empty()) {
    scene.why_no_instructions =
        "valgrind is not on the PATH, so that instructions are not counted; install it by: apt-get install "
        "valgrind";
    return;
  }
  const Profile ours = Collect(options, valgrind, "fork1s::World::Step(*", "discrete", options.phases);
  if (!ours.problem.empty()) {
    scene.why_no_instructions = ours.problem;
    return;
  }
  scene.instructions.push_back({"fork1s", ours.instructions / ours.steps});
  if (options.phases && ours.annotated.empty())
    scene.why_no_instructions =
        "callgrind_annotate, which comes with valgrind, is not on the PATH: no phases";
  else if (options.phases)
    SetPhases(ours, scene);
  if (!options.mujoco) return;
  for (const char* integrator : {"discrete", "implicitfast"}) {
    const Profile theirs = Collect(options, valgrind, "mj_step", integrator, false);
    if (theirs.problem.empty())
      scene.instructions.push_back({std::string("MuJoCo ") + integrator, theirs.instructions / theirs.steps});
  }
}

}  // namespace fork1s::internal
