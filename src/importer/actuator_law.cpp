#include "actuator_law.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

const mjtNum* Gain(const mjModel& m, int i) { return m.actuator_gainprm + mjNGAIN * i; }
const mjtNum* Dynamics(const mjModel& m, int i) { return m.actuator_dynprm + mjNDYN * i; }
const mjtNum* Bias(const mjModel& m, int i) { return m.actuator_biasprm + mjNBIAS * i; }

// What a plugin is called, empty for none.
std::string PluginName(const mjModel& m, int i) {
  const int instance = m.actuator_plugin[i];
  if (instance < 0) return "";
  const mjpPlugin* plugin = mjp_getPluginAtSlot(m.plugin[instance]);
  return plugin != nullptr ? plugin->name : "unknown";
}
constexpr const char* kPidPlugin = "mujoco.pid";

double PluginNumber(const mjModel& m, int i, const char* attribute) {
  const char* text = mj_getPluginConfig(&m, m.actuator_plugin[i], attribute);
  return text != nullptr ? std::strtod(text, nullptr) : 0;
}

std::optional<ActuatorRefusal> WhyNoTransmission(const mjModel& m, int i) {
  switch (m.actuator_trntype[i]) {
    case mjTRN_JOINT:
    case mjTRN_JOINTINPARENT:
    case mjTRN_TENDON:
    case mjTRN_SLIDERCRANK:
    case mjTRN_SITE:
      return std::nullopt;
    case mjTRN_BODY:
      return ActuatorRefusal{"adhesion actuator", "it acts along contacts, not along a length"};
    case mjTRN_SO3:
      return ActuatorRefusal{"orientation servo", "that transmission is not simulated"};
    default:
      return ActuatorRefusal{"actuator", "its transmission is not simulated"};
  }
}

constexpr int kMuscleParameters = 9;  // range[2], force, scale, lmin, lmax, vmax, fpmax, fvmax

std::optional<ActuatorRefusal> WhyNoMuscle(const mjModel& m, int i) {
  const int bias = m.actuator_biastype[i];
  if (m.actuator_dyntype[i] == mjDYN_USER)
    return ActuatorRefusal{"user-defined actuator", "its law is code that is not in the file"};
  if (m.actuator_gaintype[i] != mjGAIN_MUSCLE || (bias != mjBIAS_MUSCLE && bias != mjBIAS_NONE))
    return ActuatorRefusal{"actuator that is in part a muscle",
                           "of a muscle the gain is simulated, with the bias of a muscle or none"};
  if (bias == mjBIAS_MUSCLE && !std::equal(Gain(m, i), Gain(m, i) + kMuscleParameters, Bias(m, i)))
    return ActuatorRefusal{"muscle with two sets of parameters",
                           "only one is simulated; give gainprm and biasprm the same numbers"};
  if (HasNoLength(m, i))
    return ActuatorRefusal{"muscle on a site alone or on a free joint",
                           "it has no length; give it a tendon, or a site with a refsite"};
  const mjtNum* range = m.actuator_lengthrange + 2 * m.actuator_outadr[i];
  if (!(range[0] < range[1]))
    return ActuatorRefusal{"muscle",
                           "no shortest and longest length was found for it; give it a lengthrange"};
  return std::nullopt;
}

std::optional<ActuatorRefusal> WhyNoForce(const mjModel& m, int i) {
  const int dynamics = m.actuator_dyntype[i], gain = m.actuator_gaintype[i], bias = m.actuator_biastype[i];
  if (const std::string plugin = PluginName(m, i); !plugin.empty() && plugin != kPidPlugin) {
    return ActuatorRefusal{fmt::format("actuator of plugin {}", plugin),
                           "what a plugin computes is not known here"};
  }
  if (gain == mjGAIN_MUSCLE || bias == mjBIAS_MUSCLE) return WhyNoMuscle(m, i);
  if (gain == mjGAIN_DCMOTOR) {
    if (Gain(m, i)[0] > 0) return std::nullopt;
    return ActuatorRefusal{"DC motor", "it has no resistance"};
  }
  if (dynamics == mjDYN_USER || gain == mjGAIN_USER || bias == mjBIAS_USER) {
    return ActuatorRefusal{"user-defined actuator", "its law is code that is not in the file"};
  }
  const bool varies = gain == mjGAIN_AFFINE && (Gain(m, i)[1] != 0 || Gain(m, i)[2] != 0);
  if (varies || gain == mjGAIN_SO3) {
    return ActuatorRefusal{"actuator with varying gain", "only a constant gain is simulated"};
  }
  if (bias != mjBIAS_NONE && bias != mjBIAS_AFFINE) {
    return ActuatorRefusal{"actuator with its own bias function", "only an affine bias is simulated"};
  }
  const bool affine = bias == mjBIAS_AFFINE;
  if (affine && Bias(m, i)[1] > 0) {
    return ActuatorRefusal{"actuator with negative stiffness",
                           "it pushes away from its target, which is unstable"};
  }
  if (affine && Bias(m, i)[2] > 0) {
    return ActuatorRefusal{"actuator with negative damping",
                           "it feeds energy into the motion, which is unstable"};
  }
  return std::nullopt;
}

