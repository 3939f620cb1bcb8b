// Proportional-derivative control: a spring of stiffness kp about the initial displacement, and an input
// that shifts its target.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "conversion.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// Stands for every hinge, slide and ball joint without gains of its own, unless a joint has that name.
constexpr const char* kAllJoints = "all";

bool NamesAllJoints(const Conversion& c, const std::string& name) {
  return name == kAllJoints &&
         std::find(c.joint_names.begin(), c.joint_names.end(), name) == c.joint_names.end();
}

bool HasGainsOfAll(const Conversion& c, const std::map<std::string, PdGains>& named) {
  return named.count(kAllJoints) > 0 && NamesAllJoints(c, kAllJoints);
}

bool HasOwnGains(const Conversion& c, int dof, const std::map<std::string, PdGains>& named) {
  return named.count(c.joint_names[c.m.dof_jntid[dof]]) > 0 || HasGainsOfAll(c, named);
}

std::optional<Error> CheckGains(const std::string& where, const PdGains& gains) {
  if (std::isfinite(gains.kp) && std::isfinite(gains.kv) && gains.kp >= 0 && gains.kv >= 0)
    return std::nullopt;
  return Error{ErrorCode::kUsage, where,
               fmt::format("gains kp={} kv={} are no finite numbers of 0 or more", gains.kp, gains.kv)};
}

int Offset(const MechanismDef& mechanism, const FreedomRef& ref) {
  int offset = 0;
  for (std::size_t j = 0; j < ref.joint.u(); ++j)
    offset += static_cast<int>(mechanism.joints[j].freedoms.size());
  return offset + ref.freedom;
}

double Displacement(const Conversion& c, int keyframe, int dof) {
  if (keyframe < 0) return 0;
  const int mechanism = c.MechanismOf(dof);
  return c.scene.keyframes[keyframe]
      .mechanisms[mechanism]
      .q[Offset(c.scene.mechanisms[mechanism], c.Freedom(dof))];
}

void Hold(Conversion& c, int dof, const PdGains& gains) {
  const int mechanism = c.MechanismOf(dof);
  const double rest = Displacement(c, c.initial_keyframe, dof);
  c.k[dof] += gains.kp;
  c.c[dof] += gains.kp * rest;
  c.FreedomOf(dof).damping += gains.kv;
  c.held_by[dof].push_back(
      fmt::format("PD control kp {:.4g} {}, kv {:.4g}", gains.kp, c.StiffnessUnit(dof), gains.kv));
  ControlDef control;
  control.name = c.DofName(dof);
  const auto is_taken = [&](const ControlDef& other) { return other.name == control.name; };
  const auto& others = c.scene.mechanisms[mechanism].controls;
  while (std::any_of(others.begin(), others.end(), is_taken)) control.name += '_';
  control.terms = {{c.Freedom(dof), 1.0}};
  control.gain = gains.kp;
  control.is_setpoint = true;
  control.setpoint_rest = rest;
  ControlSource source;
  source.dofs = {dof};
  source.pd = {{dof, rest}};
  source.gains = gains;
  std::erase_if(c.report.servos, [&](const ServoGains& s) {  // of the motor whose place it takes
    return s.mechanism == mechanism && s.control == control.name;
  });
  c.report.servos.push_back({mechanism, control.name, gains.kp, gains.kv, 0, -rest});
  c.scene.mechanisms[mechanism].controls.push_back(std::move(control));
  c.controls[mechanism].push_back(std::move(source));
  // Each keyframe is held at its own pose.
  for (std::size_t key = 0; key < c.scene.keyframes.size(); ++key) {
    VectorX& u = c.scene.keyframes[key].mechanisms[mechanism].controls;
    u.conservativeResize(u.size() + 1);
    u[u.size() - 1] = Displacement(c, static_cast<int>(key), dof) - rest;
    VectorX& a = c.scene.keyframes[key].mechanisms[mechanism].activation;
    if (a.size() > 0) a.conservativeResizeLike(VectorX::Zero(u.size()));
  }
}

void RemoveControl(Conversion& c, int mechanism, std::size_t i) {
  auto& controls = c.scene.mechanisms[mechanism].controls;
  controls.erase(controls.begin() + static_cast<std::ptrdiff_t>(i));
  c.controls[mechanism].erase(c.controls[mechanism].begin() + static_cast<std::ptrdiff_t>(i));
  for (KeyframeDef& keyframe : c.scene.keyframes) {
    for (VectorX* of :
         {&keyframe.mechanisms[mechanism].controls, &keyframe.mechanisms[mechanism].activation}) {
      if (of->size() == 0) continue;
      VectorX kept(of->size() - 1);
      const auto at = static_cast<Eigen::Index>(i);
      kept << of->head(at), of->tail(of->size() - 1 - at);
      *of = kept;
    }
  }
}

