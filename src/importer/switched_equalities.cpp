// Welds and connects that are off in the file, or that it starts active and options or <custom> name: a control of their
// name switches them while a simulation runs.
#include <fmt/format.h>

#include <algorithm>

#include "conversion.hpp"
#include "mechanism/names.hpp"
#include "mechanism/rigid_groups.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// The time constant [s] of MuJoCo's spring and damper of an equality: solref, or by stiffness and damping with b = 2/T.
double TimeConstant(const mjModel& m, int e) {
  const mjtNum* solref = m.eq_solref + mjNREF * e;
  const double T = solref[0] > 0 ? solref[0] : solref[1] < 0 ? -2 / solref[1] : 0;
  mjtNum usual[mjNREF], solimp[mjNIMP];
  mj_defaultSolRefImp(usual, solimp);
  return T > 0 ? T : usual[0];
}

// The name of the equality, which actuators may have as well.
std::string FreeName(const Conversion& c, const std::string& name) {
  std::string free = name;
  const auto is_taken = [&] {
    return std::any_of(c.scene.mechanisms.begin(), c.scene.mechanisms.end(), [&](const MechanismDef& m) {
      return std::any_of(m.controls.begin(), m.controls.end(),
                         [&](const ControlDef& control) { return control.name == free; });
    });
  };
  while (is_taken()) free += "_equality";
  return free;
}

void ConvertSwitched(Conversion& c, int e) {
  const mjModel& m = c.m;
  const std::string name = m.names + m.name_eqadr[e], where = fmt::format("equality '{}'", name);
  int a = PlaceOfEquality(m, e, 0).body, b = PlaceOfEquality(m, e, 1).body;
  EqualityFrames frames = FramesOfEquality(c, e);
  if (c.body[a].mechanism < 0) {
    std::swap(a, b);
    std::swap(frames.X_AJ, frames.X_BJ);
  }
  const BodyPlace &on_a = c.body[a], &on_b = c.body[b];
  const auto is_rigid_with_a = [&] {
    const MechanismDef& mechanism = c.scene.mechanisms[static_cast<std::size_t>(on_a.mechanism)];
    const std::vector<std::size_t> group = RigidGroups(mechanism);
    const std::size_t of_a = group[on_a.body.u()];
    if (on_b.mechanism == on_a.mechanism) return group[on_b.body.u()] == of_a;
    return on_b.still() && of_a == 0 && mechanism.base == BaseKind::kFixed;
  };
  if (on_a.mechanism < 0 || !MovesRelative(m, a, b) || is_rigid_with_a()) {
    c.Dropped(where, "joins bodies that do not move relative to each other");
    return;
  }
  MechanismDef& mechanism = c.scene.mechanisms[static_cast<std::size_t>(on_a.mechanism)];
  SwitchedClosureDef closure;
  closure.name = name;
  closure.body_a = SceneName(c, a);
  closure.body_b = SceneName(c, b);
  closure.X_AJ = frames.X_AJ;
  closure.X_BJ = on_b.still() ? c.WorldPose(b) * frames.X_BJ : frames.X_BJ;
  closure.rigid = frames.rigid;
  closure.time_constant = TimeConstant(m, e);
  ControlDef control;
  control.name = closure.control = FreeName(c, name);
  control.lower = 0;
  control.upper = 1;
  control.initial = m.eq_active0[e] ? 1 : 0;
  if (control.name != name)
    c.Note(ImportNote::Kind::kChanged, where,
           fmt::format("an actuator has its name, so the control that switches it is '{}'", control.name));
  mechanism.controls.push_back(std::move(control));
  c.controls[static_cast<std::size_t>(on_a.mechanism)].emplace_back();
  mechanism.switched_closures.push_back(std::move(closure));
}

}  // namespace

std::optional<Error> FindSwitchedByName(Conversion& c, const ImportOptions& options) {
  const mjModel& m = c.m;
  const auto name_of = [&](int e) { return std::string(m.names + m.name_eqadr[e]); };
  std::vector<std::string> known;
  for (int e = 0; e < m.neq; ++e)
    if (const std::string name = name_of(e);
        !name.empty() && (m.eq_type[e] == mjEQ_WELD || m.eq_type[e] == mjEQ_CONNECT))
      known.push_back(name);
  const auto is_known = [&](const std::string& name) {
    return std::find(known.begin(), known.end(), name) != known.end();
  };
  std::vector<std::string> names = options.switched;
  std::string where = "option switched";
  ErrorCode code = ErrorCode::kUsage;
  if (names.empty()) {
    const std::optional<std::string> text = CustomText(m, "fork1s_switched");
    if (!text) return std::nullopt;
    where = "text 'fork1s_switched'";
    code = ErrorCode::kModel;
    names = ListedNames(*text, is_known);
    if (names.empty())
      return c.ModelError(
          where, "it names no equality; list the welds and connects that are switched, or remove the text");
  }
  for (const std::string& name : names) {
    if (!is_known(name))
      return Error{code, fmt::format("{}, {}", c.file, where),
                   fmt::format("no weld and no connect is called '{}'{}", name, Suggestion(name, known))};
    for (int e = 0; e < m.neq; ++e)
      if (name_of(e) == name) c.switched_by_name[e] = true;
  }
  return std::nullopt;
}

void ConvertSwitchedEqualities(Conversion& c) {
  for (int e = 0; e < c.m.neq; ++e)
    if (c.IsSwitchable(e)) ConvertSwitched(c, e);
}

void AddSwitchedInterfaces(Conversion& c) {
  for (const MechanismDef& of : c.scene.mechanisms)
    for (const SwitchedClosureDef& closure : of.switched_closures)
      for (const std::string& name : {closure.body_a, closure.body_b})
        for (MechanismDef& mechanism : c.scene.mechanisms) {
          const BodyIndex body = mechanism.FindBody(name);
          if (!body.valid()) continue;
          const std::vector<std::size_t> group = RigidGroups(mechanism);
          if (group[body.u()] == 0) continue;  // the base always takes part
          if (std::any_of(mechanism.interfaces.begin(), mechanism.interfaces.end(),
                          [&](const std::string& other) {
                            return group[mechanism.FindBody(other).u()] == group[body.u()];
                          }))
            continue;
          mechanism.interfaces.push_back(name);
          c.Note(ImportNote::Kind::kChosen, fmt::format("body '{}'", name),
                 fmt::format("equality '{}' may hold it, so it is an interface body as well", closure.name));
        }
}

}  // namespace fork1s::internal