void ReadPlugin(const mjModel& m, LinearActuator& a) {
  const double kp = PluginNumber(m, a.actuator, "kp"), kd = PluginNumber(m, a.actuator, "kd");
  a.b1 = -kp;
  a.b2 = -kd;
  a.inputs.push_back({a.name, m.actuator_ctrladr[a.actuator], kp, kp != 0});
  if (PluginNumber(m, a.actuator, "ki") != 0) a.left_out.push_back("its integral gain");
  if (PluginNumber(m, a.actuator, "slewmax") != 0) a.left_out.push_back("the slew limit of its set-point");
}

// kp (u_pos - L) + kv (u_vel - dL/dt) + u_ff, of which the inputs are those that the file asks for.
void AddPidInputs(const mjModel& m, LinearActuator& a) {
  const int i = a.actuator, spec = m.actuator_ctrlspec[i], count = m.actuator_ctrlnum[i];
  int ctrl = m.actuator_ctrladr[i];
  const auto add = [&](int flag, const char* suffix, double gain, bool setpoint) {
    if (!(spec & flag)) return;
    a.inputs.push_back({count == 1 ? a.name : fmt::format("{}.{}", a.name, suffix), ctrl++, gain, setpoint});
  };
  add(mjINPUT_POS, "pos", -a.b1, a.b1 < 0);
  add(mjINPUT_VEL, "vel", -a.b2, false);
  add(mjINPUT_FF, "ff", 1, false);
}

void ReadPid(const mjModel& m, LinearActuator& a) {
  const int i = a.actuator;
  AddPidInputs(m, a);
  if (Gain(m, i)[0] != 0) a.left_out.push_back("its integral gain");
  if (m.actuator_actnum[i] > (Gain(m, i)[0] != 0 ? 1 : 0))
    a.left_out.push_back("the slew limit of its set-point");
}

// A motor at voltage V gives K (V - K dL/dt)/R; its controller, where one is on board, makes the torque that
// its gains ask for.
void ReadDcMotor(const mjModel& m, LinearActuator& a) {
  const int i = a.actuator, spec = m.actuator_ctrlspec[i];
  const double resistance = Gain(m, i)[0], constant = Gain(m, i)[1];
  if (spec & (mjINPUT_VOLTAGE | mjINPUT_NONE)) {
    a.b2 = -constant * constant / resistance;
    if (spec & mjINPUT_VOLTAGE)
      a.inputs.push_back({a.name, m.actuator_ctrladr[i], constant / resistance, false});
  } else {
    a.b1 = -Gain(m, i)[4];
    a.b2 = -Gain(m, i)[6];
    AddPidInputs(m, a);
    if (Gain(m, i)[5] != 0) a.left_out.push_back("its integral gain");
  }
  if (Dynamics(m, i)[0] > 0) a.left_out.push_back("the inductance of its winding");
  if (Dynamics(m, i)[2] > 0) a.left_out.push_back("the warming of its winding");
  if (Bias(m, i)[0] != 0) a.left_out.push_back("its cogging");
  if (Bias(m, i)[3] != 0) a.left_out.push_back("its LuGre friction");
}

// At its length range as MuJoCo has it, without `at_reference`.
MuscleDef ReadMuscle(const mjModel& m, int i) {
  const mjtNum *p = Gain(m, i), *range = m.actuator_lengthrange + 2 * m.actuator_outadr[i];
  MuscleDef muscle;
  muscle.range_lower = p[0];
  muscle.range_upper = p[1];
  muscle.force = p[2] < 0 ? p[3] / std::max(mjMINVAL, m.actuator_acc0[m.actuator_outadr[i]]) : p[2];
  muscle.lmin = p[4];
  muscle.lmax = p[5];
  muscle.vmax = p[6];
  muscle.fpmax = m.actuator_biastype[i] == mjBIAS_MUSCLE ? p[7] : 0;
  muscle.fvmax = p[8];
  muscle.length_lower = range[0];
  muscle.length_upper = range[1];
  return muscle;
}

