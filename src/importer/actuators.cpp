// Actuators that are linear in input, length and speed, as inputs and springs.
//
// F = gain u + b0 + b1 L + b2 L̇ with L = L0 + Σ a q, and the freedom feels a F (a carries the gear).
// On one freedom:  force = a gain u + c - k q - d q̇,  k = -b1 a², c = a (b0 + b1 L0), d = -b2 a².
// On several:      a spring of the length Σ a q with k = -b1, rest = b0/k - L0, d = -b2.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

void AddControl(Conversion& c, const LinearActuator& a, const ActuatorInput& input) {
  const int mechanism = c.MechanismOf(a.length.terms[0].first);
  ControlDef& control = AddControl(c, a.actuator, mechanism, input);
  c.PutLength(a.length, control);
  control.gain = input.gain;
  control.is_setpoint = input.setpoint;
  if (input.setpoint) {
    control.setpoint_per_unit = input.gain / -a.b1;
    control.setpoint_rest = a.b0 / -a.b1 - a.length.at_reference;
  }
  // The voltage of a motor is none, whatever its gain and damping are.
  control.is_velocity_setpoint = !input.setpoint && a.b2 < 0 && input.gain == -a.b2 &&
                                 c.m.actuator_gaintype[a.actuator] != mjGAIN_DCMOTOR;
  ControlSource& source = c.controls[mechanism].back();
  source.servo = !a.muscle && a.b1 < 0;
  source.motor = !a.muscle && a.b1 == 0 && a.b2 == 0 && a.length.terms.size() == 1;
  for (const auto& term : a.length.terms) source.dofs.push_back(term.first);
}

void AddMuscle(Conversion& c, const LinearActuator& a) {
  MuscleDef muscle = *a.muscle;
  muscle.name = muscle.control = a.name;
  c.PutLength(a.length, muscle);
  for (const auto& term : a.length.terms) {
    c.in_spring[term.first] = true;
    c.held_by[term.first].push_back(
        fmt::format("muscle '{}', {:.4g} N at most at its optimum", a.name, muscle.force));
  }
  c.scene.mechanisms[c.MechanismOf(a.length.terms[0].first)].muscles.push_back(std::move(muscle));
}

// Unit of a stiffness along the length, which is that of an angle, or of a length.
std::string StiffnessUnit(const Conversion& c, const Length& length) {
  if (length.tendon >= 0) return "N/m";
  if (length.actuator >= 0 && !IsOnBall(c.m, length.actuator)) {
    if (c.m.actuator_trntype[length.actuator] != mjTRN_SITE) return "N/m";  // a slider-crank
    const mjtNum* gear = c.m.actuator_gear + 6 * static_cast<std::ptrdiff_t>(length.actuator);
    const bool moves = gear[0] != 0 || gear[1] != 0 || gear[2] != 0;
    const bool turns = gear[3] != 0 || gear[4] != 0 || gear[5] != 0;
    return moves && turns ? "per unit length" : turns ? "N·m/rad" : "N/m";
  }
  const std::string unit = c.StiffnessUnit(length.terms[0].first);
  for (const auto& [dof, coefficient] : length.terms)
    if (c.StiffnessUnit(dof) != unit) return "per unit length";
  return unit;
}

void AddHold(Conversion& c, const LinearActuator& a) {
  if (a.length.is_single()) {
    const auto [dof, coefficient] = a.length.terms[0];
    const double k = -a.b1 * coefficient * coefficient;
    c.k[dof] += k;
    c.c[dof] += coefficient * (a.b0 + a.b1 * a.length.at_reference);
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
    for (const auto& term : a.length.terms) {
      c.held_by[term.first].push_back(fmt::format("motor '{}' over several joints, no stiffness", a.name));
    }
    return;
  }
  SpringDef spring;
  spring.name = a.name;
  c.PutLength(a.length, spring);
  for (const auto& term : a.length.terms) {
    const int dof = term.first;
    if (a.b1 < 0) c.in_spring[dof] = true;
    c.held_by[dof].push_back(fmt::format("actuator '{}' over {} freedom{}, {:.4g} {}", a.name,
                                         a.length.terms.size(), a.length.terms.size() == 1 ? "" : "s", -a.b1,
                                         StiffnessUnit(c, a.length)));
  }
  spring.stiffness = -a.b1;
  spring.damping = -a.b2;
  if (a.b1 < 0) spring.rest = a.b0 / -a.b1 - a.length.at_reference;
  c.scene.mechanisms[c.MechanismOf(a.length.terms[0].first)].springs.push_back(std::move(spring));
}

