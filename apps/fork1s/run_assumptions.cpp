#include "run_assumptions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "base_text.hpp"
#include "mechanism/names.hpp"
#include "mode_line.hpp"
#include "print.hpp"
#include "run_contacts.hpp"

namespace fork1s::app {
namespace {

std::string List(const Json& names) {
  constexpr std::size_t kMost = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, names.size()); ++i)
    text += (i > 0 ? ", " : "") + names[i].get<std::string>();
  return names.size() > kMost ? text + fmt::format(" and {} more", names.size() - kMost) : text;
}

}  // namespace

Json AssumptionsJson(const Simulation& simulation, const InputArguments& inputs,
                     const ModelArguments& model) {
  const Scene& scene = simulation.scene();
  Json out;
  out["model"] = model.path;
  out["dt_s"] = simulation.dt();
  out["integrator"] = Name(simulation.step_options().integrator);
  out["recovery"] = Name(simulation.fidelity().recovery);
  out["gravity_m_per_s2"] = ToJson(scene.gravity);
  const int keyframe = simulation.options().initial_keyframe;
  out["keyframe"] = model.keyframe.empty() ? Json(nullptr) : Json(model.keyframe);
  out["start"] =
      model.StartText(keyframe < 0 ? nullptr : &scene.keyframes[static_cast<std::size_t>(keyframe)]);
  out["controls"] = inputs.controls.empty() ? Json(nullptr) : Json(inputs.controls);
  out["num_controls"] = simulation.control_names().size();
  out["pushes"] = inputs.pushes;
  out["mechanisms"] = Json::array();
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    const ReducedModel& reduced = m.model();
    Json names = Json::array();
    for (const BodyIndex body : reduced.interfaces) names.push_back(m.mechanism().body(body).name);
    out["mechanisms"].push_back({{"name", m.mechanism().name()},
                                 {"interfaces", std::move(names)},
                                 {"interfaces_chosen", m.mechanism().definition().interfaces_chosen},
                                 {"coordinates", reduced.size()},
                                 {"coordinates_full", reduced.num_coordinates() - reduced.loop_rank()},
                                 {"modes", reduced.num_modes},
                                 {"mode_selection", ModesJson(reduced)}});
    PutBase(m.mechanism(), out["mechanisms"].back());
  }
  out["free_bodies"] = scene.free_bodies.size();
  return out;
}

void PrintAssumptions(const Json& d) {
  PrintText("{}: steps of {:.6g} s by {}, recovery {}, gravity {} m/s^2, from {}\n",
            d["model"].get<std::string>(), d["dt_s"].get<double>(), d["integrator"].get<std::string>(),
            d["recovery"].get<std::string>(), VectorText(d["gravity_m_per_s2"]),
            d["start"].get<std::string>());
  const Json& mechanisms = d["mechanisms"];
  for (std::size_t i = 0; i < std::min(kLines, mechanisms.size()); ++i) {
    const Json& m = mechanisms[i];
    PrintText("  mechanism '{}': {}, {} of {} coordinates simulated ({} modes), contact at {} ({})\n",
              m["name"].get<std::string>(), BaseText(m), m["coordinates"].get<int>(),
              m["coordinates_full"].get<int>(), m["modes"].get<int>(), List(m["interfaces"]),
              m["interfaces_chosen"].get<bool>() ? "named" : "chosen, --interface names others");
    PrintText("    {}\n", ModeLine(m["mode_selection"]));
  }
  PrintOmitted(mechanisms.size(), "mechanisms");
  const auto controls = d["num_controls"].get<std::size_t>();
  if (!d["controls"].is_null())
    PrintText("  controls from {}\n", d["controls"].get<std::string>());
  else if (controls > 0)
    PrintText("  no --controls: {} stay{} where {} start{}\n",
              controls == 1 ? "the one control" : fmt::format("all {} controls", controls),
              controls == 1 ? "s" : "", controls == 1 ? "it" : "they", controls == 1 ? "s" : "");
  for (const Json& push : d["pushes"]) PrintText("  push {}\n", push.get<std::string>());
}

}  // namespace fork1s::app