std::vector<int> Motors(const Conversion& c, int mechanism) {
  std::vector<int> dofs;
  for (const ControlSource& source : c.controls[mechanism]) {
    if (source.motor) dofs.push_back(source.dofs[0]);
  }
  return dofs;
}

bool IsUnrestrained(const Conversion& c, int dof) {
  const bool free = c.m.jnt_type[c.m.dof_jntid[dof]] == mjJNT_FREE;
  return !free && c.k[dof] == 0 && !c.in_spring[dof] && !c.coupled[dof];
}

bool HasSpring(const mjModel& m, int joint) {
  if (m.opt.disableflags & mjDSBL_SPRING) return false;
  const mjtNum* higher = m.jnt_stiffnesspoly + static_cast<std::ptrdiff_t>(mjNPOLY) * joint;
  return m.jnt_stiffness[joint] > 0 || std::any_of(higher, higher + mjNPOLY, [](mjtNum k) { return k != 0; });
}

// Joints with a spring of their own and no position servo, which `gains` of a mechanism leave as they are.
std::vector<std::string> SkippedForTheirSpring(const Conversion& c, int mechanism,
                                               const std::vector<int>& motors,
                                               const std::map<std::string, PdGains>& named) {
  std::vector<std::string> skipped;
  for (int dof = 0; dof < c.m.nv; ++dof) {
    const int joint = c.m.dof_jntid[dof];
    if (c.MechanismOf(dof) != mechanism || c.m.jnt_type[joint] == mjJNT_FREE || !HasSpring(c.m, joint))
      continue;
    if (!motors.empty() && std::find(motors.begin(), motors.end(), dof) == motors.end()) continue;
    if (HasOwnGains(c, dof, named)) continue;
    const auto& sources = c.controls[mechanism];
    if (std::any_of(sources.begin(), sources.end(), [&](const ControlSource& s) {
          return s.servo && std::find(s.dofs.begin(), s.dofs.end(), dof) != s.dofs.end();
        }))
      continue;
    skipped.push_back(c.DofName(dof));
  }
  return skipped;
}

// Motors say which joints are driven. Without them, all that nothing holds, unless loops do the holding.
// Joints in `named` have gains of their own, which take the place of `gains` and of their motors.
void HoldMechanism(Conversion& c, int mechanism, const PdGains& gains,
                   const std::map<std::string, PdGains>& named) {
  const std::vector<int> motors = Motors(c, mechanism);
  const std::string where = fmt::format("mechanism '{}'", c.scene.mechanisms[mechanism].name);
  if (motors.empty() && !c.scene.mechanisms[mechanism].closures.empty()) {
    if (HasGainsOfAll(c, named)) return;
    c.Note(ImportNote::Kind::kChosen, where,
           "it has loops and no motors, so pd cannot tell driven joints from passive ones and holds none; "
           "name them with joint-pd, JOINT=KP,KV, or all joints, all=KP,KV");
    return;
  }
  std::vector<int> dofs;
  for (int dof = 0; dof < c.m.nv; ++dof) {
    if (c.MechanismOf(dof) != mechanism || !IsUnrestrained(c, dof)) continue;
    if (!motors.empty() && std::find(motors.begin(), motors.end(), dof) == motors.end()) continue;
    dofs.push_back(dof);
  }
  const std::vector<std::string> skipped = SkippedForTheirSpring(c, mechanism, motors, named);
  if (!skipped.empty()) {
    c.Note(
        ImportNote::Kind::kChosen, where,
        fmt::format(
            "pd holds none of {}, which {} a spring; gains of all=KP,KV hold every joint beside its spring, "
            "JOINT=KP,KV one",
            Quoted(skipped, 24), skipped.size() == 1 ? "has" : "have"));
  }
  std::vector<std::string> replaced;
  for (std::size_t i = c.controls[mechanism].size(); i-- > 0;) {
    const ControlSource& source = c.controls[mechanism][i];
    if (!source.motor || std::find(dofs.begin(), dofs.end(), source.dofs[0]) == dofs.end()) continue;
    replaced.insert(replaced.begin(), c.scene.mechanisms[mechanism].controls[i].name);
    c.held_by[source.dofs[0]].clear();
    RemoveControl(c, mechanism, i);
  }
  std::vector<std::string> held;
  for (int dof : dofs) {
    if (HasOwnGains(c, dof, named)) continue;
    Hold(c, dof, gains);
    held.push_back(c.DofName(dof));
  }
  if (!held.empty())
    c.Note(ImportNote::Kind::kChosen, where,
           fmt::format("PD control kp {:.4g}, kv {:.4g} holds {} freedoms: {}", gains.kp, gains.kv,
                       held.size(), Quoted(held, 24)));
  if (!replaced.empty()) {
    c.Note(ImportNote::Kind::kChanged, where,
           fmt::format("{} motors became targets of PD control: {}", replaced.size(), Quoted(replaced, 24)));
  }
}