// Damping and rotor of the actuator itself, which no bound of its force holds back.
void AddDrive(Conversion& c, const LinearActuator& a) {
  const double damping = c.m.actuator_damping[a.actuator], armature = c.m.actuator_armature[a.actuator];
  const bool on_one_axis = c.m.actuator_trntype[a.actuator] == mjTRN_JOINT && a.length.terms.size() == 1;
  if (a.length.is_single() || on_one_axis) {
    const auto [dof, coefficient] = a.length.terms[0];
    c.FreedomOf(dof).damping += damping * coefficient * coefficient;
    c.FreedomOf(dof).armature += armature * coefficient * coefficient;
    return;
  }
  if (armature != 0)
    c.Dropped(fmt::format("armature of actuator '{}'", a.name),
              "rotors that several joints turn are not simulated");
  if (damping == 0) return;
  SpringDef damper;
  damper.name = a.name + " damping";
  c.PutLength(a.length, damper);
  damper.damping = damping;
  c.scene.mechanisms[c.MechanismOf(a.length.terms[0].first)].springs.push_back(std::move(damper));
}

}  // namespace

ControlDef& AddControl(Conversion& c, int actuator, int mechanism, const ActuatorInput& input) {
  const mjModel& m = c.m;
  ControlDef control;
  control.name = input.name;
  control.dynamics = input.dynamics;
  control.time_constant = input.time_constant;
  control.deactivation_time = input.deactivation_time;
  control.smoothing = input.smoothing;
  if (m.actuator_ctrllimited[input.ctrl] && !(m.opt.disableflags & mjDSBL_CLAMPCTRL)) {
    control.lower = m.actuator_ctrlrange[2 * input.ctrl];
    control.upper = m.actuator_ctrlrange[2 * input.ctrl + 1];
  }
  if (input.dynamics != ControlDynamics::kNone && m.actuator_actlimited[actuator]) {
    control.activation_lower = m.actuator_actrange[2 * actuator];
    control.activation_upper = m.actuator_actrange[2 * actuator + 1];
  }
  control.initial = std::clamp(0.0, control.lower, control.upper);
  ControlSource source;
  source.ctrl = input.ctrl;
  if (input.dynamics != ControlDynamics::kNone) source.act = m.actuator_actadr[actuator];
  c.scene.mechanisms[mechanism].controls.push_back(std::move(control));
  c.controls[mechanism].push_back(std::move(source));
  return c.scene.mechanisms[mechanism].controls.back();
}

void ConvertActuators(Conversion& c) {
  const mjModel& m = c.m;
  if (m.opt.disableflags & mjDSBL_ACTUATION) {
    if (m.nactuator > 0)
      c.Dropped(fmt::format("{} actuators", m.nactuator), "actuation is switched off in <option>");
    return;
  }
  std::map<std::string, std::pair<std::string, std::vector<std::string>>> refused;
  for (int i = 0; i < m.nactuator; ++i) {
    if (ActsByAdhesion(m, i)) continue;
    if (auto refusal = WhyNoLaw(m, i)) {
      auto& entry = refused[refusal->kind];
      entry.first = refusal->why;
      entry.second.push_back(c.actuator_names[i]);
    }
  }
  for (const auto& [kind, entry] : refused) c.DroppedMany(kind, entry.second, entry.first);
  std::vector<bool> moves(static_cast<std::size_t>(m.nactuator), false);
  std::map<std::string, std::vector<std::string>> left_out;
  for (const LinearActuator& a : LinearActuators(m, c.d)) {
    moves[static_cast<std::size_t>(a.actuator)] = true;
    if (a.muscle)
      AddMuscle(c, a);
    else
      AddHold(c, a);
    AddDrive(c, a);
    for (const ActuatorInput& input : a.inputs) AddControl(c, a, input);
    if (a.inputs.size() == 1 && !a.muscle)
      c.report.servos.push_back({c.MechanismOf(a.length.terms[0].first), a.inputs[0].name, -a.b1, -a.b2, a.b0,
                                 a.length.at_reference});
    for (const std::string& part : a.left_out) left_out[part].push_back(a.name);
  }
  for (int i = 0; i < m.nactuator; ++i) {
    if (!moves[static_cast<std::size_t>(i)] && !WhyNoLaw(m, i))
      c.Dropped(fmt::format("actuator '{}'", c.actuator_names[i]), "its gear is zero, so it moves nothing");
  }
  for (const auto& [part, names] : left_out)
    c.DroppedMany("part of actuator", names, fmt::format("{} is left out", part));
  ConvertAdhesions(c);
}

}  // namespace fork1s::internal
