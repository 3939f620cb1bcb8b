#include "model_arguments.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "checks.hpp"
#include "held_errors.hpp"
#include "mechanism/names.hpp"
#include "record/child_reader.hpp"
#include "spatial/roll_pitch_yaw.hpp"

namespace fork1s::app {
namespace {

Expected<std::vector<double>> ParseNumbers(const std::string& text, std::size_t count,
                                           const std::string& option) {
  std::vector<double> numbers;
  std::stringstream stream(text);
  std::string cell;
  while (std::getline(stream, cell, ',')) {
    auto value = ParseNumber(cell, option);
    if (!value) return tl::unexpected(value.error());
    numbers.push_back(*value);
  }
  if (numbers.size() != count)
    return Fail(ErrorCode::kUsage, option,
                fmt::format("takes {} numbers with commas between, not '{}'", count, text));
  return numbers;
}

// NAME=VALUE at the last '=' (names may hold one) or the first (paths may).
Expected<std::pair<std::string, std::string>> SplitAssignment(const std::string& text,
                                                              const std::string& option,
                                                              const std::string& form, bool last) {
  const auto equals = last ? text.rfind('=') : text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
    return Fail(ErrorCode::kUsage, option, fmt::format("takes {}, not '{}'", form, text));
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

Expected<RigidTransform> ParsePose(const std::string& text, const std::string& option) {
  const bool turned = std::count(text.begin(), text.end(), ',') > 2;
  auto n = ParseNumbers(text, turned ? 6 : 3, option);
  if (!n) return tl::unexpected(n.error());
  RigidTransform X(Vector3((*n)[0], (*n)[1], (*n)[2]));
  if (turned) X.rotation() = RollPitchYawRotation({(*n)[3], (*n)[4], (*n)[5]});
  return X;
}

// The importer names its own options; whoever typed a word looks for it behind the option that was typed.
std::string AsTyped(std::string where) {
  static const std::pair<const char*, const char*> kTyped[] = {{"interfaces", "--interface"},
                                                               {"switched", "--switched"},
                                                               {"joint-pd", "--pd"},
                                                               {"pd", "--pd"},
                                                               {"q", "--q"},
                                                               {"keyframe", "--keyframe"},
                                                               {"base-pose", "--base-pose"},
                                                               {"base", "--base"},
                                                               {"ground", "--ground"},
                                                               {"package", "--package"},
                                                               {"modes", "--modes"},
                                                               {"stiffness-scale", "--stiffness-scale"}};
  for (const auto& [own, typed] : kTyped) {
    const std::string words = std::string("option ") + own;
    const auto at = where.find(words);
    const auto end = at + words.size();
    if (at == std::string::npos || (end < where.size() && where[end] != ' ' && where[end] != ',')) continue;
    return where.replace(at, words.size(), typed);
  }
  return where;
}

const CLI::Validator kModes(
    [](std::string& text) {
      return text == "auto" ? std::string() : CLI::Range(0, std::numeric_limits<int>::max())(text);
    },
    "WORD");

}  // namespace

Expected<Vector3> ParseVector(const std::string& text, const std::string& option) {
  auto numbers = ParseNumbers(text, 3, option);
  if (!numbers) return tl::unexpected(numbers.error());
  return Vector3((*numbers)[0], (*numbers)[1], (*numbers)[2]);
}

void ModelArguments::AddTo(CLI::App& command) {
  command.add_option("model", path, "MJCF or URDF file")->required();
  command.option_defaults()->group(kModelOptions);
  command
      .add_option("--interface", interfaces,
                  "bodies that touch the world (a,b,...); replaces what the file says")
      ->delimiter(',')
      ->allow_extra_args(false);  // the model may come next
  command
      .add_option("--switched", switched,
                  "welds and connects (a,b,...) that the file starts active and a control of their name "
                  "switches, 1 at the start; replaces what the file says")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("--base", base, "fixed, floating or driven; replaces what the file says")
      ->check(OneOf({"fixed", "floating", "driven"}));
  command
      .add_option("--modes", modes,
                  "fixed-interface modes to keep at most; auto: all below 1/(6 dt), at least 4, within 24 "
                  "coordinates or twice those of the interface (default: the file's, else auto)")
      ->check(kModes);
  command
      .add_option("--mode-choice", mode_choice,
                  "which modes to keep: lowest in frequency, or those of largest contribution to the motion "
                  "of the interface (default: the file's, else lowest)")
      ->check(OneOf({"lowest", "contribution"}));
  command
      .add_option("--stiffness-scale", stiffness_scale,
                  "multiplies every joint spring by x, its damper by sqrt(x)")
      ->check(PositiveUpTo(kMostNumber));
  command
      .add_option(
          "--pd", pd,
          "KP,KV: PD gains in N m/rad and N m s/rad, of slides in N/m and N s/m, for joints without a "
          "spring or position servo. Where a mechanism has motors, for the joints that they drive alone: "
          "each motor gives way to a set-point, and its control is an angle or length from the start; "
          "NAME=KP,KV: for one joint, in place of those, and on top of a "
          "spring or actuator that it has (may be repeated); all=KP,KV: the same for every joint without "
          "gains of its own")
      ->take_all()
      ->allow_extra_args(false);  // the model may come next
  command.add_option("--keyframe", keyframe, "named initial state of the file");
  command.add_option("--base-pose", base_pose,
                     "x,y,z[,r,p,y]: where the base starts, in m and rad (as URDF's origin)");
  command.add_option("--q", coordinates, "NAME=VALUE: where a joint starts, in rad or m (may be repeated)")
      ->take_all()
      ->allow_extra_args(false);
  command.add_flag(
      "--keep-start", keep_start,
      "joints that the file starts outside their limits start there, and not at the nearest value inside");
  command.add_flag(
      "--hold", hold,
      "position servos start with the set-points that hold where the joints start, and not with those of "
      "the file; motors and other controls keep theirs");
  command.add_flag(
      "--ground{under}", ground,
      "a level plane: at z = 0 with --base-pose, else under the model; --ground=Z at a height in m");
  command
      .add_option(
          "--package", packages,
          "NAME=DIR: the folder of a ROS package that a URDF names (may be repeated); otherwise looked for "
          "below AMENT_PREFIX_PATH, ROS_PACKAGE_PATH and above the file")
      ->take_all()
      ->allow_extra_args(false);
  command.add_option("--read-time", read_time, "end reading after this many seconds (default 60)")
      ->transform(PositiveSecondsUpTo(kMostSeconds));
  command.option_defaults()->group("Options");
  command.add_flag("--json", json, "print one JSON object and nothing else");
}

void AddIntegratorTo(CLI::App& command, std::optional<Integrator>& integrator) {
  std::map<std::string, Integrator> names;
  for (const auto& [value, name] : kIntegratorNames) names[name] = value;
  command
      .add_option(
          "--integrator", integrator,
          "two-stage: two implicit stages of second order, each solved to a residual (default); euler: one, "
          "backward Euler, of first order")
      ->transform(OneOf(names))
      // The one added last is asked first.
      ->transform(CLI::Validator(
          [](const std::string& word) { return word == "theta" ? std::string(kThetaIsGone) : std::string(); },
          ""));
}

void AddRecoveryTo(CLI::App& command, Recovery& recovery) {
  std::map<std::string, Recovery> names;
  for (const auto& [value, name] : kRecoveryNames) names[name] = value;
  command
      .add_option(
          "--recovery", recovery,
          "exact (default): loops closed; expanded: steps by a second-order model about a pose, cheaper "
          "where "
          "many bodies touch nothing; curved: loops closed to second order; twist: one exponential a body")
      ->transform(OneOf(names));
}

void AddPushTo(CLI::App& command, std::vector<std::string>& pushes) {
  command
      .add_option("--push", pushes,
                  "BODY:FX,FY,FZ[,MX,MY,MZ][@PX,PY,PZ][:T0..T1]: a force in N (and a moment in N m), world "
                  "axes, at a point of the body in m (its own axes; default its origin), from T0 to T1 s "
                  "(default all the time); may be repeated")
      ->take_all()
      ->allow_extra_args(false);
}

Expected<ImportOptions> ModelArguments::Options() const {
  ImportOptions options;
  options.interfaces = interfaces;
  options.switched = switched;
  options.base = Named(kBaseKindNames, base);
  options.modes_by_step = modes == "auto";
  if (!modes.empty() && !options.modes_by_step) options.modes = std::stoi(modes);
  options.mode_choice = Named(kModeChoiceNames, mode_choice);
  options.stiffness_scale = stiffness_scale;
  options.keyframe = keyframe;
  for (const std::string& text : pd) {
    const auto equals = text.rfind('=');
    auto gains = ParseNumbers(equals == std::string::npos ? text : text.substr(equals + 1), 2, "--pd");
    if (!gains) return tl::unexpected(gains.error());
    const PdGains g{(*gains)[0], (*gains)[1]};
    if (g.kp < 0 || g.kv < 0) return Fail(ErrorCode::kUsage, "--pd", "gains must be 0 or more");
    if (equals == std::string::npos)
      options.pd = g;
    else
      options.joint_pd[text.substr(0, equals)] = g;
  }
  if (auto ok = ReadStart(options); !ok) return tl::unexpected(ok.error());
  return options;
}

std::string ModelArguments::StartText(const KeyframeDef* start) const {
  std::string text = keyframe.empty() ? "the pose of the file" : fmt::format("keyframe '{}'", keyframe);
  if (!base_pose.empty()) text += ", its base by --base-pose";
  if (start == nullptr || !IsMadeStart(*start)) return text;
  if (!coordinates.empty()) text += ", joints by --q";
  if (hold) text += ", set-points by --hold";
  if (coordinates.empty() && !hold)
    text += ", joints moved inside their limits and to where they follow others";
  return text;
}

std::vector<std::string> ModelArguments::Words() const {
  std::vector<std::string> words;
  const auto add = [&](const char* option, const std::string& value) {
    if (!value.empty()) words.push_back(fmt::format("{}={}", option, value));
  };
  for (const std::string& body : interfaces) add("--interface", body);
  for (const std::string& equality : switched) add("--switched", equality);
  add("--base", base);
  add("--modes", modes);
  add("--mode-choice", mode_choice);
  if (stiffness_scale != 1) add("--stiffness-scale", fmt::format("{}", stiffness_scale));
  for (const std::string& gains : pd) add("--pd", gains);
  add("--keyframe", keyframe);
  add("--base-pose", base_pose);
  for (const std::string& coordinate : coordinates) add("--q", coordinate);
  if (keep_start) words.push_back("--keep-start");
  if (hold) words.push_back("--hold");
  add("--ground", ground);
  for (const std::string& package : packages) add("--package", package);
  if (json) words.push_back("--json");
  words.insert(words.end(), {"--", path});
  return words;
}

namespace {

// Reads a model; an error has the option as it was typed, and nothing that libraries printed beside it.
template <class Read>
auto ReadAsTyped(const Read& read) {
  auto model = [&] {
    HeldErrors held;
    auto loaded = read();
    if (!loaded) held.Drop();
    return loaded;
  }();
  if (!model) model.error().where = AsTyped(model.error().where);
  return model;
}

}  // namespace

Expected<ImportedScene> ReadQuietly(const std::string& path, const ImportOptions& options) {
  HeldErrors held;
  auto loaded = LoadMechanism(path, options);
  if (!loaded) held.Drop();
  return loaded;
}

Expected<ImportedScene> ModelArguments::Load(const std::atomic<bool>& stop) const {
  const auto options = Options();
  if (!options) return tl::unexpected(options.error());
  auto loaded = ReadInChild({.max_time = read_time, .time_option = "--read-time"}, path, *options,
                            [&] { return stop.load(); });
  if (!loaded) {
    loaded.error().where = AsTyped(loaded.error().where);
    return loaded;
  }
  for (ImportNote& note : loaded->report.notes) note.where = AsTyped(note.where);
  return loaded;
}

Expected<MjcfModel> ModelArguments::WriteMjcf(const std::string& out) const {
  const auto options = Options();
  if (!options) return tl::unexpected(options.error());
  auto model = ReadAsTyped([&] { return WriteMjcfFile(path, *options, out); });
  if (!model) return model;
  for (ImportNote& note : model->imported.report.notes) note.where = AsTyped(note.where);
  return model;
}

Expected<SharedModel> ModelArguments::ShareWithMuJoCo(ImportedScene imported) const {
  const auto options = Options();
  if (!options) return tl::unexpected(options.error());
  return ReadAsTyped([&] { return fork1s::ShareWithMuJoCo(path, *options, std::move(imported)); });
}

Expected<void> ModelArguments::ReadStart(ImportOptions& options) const {
  if (!base_pose.empty()) {
    auto pose = ParsePose(base_pose, "--base-pose");
    if (!pose) return tl::unexpected(pose.error());
    options.base_pose = *pose;
  }
  for (const std::string& text : coordinates) {
    auto split = SplitAssignment(text, "--q", "NAME=VALUE", true);
    if (!split) return tl::unexpected(split.error());
    auto value = ParseNumbers(split->second, 1, "--q " + split->first);
    if (!value) return tl::unexpected(value.error());
    options.joint_coordinates[split->first] = (*value)[0];
  }
  options.keep_start = keep_start;
  options.hold = hold;
  options.ground = !ground.empty();
  if (options.ground && ground != "under") {
    auto height = ParseNumbers(ground, 1, "--ground");
    if (!height) return tl::unexpected(height.error());
    options.ground_height = (*height)[0];
  }
  for (const std::string& text : packages) {
    auto split = SplitAssignment(text, "--package", "NAME=DIR", false);
    if (!split) return tl::unexpected(split.error());
    options.packages[split->first] = split->second;
  }
  return {};
}

}  // namespace fork1s::app
