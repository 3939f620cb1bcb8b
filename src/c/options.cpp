#include "options.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "base/near_names.hpp"
#include "calls.hpp"
#include "mechanism/names.hpp"

namespace fork1s::c {
namespace {

using Json = nlohmann::json;
using Readers = std::map<std::string, std::function<void(const Json&, const std::string& name)>>;

[[noreturn]] void Refuse(const std::string& name, const std::string& message) {
  throw Refused{{ErrorCode::kUsage, "option '" + name + "'", message}};
}

[[noreturn]] void RefuseType(const std::string& name, const char* wanted, const Json& value) {
  Refuse(name, std::string("must be ") + wanted + ", not " +
                   value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

// One object without members of the same name.
Json Parse(const char* text) {
  std::vector<std::set<std::string>> names;  // of the objects that are open
  const auto check = [&](int, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) names.emplace_back();
    if (event == Json::parse_event_t::object_end) names.pop_back();
    if (event == Json::parse_event_t::key && !names.back().insert(parsed.get<std::string>()).second)
      Refuse(parsed.get<std::string>(), "is given twice; give it once");
    return true;
  };
  Json options;
  try {
    options = Json::parse(text, check);
  } catch (const Json::exception& fault) {
    throw Refused{{ErrorCode::kUsage, "options",
                   std::string("are no JSON text (") + fault.what() + R"(); write them as {"dt": 0.01})"}};
  }
  if (!options.is_object())
    throw Refused{{ErrorCode::kUsage, "options", R"(must be one JSON object, as {"dt": 0.01})"}};
  return options;
}

double Number(const Json& value, const std::string& name) {
  if (!value.is_number()) RefuseType(name, "a number", value);
  return value.get<double>();
}

bool Truth(const Json& value, const std::string& name) {
  if (!value.is_boolean()) RefuseType(name, "true or false", value);
  return value.get<bool>();
}

std::string Text(const Json& value, const std::string& name) {
  if (!value.is_string()) RefuseType(name, "text", value);
  return value.get<std::string>();
}

std::vector<double> Numbers(const Json& value, const std::string& name, const char* wanted) {
  if (!value.is_array()) RefuseType(name, wanted, value);
  std::vector<double> numbers;
  for (const Json& number : value) numbers.push_back(Number(number, name));
  return numbers;
}

// Members of an object by name, each read by `read`.
template <class Read>
auto ByName(const Json& value, const std::string& name, const char* wanted, const Read& read) {
  if (!value.is_object()) RefuseType(name, wanted, value);
  std::map<std::string, decltype(read(value, name))> members;
  for (const auto& [key, member] : value.items()) members[key] = read(member, name + "." + key);
  return members;
}

// `value_of`: the value of a word, if it is one.
template <class ValueOf>
auto Word(const Json& value, const std::string& name, const ValueOf& value_of, const std::string& words) {
  const std::string word = Text(value, name);
  const auto known = value_of(word);
  if (!known) Refuse(name, "'" + word + "' is none of: " + words);
  return *known;
}

template <class T, std::size_t count>
T Word(const Json& value, const std::string& name, const std::pair<T, const char*> (&names)[count]) {
  std::string words;
  for (const auto& [known, word] : names) words += (words.empty() ? "" : ", ") + std::string(word);
  return Word(
      value, name, [&](const std::string& word) { return Named(names, word); }, words);
}

PdGains Gains(const Json& value, const std::string& name) {
  const std::vector<double> gains = Numbers(value, name, "two gains [KP, KV]");
  if (gains.size() != 2) RefuseType(name, "two gains [KP, KV]", value);
  if (gains[0] < 0 || gains[1] < 0) Refuse(name, "gains must be 0 or more");
  return {gains[0], gains[1]};
}

RigidTransform Pose(const Json& value, const std::string& name) {
  constexpr const char* kWanted = "a position [X, Y, Z], or with a quaternion [X, Y, Z, QW, QX, QY, QZ]";
  const std::vector<double> n = Numbers(value, name, kWanted);
  if (n.size() != 3 && n.size() != 7) RefuseType(name, kWanted, value);
  const Vector3 p(n[0], n[1], n[2]);
  if (n.size() == 3) return RigidTransform(p);
  const Quaternion q(n[3], n[4], n[5], n[6]);
  if (!(q.norm() > 0)) Refuse(name, "has a quaternion of length 0");
  return {q.normalized(), p};
}

std::vector<std::string> Names(const Json& value, const std::string& name) {
  if (!value.is_array()) RefuseType(name, "a list of names", value);
  std::vector<std::string> names;
  for (const Json& one : value) names.push_back(Text(one, name));
  return names;
}

Readers LoadReaders(LoadOptions& options) {
  ImportOptions& o = options.import;
  return {
      {"interface", [&](const Json& v, const std::string& name) { o.interfaces = Names(v, name); }},
      {"switched", [&](const Json& v, const std::string& name) { o.switched = Names(v, name); }},
      {"base", [&](const Json& v, const std::string& name) { o.base = Word(v, name, kBaseKindNames); }},
      {"modes",
       [&](const Json& v, const std::string& name) {
         o.modes_by_step = v == "auto";
         if (o.modes_by_step) return;
         if (!v.is_number_integer() || v < 0 || v > std::numeric_limits<int>::max())
           RefuseType(name, "a whole number of 0 or more, or \"auto\"", v);
         o.modes = v.get<int>();
       }},
      {"mode_choice",
       [&](const Json& v, const std::string& name) { o.mode_choice = Word(v, name, kModeChoiceNames); }},
      {"stiffness_scale",
       [&](const Json& v, const std::string& name) { o.stiffness_scale = Number(v, name); }},
      {"pd", [&](const Json& v, const std::string& name) { o.pd = Gains(v, name); }},
      {"joint_pd",
       [&](const Json& v, const std::string& name) {
         o.joint_pd = ByName(v, name, "an object of gains {\"JOINT\": [KP, KV], ...}", Gains);
       }},
      {"keyframe", [&](const Json& v, const std::string& name) { o.keyframe = Text(v, name); }},
      {"base_pose", [&](const Json& v, const std::string& name) { o.base_pose = Pose(v, name); }},
      {"q",
       [&](const Json& v, const std::string& name) {
         o.joint_coordinates = ByName(v, name, "an object of numbers {\"JOINT\": VALUE, ...}", Number);
       }},
      {"keep_start", [&](const Json& v, const std::string& name) { o.keep_start = Truth(v, name); }},
      {"hold", [&](const Json& v, const std::string& name) { o.hold = Truth(v, name); }},
      {"ground",
       [&](const Json& v, const std::string& name) {
         if (!v.is_boolean() && !v.is_number()) RefuseType(name, "true, false or a height", v);
         o.ground = v != false;
         if (v.is_number()) o.ground_height = Number(v, name);
       }},
      {"packages",
       [&](const Json& v, const std::string& name) {
         o.packages = ByName(v, name, "an object of folders {\"NAME\": \"FOLDER\", ...}", Text);
       }},
      {"reader", [&](const Json& v, const std::string& name) { options.reader = Text(v, name); }},
      {"read_time",
       [&](const Json& v, const std::string& name) {
         options.read_time = Number(v, name);
         if (!(options.read_time > 0)) Refuse(name, "must be above 0 s");
       }},
  };
}

Readers RunReaders(RunOptions& options) {
  SimulationOptions& o = options.simulation;
  return {
      {"dt",
       [&](const Json& v, const std::string& name) {
         o.dt = Number(v, name);
         if (!(o.dt > 0)) Refuse(name, "must be above 0 s");
       }},
      {"keyframe", [&](const Json& v, const std::string& name) { options.keyframe = Text(v, name); }},
      {"recovery",
       [&](const Json& v, const std::string& name) { o.recovery = Word(v, name, kRecoveryNames); }},
      {"detail",
       [&](const Json& v, const std::string& name) {
         o.detail = Word(
             v, name,
             [](const std::string& word) -> std::optional<DetailLevel> {
               for (const DetailLevel level :
                    {DetailLevel::kInterface, DetailLevel::kParents, DetailLevel::kAll})
                 if (word == Name(level)) return level;
               return std::nullopt;
             },
             "interface, parents, all");
       }},
      {"integrator",
       [&](const Json& v, const std::string& name) {
         if (v == "theta") Refuse(name, kThetaIsGone);
         o.step.integrator = Word(v, name, kIntegratorNames);
       }},
  };
}

// `other`: readers of the other function's options, which `elsewhere` names.
void Read(const char* text, const Readers& readers, const Readers& other, const char* elsewhere) {
  if (!text) return;
  const Json options = Parse(text);
  for (const auto& [name, value] : options.items()) {
    if (const auto reader = readers.find(name); reader != readers.end()) {
      reader->second(value, name);
      continue;
    }
    if (other.count(name) > 0) Refuse(name, std::string("is an option of ") + elsewhere + "; give it there");
    std::vector<std::string> known;
    for (const auto& [option, reader] : readers) known.push_back(option);
    Refuse(name, "there is no such option" + Suggestion(name, known));
  }
}

}  // namespace

LoadOptions ReadLoadOptions(const char* text) {
  LoadOptions options;
  RunOptions other;
  Read(text, LoadReaders(options), RunReaders(other), "fork1s_simulation_create");
  return options;
}

RunOptions ReadRunOptions(const char* text) {
  RunOptions options;
  LoadOptions other;
  Read(text, RunReaders(options), LoadReaders(other), "fork1s_model_load");
  return options;
}

}  // namespace fork1s::c