void HoldAll(Conversion& c, const PdGains& gains, const std::map<std::string, PdGains>& named) {
  for (int dof = 0; dof < c.m.nv; ++dof) {
    const int joint = c.m.dof_jntid[dof];
    if (c.joint[joint].mechanism < 0 || c.m.jnt_type[joint] == mjJNT_FREE) continue;
    if (named.count(c.joint_names[joint]) == 0) Hold(c, dof, gains);
  }
}

}  // namespace

std::optional<Error> ApplyPd(Conversion& c, const ImportOptions& options) {
  if (options.pd) {
    if (auto error = CheckGains("option pd", *options.pd)) return error;
    for (std::size_t i = 0; i < c.scene.mechanisms.size(); ++i)
      HoldMechanism(c, static_cast<int>(i), *options.pd, options.joint_pd);
  }
  for (const auto& [name, gains] : options.joint_pd) {
    const std::string where = fmt::format("option joint-pd '{}'", name);
    if (auto error = CheckGains(where, gains)) return error;
    if (NamesAllJoints(c, name)) {
      HoldAll(c, gains, options.joint_pd);
      continue;
    }
    std::vector<std::string> known;
    int first = -1, count = 0;
    const auto offer = [&](const std::string& joint, int dof, int size) {
      known.push_back(joint);
      if (joint == name) std::tie(first, count) = std::pair(dof, size);
    };
    for (int j = 0; j < c.m.njnt; ++j) {
      if (c.joint[j].mechanism < 0) continue;
      const int dof = c.m.jnt_dofadr[j];
      if (c.m.jnt_type[j] == mjJNT_FREE) {
        offer(c.joint_names[j] + ".position", dof, 3);
        offer(c.joint_names[j] + ".rotation", dof + 3, 3);
      } else {
        offer(c.joint_names[j], dof, c.m.jnt_type[j] == mjJNT_BALL ? 3 : 1);
      }
    }
    if (first < 0) {
      return Error{ErrorCode::kUsage, fmt::format("{}, {}", c.file, where),
                   fmt::format("no mechanism has a hinge, slide or ball joint of that name{}",
                               Suggestion(name, known))};
    }
    for (int i = 0; i < count; ++i) Hold(c, first + i, gains);
  }
  return std::nullopt;
}

namespace {

// Closures whose loop passes through the joints between a body and its parent: of those with one of their two
// bodies among the body and its descendants, and the other outside.
std::string ClosuresThrough(const MechanismDef& mechanism, BodyIndex body) {
  const auto is_below = [&](BodyIndex b) {
    while (b.valid() && b != body) b = mechanism.bodies[b.u()].parent;
    return b.valid();
  };
  std::vector<std::string> names;
  for (const ClosureDef& closure : mechanism.closures)
    if (is_below(closure.body_a) != is_below(closure.body_b)) names.push_back(closure.name);
  return Quoted(names);
}

}  // namespace

void ListHolds(Conversion& c) {
  const mjModel& m = c.m;
  for (int j = 0; j < m.njnt; ++j) {
    if (c.joint[j].mechanism < 0) continue;
    const int first = m.jnt_dofadr[j];
    const int count = m.jnt_type[j] == mjJNT_FREE ? 6 : m.jnt_type[j] == mjJNT_BALL ? 3 : 1;
    bool same = true;
    for (int i = 1; i < count; ++i) same = same && c.held_by[first + i] == c.held_by[first];
    for (int i = 0; i < (same ? 1 : count); ++i) {
      std::string text;
      for (const std::string& hold : c.held_by[first + i]) text += (text.empty() ? "" : ", ") + hold;
      if (text.empty()) {
        const MechanismDef& mechanism = c.scene.mechanisms[static_cast<std::size_t>(c.joint[j].mechanism)];
        const std::string closures = ClosuresThrough(mechanism, mechanism.joints[c.joint[j].joint.u()].body);
        text = closures.empty() ? "nothing" : "closed by " + closures;
      }
      c.report.holds.push_back({same ? c.joint_names[j] : c.DofName(first + i), text});
    }
  }
}

}  // namespace fork1s::internal