LinearActuator Law(const mjModel& m, const mjData& d, int i) {
  LinearActuator a;
  a.actuator = i;
  a.name = NameOr(m, m.name_actuatoradr[i], "actuator", i);
  a.length = ActuatorLength(m, d, i);
  if (m.actuator_delay[i] > 0)
    a.left_out.push_back(fmt::format("the delay of {:.4g} s of its input", m.actuator_delay[i]));
  if (std::any_of(m.actuator_dampingpoly + mjNPOLY * i, m.actuator_dampingpoly + mjNPOLY * (i + 1),
                  [](mjtNum x) { return x != 0; }))
    a.left_out.push_back("its damping of higher order in speed");
  if (m.actuator_plugin[i] >= 0) {
    ReadPlugin(m, a);
    return a;
  }
  if (m.actuator_biastype[i] == mjBIAS_AFFINE) {
    a.b0 = Bias(m, i)[0];
    a.b1 = Bias(m, i)[1];
    a.b2 = Bias(m, i)[2];
  }
  if (m.actuator_gaintype[i] == mjGAIN_MUSCLE) {
    a.muscle = ReadMuscle(m, i);
    a.muscle->length_lower -= a.length.at_reference;
    a.muscle->length_upper -= a.length.at_reference;
    a.inputs.push_back({a.name, m.actuator_ctrladr[i], 0, false});
    ReadDynamics(m, i, a.inputs.back());
    if (m.actuator_forcelimited[i]) a.left_out.push_back("its forcerange");
  } else if (m.actuator_gaintype[i] == mjGAIN_DCMOTOR) {
    ReadDcMotor(m, a);
  } else if (m.actuator_gaintype[i] == mjGAIN_PID) {
    ReadPid(m, a);
  } else {
    a.inputs.push_back({a.name, m.actuator_ctrladr[i], Gain(m, i)[0], a.b1 < 0});
    ReadDynamics(m, i, a.inputs.back());
  }
  return a;
}

}  // namespace

// MuJoCo's filter takes steps of explicit Euler towards the same solution as filterexact.
void ReadDynamics(const mjModel& m, int i, ActuatorInput& input) {
  const int type = m.actuator_dyntype[i];
  if (type == mjDYN_MUSCLE) {
    input.dynamics = ControlDynamics::kMuscle;
    input.time_constant = Dynamics(m, i)[0];
    input.deactivation_time = Dynamics(m, i)[1];
    input.smoothing = Dynamics(m, i)[2] < mjMINVAL ? 0 : Dynamics(m, i)[2];
  }
  if (type == mjDYN_INTEGRATOR) input.dynamics = ControlDynamics::kIntegrator;
  if (type != mjDYN_FILTER && type != mjDYN_FILTEREXACT) return;
  if (Dynamics(m, i)[0] < mjMINVAL) return;  // no lag in MuJoCo either
  input.dynamics = ControlDynamics::kLag;
  input.time_constant = Dynamics(m, i)[0];
}

// Groups are numbered from 0; only the first 31 have a bit.
bool IsInDisabledGroup(const mjModel& m, int i) {
  const int group = m.actuator_group[i];
  return group >= 0 && group < 31 && (m.opt.disableactuator >> group & 1);
}

std::optional<ActuatorRefusal> WhyNoLaw(const mjModel& m, int i) {
  if (IsInDisabledGroup(m, i))
    return ActuatorRefusal{fmt::format("actuator of group {}", m.actuator_group[i]),
                           "actuatorgroupdisable in <option> switches it off"};
  if (auto refusal = WhyNoForce(m, i)) return refusal;
  return WhyNoTransmission(m, i);
}

std::vector<LinearActuator> LinearActuators(const mjModel& m, const mjData& d) {
  std::vector<LinearActuator> actuators;
  for (int i = 0; i < m.nactuator; ++i) {
    if (WhyNoLaw(m, i)) continue;
    LinearActuator a = Law(m, d, i);
    // A wrench has no length that could hold it.
    if (HasNoLength(m, i)) {
      a.b1 = 0;
      for (ActuatorInput& input : a.inputs) input.setpoint = false;
    }
    // A spring acts on the angular velocity, not on the rotation vector.
    if (IsOnBall(m, i) && a.b1 != 0) a.length.actuator = i;
    if (!a.length.terms.empty()) actuators.push_back(std::move(a));
  }
  return actuators;
}

}  // namespace fork1s::internal
