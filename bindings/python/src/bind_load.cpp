// Files, text and MuJoCo's compiled models to Model.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "importer/mujoco_import.hpp"
#include "mechanism/names.hpp"
#include "model.hpp"
#include "record/child_reader.hpp"
#include "released_gil.hpp"

namespace fork1s::python {
namespace {

using Gains = std::pair<double, double>;
using Options = nb::typed<nb::dict, nb::str, nb::any>;

template <class T, std::size_t count>
std::optional<T> Word(const std::pair<T, const char*> (&names)[count], const std::optional<std::string>& word,
                      const char* argument) {
  if (!word) return std::nullopt;
  const std::optional<T> value = Named(names, *word);
  if (value) return value;
  std::string text = "'" + *word + "' is none of: ";
  for (const auto& [known, name] : names) text += (&name == &names[0].second ? "" : ", ") + std::string(name);
  throw Refused{{ErrorCode::kUsage, argument, text}};
}

PdGains Read(const Gains& gains) {
  if (!(gains.first >= 0) || !(gains.second >= 0))
    throw Refused{{ErrorCode::kUsage, "pd", "gains must be 0 or more"}};
  return {gains.first, gains.second};
}

// The options of the importer as keyword arguments, filled by fork1s.load.
ImportOptions ReadOptions(const Options& given) {
  ImportOptions options;
  const auto get = [&](const char* name) { return nb::object(given[name]); };
  const auto text = [&](const char* name) {
    return ReadAs<std::optional<std::string>>(get(name), name, "text");
  };
  constexpr const char* kGains = "two numbers (kp, kv), or a mapping from joint names to these";
  options.interfaces =
      ReadAs<std::vector<std::string>>(get("interface"), "interface", "a name or a sequence of names");
  options.switched =
      ReadAs<std::vector<std::string>>(get("switched"), "switched", "a name or a sequence of names");
  options.base = Word(kBaseKindNames, text("base"), "base");
  options.modes_by_step =
      nb::isinstance<nb::str>(get("modes")) && nb::cast<std::string>(get("modes")) == "auto";
  if (!get("modes").is_none() && !options.modes_by_step)
    options.modes = Whole{get("modes")}.Within("modes", 0);
  options.mode_choice = Word(kModeChoiceNames, text("mode_choice"), "mode_choice");
  options.stiffness_scale = Real{get("stiffness_scale")}.Read("stiffness_scale");
  if (!get("pd").is_none()) options.pd = Read(ReadAs<Gains>(get("pd"), "pd", kGains));
  for (const auto& [joint, gains] : ReadAs<std::map<std::string, Gains>>(get("joint_pd"), "pd", kGains))
    options.joint_pd[joint] = Read(gains);
  options.keyframe = text("keyframe").value_or("");
  if (!get("base_pose").is_none()) options.base_pose = ReadBasePose(get("base_pose"), "base_pose");
  options.joint_coordinates =
      ReadAs<std::map<std::string, double>>(get("q"), "q", "a mapping from joint names to numbers");
  options.keep_start = ReadAs<bool>(get("keep_start"), "keep_start", "True or False");
  options.hold = ReadAs<bool>(get("hold"), "hold", "True or False");
  options.ground = nb::cast<bool>(get("ground"));
  options.ground_height =
      ReadAs<std::optional<double>>(get("ground_height"), "ground", "True, False or a height");
  options.packages = ReadAs<std::map<std::string, std::string>>(get("packages"), "packages",
                                                                "a mapping from names to folders");
  return options;
}

}  // namespace

void BindLoad(nb::module_& m) {
  m.def(
      "load_file",
      [](const std::string& path, const Options& given) {
        const ImportOptions options = ReadOptions(given);
        const ReleasedGil others_run;
        return Model::Create(LoadMechanism(path, options), path, options);
      },
      nb::arg("path"), nb::arg("options"));
  m.def(
      "load_file_in_child",
      [](const std::string& path, const Options& given, const std::string& program, const Real& read_time) {
        const ImportOptions options = ReadOptions(given);
        const ChildReader reader{program, read_time.Read("read_time"), "read_time"};
        if (!(reader.max_time > 0)) throw Refused{{ErrorCode::kUsage, "read_time", "must be above 0 s"}};
        ReleasedGil others_run;
        auto imported =
            ReadInChild(reader, path, options, [&] { return others_run.IsPauseDue() && others_run.Pause(); });
        others_run.ThrowIfInterrupted();
        return Model::Create(std::move(imported), path, options);
      },
      nb::arg("path"), nb::arg("options"), nb::arg("program"), nb::arg("read_time"));
  m.def(
      "load_text",
      [](const std::string& text, const std::string& name, const Options& given) {
        const ImportOptions options = ReadOptions(given);
        const ReleasedGil others_run;
        return Model::Create(LoadMechanismFromString(text, name, options), name, std::nullopt);
      },
      nb::arg("text"), nb::arg("name"), nb::arg("options"));
  // The address is of an mjModel of Python's mujoco, whose version is that of this module's library and whose
  // model has no plugins: _load.py reads all others as text.
  m.def(
      "load_mujoco",
      [](std::uintptr_t address, const std::string& name, const Options& given) {
        const ImportOptions options = ReadOptions(given);
        return Model::Create(LoadMujocoModel(*reinterpret_cast<const mjModel_*>(address), name, options),
                             name, std::nullopt);
      },
      nb::arg("address"), nb::arg("name"), nb::arg("options"));
}

}  // namespace fork1s::python
