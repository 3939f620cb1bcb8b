// Actuators that are linear in input, length and speed, as inputs and springs.
//
// F = gain u + b0 + b1 L + b2 L̇ with L = Σ a (q + q0), and the freedom feels a F (a carries the gear).
// On one freedom:  force = a gain u + c - k q - d q̇,  k = -b1 a², c = a b0 + a² b1 q0, d = -b2 a².
// On several:      a spring of the length ℓ = Σ a q with k = -b1, rest = b0/k - ℓ0, d = -b2.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

struct Refusal {
  std::string kind;
  std::string why;
};

// Why an actuator cannot be simulated, if so.
std::optional<Refusal> WhyNot(const mjModel& m, int i) {
  if (m.actuator_dyntype[i] == mjDYN_MUSCLE || m.actuator_gaintype[i] == mjGAIN_MUSCLE ||
      m.actuator_biastype[i] == mjBIAS_MUSCLE) {
    return Refusal{"muscle", "muscles are not simulated"};
  }
  if (m.actuator_dyntype[i] != mjDYN_NONE) {
    return Refusal{"actuator with activation dynamics", "inputs act at once here"};
  }
  const bool gain_varies =
      m.actuator_gaintype[i] == mjGAIN_AFFINE &&
      (m.actuator_gainprm[mjNGAIN * i + 1] != 0 || m.actuator_gainprm[mjNGAIN * i + 2] != 0);
  if (gain_varies || m.actuator_gaintype[i] > mjGAIN_AFFINE) {
    return Refusal{"actuator with varying gain", "only a constant gain is simulated"};
  }
  if (m.actuator_biastype[i] != mjBIAS_NONE && m.actuator_biastype[i] != mjBIAS_AFFINE) {
    return Refusal{"actuator with its own bias function", "only an affine bias is simulated"};
  }
  switch (m.actuator_trntype[i]) {
    case mjTRN_JOINT:
    case mjTRN_JOINTINPARENT:
      if (m.jnt_type[m.actuator_trnid[2 * i]] == mjJNT_FREE) {
        return Refusal{"actuator on a free joint", "a free body is pushed by pulls, not by actuators"};
      }
      break;
    case mjTRN_TENDON: {
      const int t = m.actuator_trnid[2 * i];
      if (m.tendon_num[t] > 0 && m.wrap_type[m.tendon_adr[t]] != mjWRAP_JOINT) {
        return Refusal{"actuator on a spatial tendon", "only fixed tendons are simulated"};
      }
      break;
    }
    case mjTRN_SLIDERCRANK:
      return Refusal{"slider-crank actuator", "that transmission is not simulated"};
    case mjTRN_SITE:
      return Refusal{"actuator on a site", "that transmission is not simulated"};
    case mjTRN_BODY:
      return Refusal{"adhesion actuator", "adhesion is not simulated"};
    default:
      return Refusal{"actuator", "its transmission is not simulated"};
  }
  const bool affine = m.actuator_biastype[i] == mjBIAS_AFFINE;
  if (affine && m.actuator_biasprm[mjNBIAS * i + 1] > 0) {
    return Refusal{"actuator with negative stiffness", "it pushes away from its target, which is unstable"};
  }
  if (affine && m.actuator_biasprm[mjNBIAS * i + 2] > 0) {
    return Refusal{"actuator with negative damping", "it feeds energy into the motion, which is unstable"};
  }
  return std::nullopt;
}

std::vector<std::pair<int, double>> Terms(const mjModel& m, int i) {
  std::vector<std::pair<int, double>> terms;
  const mjtNum* gear = m.actuator_gear + 6 * i;
  const int target = m.actuator_trnid[2 * i];
  if (m.actuator_trntype[i] == mjTRN_TENDON) {
    for (int w = m.tendon_adr[target]; w < m.tendon_adr[target] + m.tendon_num[target]; ++w) {
      const double a = gear[0] * m.wrap_prm[w];
      if (a != 0) terms.emplace_back(m.jnt_dofadr[m.wrap_objid[w]], a);
    }
    return terms;
  }
  const int count = m.jnt_type[target] == mjJNT_BALL ? 3 : 1;
  for (int k = 0; k < count; ++k) {
    if (gear[k] != 0) terms.emplace_back(m.jnt_dofadr[target] + k, gear[k]);
  }
  return terms;
}

void AddControl(Conversion& c, const LinearActuator& a) {
  const mjModel& m = c.m;
  const int mechanism = c.MechanismOf(a.terms[0].first);
  ControlDef control;
  control.name = a.name;
  for (const auto& [dof, coefficient] : a.terms) control.terms.emplace_back(c.Freedom(dof), coefficient);
  control.gain = a.gain;
  control.is_setpoint = a.b1 < 0;
  if (m.actuator_ctrllimited[a.actuator]) {
    control.lower = m.actuator_ctrlrange[2 * a.actuator];
    control.upper = m.actuator_ctrlrange[2 * a.actuator + 1];
  }
  control.initial = std::clamp(0.0, control.lower, control.upper);
  ControlSource source;
  source.actuator = a.actuator;
  source.motor = a.b1 == 0 && a.b2 == 0 && a.terms.size() == 1;
  for (const auto& term : a.terms) source.dofs.push_back(term.first);
  c.scene.mechanisms[mechanism].controls.push_back(std::move(control));
  c.controls[mechanism].push_back(std::move(source));
}

