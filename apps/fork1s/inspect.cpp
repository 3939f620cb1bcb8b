#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/reduction/free_motion.hpp>
#include <map>
#include <memory>
#include <set>

#include "base_text.hpp"
#include "checks.hpp"
#include "gain.hpp"
#include "inspect_folder.hpp"
#include "mechanism/names.hpp"
#include "mode_line.hpp"
#include "model_arguments.hpp"
#include "output.hpp"
#include "print.hpp"
#include "study/deflection.hpp"

namespace fork1s::app {
namespace {

// Sentences on motions without stiffness, with all six of a loose body, whose free joint is two joints, in one.
std::vector<std::string> Sentences(const Mechanism& m, const std::vector<FreeMotion>& motions) {
  // The free joint of which a motion moves a part, and nothing else; else empty.
  const auto free_joint = [&](const FreeMotion& motion) -> std::string {
    const std::string name = motion.joints.size() == 1 ? m.joint(motion.joints[0]).name : "";
    for (const std::string end : {".position", ".rotation"})
      if (name.ends_with(end)) return name.substr(0, name.size() - end.size());
    return "";
  };
  std::map<std::string, int> count;
  for (const FreeMotion& motion : motions) ++count[free_joint(motion)];
  std::vector<std::string> sentences;
  std::set<std::string> told;
  for (const FreeMotion& motion : motions) {
    const std::string joint = free_joint(motion);
    if (joint.empty() || count[joint] != 6)
      sentences.push_back(motion.Text(m));
    else if (told.insert(joint).second)
      sentences.push_back(fmt::format(
          "body '{0}' is loose, free to move and turn in every direction: no spring or servo holds its free joint "
          "'{1}'; where it is no object, hold it by PD gains, {1}.position=KP,KV and {1}.rotation=KP,KV",
          m.body(m.joint(motion.joints[0]).body).name, joint));
  }
  return sentences;
}

// Motions that no spring resists: those that gravity, controls and preload resist, and those that nothing
// does. Weight resists no motion of what falls.
void AddFreeMotions(const PosedMechanism& p, const Vector3& gravity_W, Json& out) {
  const Mechanism& m = *p.mechanism;
  const bool falls = m.base() == BaseKind::kFloating;
  const StaticsOptions loads = WeightAndControls(p, falls ? Vector3(Vector3::Zero()) : gravity_W);
  const std::vector<FreeMotion> of_springs = FindFreeMotions(m, p.q),
                                unheld = FindFreeMotions(m, p.q, {}, &loads);
  for (const std::string& sentence : Sentences(m, unheld)) out["not_held"].push_back(sentence);
  for (const FreeMotion& motion : of_springs)
    if (std::none_of(unheld.begin(), unheld.end(),
                     [&](const FreeMotion& other) { return other.pivot == motion.pivot; }))
      out["held_by_load"].push_back(m.joint(motion.joints.front()).name);
}

Json Describe(const ModelArguments& model, const ImportedScene& imported,
              const std::vector<PosedMechanism>& posed) {
  Json out;
  out["name"] = imported.scene.name;
  out["format"] = imported.report.format;
  out["timestep_s"] = imported.scene.timestep;
  out["gravity_m_per_s2"] = ToJson(imported.scene.gravity);
  out["mechanisms"] = Json::array();
  for (const PosedMechanism& p : posed) {
    const Mechanism& m = *p.mechanism;
    const MechanismDef& def = m.definition();
    Json one;
    one["name"] = m.name();
    PutBase(m, one);
    one["mass_kg"] = m.total_mass();
    one["bodies"] = m.num_bodies();
    one["joints"] = m.num_joints();
    one["coordinates"] = m.num_coordinates();
    one["closures"] = def.closures.size();
    one["couplings"] = def.couplings.size();
    one["controls"] = Json::array();
    for (const auto& c : def.controls) one["controls"].push_back(c.name);
    if (m.base() == BaseKind::kDriven)
      for (const char* axis : {".x", ".y", ".z", ".rx", ".ry", ".rz"})
        one["controls"].push_back(m.body(BodyIndex(0)).name + axis);
    one["interfaces"] = def.interfaces;
    one["interfaces_chosen"] = def.interfaces_chosen;
    one["modes"] = def.modes_by_step ? Json("auto") : Json(def.modes);
    one["mode_choice"] = Name(def.mode_choice);
    auto reduced = ReduceAtStart(p);
    one["gain"] =
        reduced ? GainJson(MeasureInterfaceGain(p, *reduced, imported.scene.timestep)) : Json(nullptr);
    one["mode_selection"] = reduced ? ModesJson(*reduced) : Json(nullptr);
    one["joint_table"] = Json::array();
    for (const auto& j : m.joints())
      one["joint_table"].push_back({{"name", j.name},
                                    {"kind", Name(j.kind)},
                                    {"body", m.body(j.body).name},
                                    {"parent", m.body(m.body(j.body).parent).name}});
    out["mechanisms"].push_back(std::move(one));
  }
  out["free_bodies"] = Json::array();
  for (const auto& b : imported.scene.free_bodies)
    out["free_bodies"].push_back({{"name", b.name}, {"mass_kg", b.inertia.mass}});
  out["world_geometries"] = imported.scene.world.size();
  out["keyframes"] = Json::array();
  for (std::size_t k = 0; k < imported.scene.keyframes.size(); ++k)
    if (const KeyframeDef& key = imported.scene.keyframes[k];
        static_cast<int>(k) != imported.initial_keyframe || !model.IsMadeStart(key))
      out["keyframes"].push_back(key.name);
  out["holds"] = Json::array();
  for (const auto& h : imported.report.holds)
    out["holds"].push_back({{"joint", h.joint}, {"held_by", h.held_by}});
  out["not_held"] = Json::array();
  out["held_by_load"] = Json::array();
  for (const PosedMechanism& p : posed) AddFreeMotions(p, imported.scene.gravity, out);
  out["step_us"] = posed.empty() ? Json(nullptr)
                                 : StepTimesJson(MeasureStepTimes(imported.scene, imported.initial_keyframe));
  out["notes"] = NotesJson(imported.report);
  return out;
}

void Print(const ImportedScene& imported, const Json& d) {
  PrintText("{}: {}, time step {:g} s\n", d["name"].get<std::string>(), d["format"].get<std::string>(),
            imported.scene.timestep);
  for (const Json& m : d["mechanisms"]) {
    PrintText(
        "\nmechanism '{}': {}, {} bodies, {:.4g} kg, {} joints, {} closures, {} "
        "couplings\n",
        m["name"].get<std::string>(), BaseText(m), m["bodies"].get<int>(), m["mass_kg"].get<double>(),
        m["joints"].get<int>(), m["closures"].get<int>(), m["couplings"].get<int>());
    std::string names;
    for (const Json& b : m["interfaces"]) names += (names.empty() ? "" : ", ") + b.get<std::string>();
    PrintText("  interface ({}): {}\n", m["interfaces_chosen"].get<bool>() ? "named" : "picked here", names);
    names.clear();
    for (const Json& c : m["controls"]) names += (names.empty() ? "" : ", ") + c.get<std::string>();
    if (!names.empty()) PrintText("  controls: {}\n", names);
    if (!m["mode_selection"].is_null()) PrintText("  {}\n", ModeLine(m["mode_selection"]));
    if (!m["gain"].is_null()) PrintGain(m["gain"]);
  }
  if (!d["step_us"].is_null()) PrintText("\n");
  PrintStepTimes(d["step_us"]);
  if (!d["free_bodies"].empty()) {
    PrintText("\nfree bodies:");
    for (const Json& b : d["free_bodies"])
      PrintText(" {} ({:.4g} kg)", b["name"].get<std::string>(), b["mass_kg"].get<double>());
    PrintText("\n");
  }
  PrintText("world geometries: {}\n", d["world_geometries"].get<int>());
  if (!d["keyframes"].empty()) {
    PrintText("keyframes:");
    for (const Json& k : d["keyframes"]) PrintText(" {}", k.get<std::string>());
    PrintText("\n");
  }
  PrintText("\nJoint springs and actuators:\n");
  std::size_t width = 0;
  for (const JointHold& h : imported.report.holds) width = std::max(width, h.joint.size());
  for (const JointHold& h : imported.report.holds) PrintText("  {:<{}}  {}\n", h.joint, width, h.held_by);
  if (!d["not_held"].empty()) PrintText("\nMotions without stiffness ({}):\n", d["not_held"].size());
  for (const Json& motion : d["not_held"]) PrintText("  {}\n", motion.get<std::string>());
  if (!d["held_by_load"].empty())
    PrintText("\nJoints with stiffness from preload, controls or weight alone ({}):\n",
              d["held_by_load"].size());
  for (const Json& joint : d["held_by_load"]) PrintText("  {}\n", joint.get<std::string>());
  PrintText("\nnotes of the import ({}):\n", imported.report.notes.size());
  for (const Json& n : d["notes"]) PrintText("  {}\n", n.get<std::string>());
}

}  // namespace

void AddInspect(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("inspect",
                                     "what was imported, what was dropped and why, joint springs and "
                                     "actuators, the reduction; of a folder: a table "
                                     "of its models");
  auto model = std::make_shared<ModelArguments>();
  auto time = std::make_shared<double>(0);
  model->AddTo(*command);
  command->add_option("--time", *time, "of a folder: also run every model for so many seconds")
      ->transform(SecondsWithin(0, kMostSeconds));
  command->callback([&action, model, time] {
    action = [model, time]() -> int {
      std::error_code ignored;
      if (std::filesystem::is_directory(model->path, ignored)) return InspectFolder(*model, *time);
      auto imported = model->Load();
      if (!imported) return Report(imported.error(), model->json);
      auto posed = PoseMechanisms(*imported);
      if (!posed) return Report(posed.error(), model->json);
      const Json description = Describe(*model, *imported, *posed);
      if (model->json)
        PrintText("{}\n", ToText(description, 2));
      else
        Print(*imported, description);
      return kDone;
    };
  });
}

}  // namespace fork1s::app