void AddHold(Conversion& c, const LinearActuator& a) {
  if (a.terms.size() == 1) {
    const auto [dof, coefficient] = a.terms[0];
    const double k = -a.b1 * coefficient * coefficient;
    c.k[dof] += k;
    c.c[dof] += coefficient * a.b0 - k * c.Reference(dof);
    c.FreedomOf(dof).damping += -a.b2 * coefficient * coefficient;
    if (k > 0) {
      c.held_by[dof].push_back(
          fmt::format("position actuator '{}' {:.4g} {}", a.name, k, c.StiffnessUnit(dof)));
    } else if (a.b2 != 0) {
      c.held_by[dof].push_back(fmt::format("velocity actuator '{}', damping only", a.name));
    } else {
      c.held_by[dof].push_back(fmt::format("motor '{}', no stiffness", a.name));
    }
    return;
  }
  if (a.b1 == 0 && a.b2 == 0) {
    if (a.b0 != 0) c.Dropped(fmt::format("actuator '{}'", a.name), "its constant bias force is left out");
    for (const auto& term : a.terms) {
      c.held_by[term.first].push_back(fmt::format("motor '{}' over several joints, no stiffness", a.name));
    }
    return;
  }
  SpringDef spring;
  spring.name = a.name;
  double length0 = 0;
  for (const auto& [dof, coefficient] : a.terms) {
    spring.terms.emplace_back(c.Freedom(dof), coefficient);
    length0 += coefficient * c.Reference(dof);
    if (a.b1 < 0) c.in_spring[dof] = true;
    c.held_by[dof].push_back(
        fmt::format("actuator '{}' over {} freedoms, {:.4g} per unit length", a.name, a.terms.size(), -a.b1));
  }
  spring.stiffness = -a.b1;
  spring.damping = -a.b2;
  if (a.b1 < 0) spring.rest = a.b0 / -a.b1 - length0;
  c.scene.mechanisms[c.MechanismOf(a.terms[0].first)].springs.push_back(std::move(spring));
}

}  // namespace

std::vector<LinearActuator> LinearActuators(const mjModel& m) {
  std::vector<LinearActuator> actuators;
  for (int i = 0; i < m.nu; ++i) {
    if (WhyNot(m, i)) continue;
    LinearActuator a;
    a.actuator = i;
    a.name = NameOr(m, m.name_actuatoradr[i], "actuator", i);
    a.terms = Terms(m, i);
    a.gain = m.actuator_gainprm[mjNGAIN * i];
    if (m.actuator_biastype[i] == mjBIAS_AFFINE) {
      const mjtNum* b = m.actuator_biasprm + mjNBIAS * i;
      a.b0 = b[0];
      a.b1 = b[1];
      a.b2 = b[2];
    }
    if (!a.terms.empty()) actuators.push_back(std::move(a));
  }
  return actuators;
}

void ConvertActuators(Conversion& c) {
  const mjModel& m = c.m;
  if (m.opt.disableflags & mjDSBL_ACTUATION) {
    if (m.nu > 0) c.Dropped(fmt::format("{} actuators", m.nu), "actuation is switched off in <option>");
    return;
  }
  std::map<std::string, std::pair<std::string, std::vector<std::string>>> refused;
  for (int i = 0; i < m.nu; ++i) {
    if (auto refusal = WhyNot(m, i)) {
      auto& entry = refused[refusal->kind];
      entry.first = refusal->why;
      entry.second.push_back(c.actuator_names[i]);
    } else if (Terms(m, i).empty()) {
      c.Dropped(fmt::format("actuator '{}'", c.actuator_names[i]), "its gear is zero, so it moves nothing");
    }
  }
  for (const auto& [kind, entry] : refused) c.DroppedMany(kind, entry.second, entry.first);
  std::vector<std::string> clipped, in_parent;
  for (const LinearActuator& a : LinearActuators(m)) {
    AddHold(c, a);
    AddControl(c, a);
    if (m.actuator_forcelimited[a.actuator]) clipped.push_back(a.name);
    const bool turns = m.actuator_trntype[a.actuator] == mjTRN_JOINTINPARENT && a.terms.size() > 1;
    if (turns) in_parent.push_back(a.name);
  }
  c.DroppedMany("force limit of actuator", clipped, "forces of actuators are not clipped");
  c.DroppedMany("parent axes of ball joint actuator", in_parent, "its torque turns with the child instead");
}

}  // namespace fork1s::internal
