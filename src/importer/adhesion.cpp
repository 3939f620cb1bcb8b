// Adhesion actuators: transmission "body", a force that pulls the body and what it touches together.
#include <fmt/format.h>

#include <algorithm>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

// Why one has no place in the scene; empty where it has one.
std::string WhyNoAdhesion(const Conversion& c, int i) {
  const mjModel& m = c.m;
  if (m.actuator_plugin[i] >= 0 || m.actuator_gaintype[i] != mjGAIN_FIXED ||
      m.actuator_biastype[i] != mjBIAS_NONE || m.actuator_dyntype[i] == mjDYN_USER ||
      m.actuator_dyntype[i] == mjDYN_MUSCLE)
    return "of adhesion a constant gain without bias is simulated; write gainprm=\"gain\" and no biasprm";
  const BodyPlace& place = c.body[m.actuator_trnid[2 * i]];
  if (place.mechanism < 0) return "its body is still; give the adhesion to the bodies that it would attract";
  const MechanismDef& mechanism = c.scene.mechanisms[static_cast<std::size_t>(place.mechanism)];
  const auto& shapes = mechanism.bodies[place.body.u()].geometries;
  if (std::none_of(shapes.begin(), shapes.end(), [](const GeometryDef& g) { return g.Collides(); }))
    return "its body has no shape that can touch";
  return {};
}

}  // namespace

bool IsAdhesion(const mjModel& m, int actuator) { return m.actuator_trntype[actuator] == mjTRN_BODY; }

bool ActsByAdhesion(const mjModel& m, int actuator) {
  return IsAdhesion(m, actuator) && !IsInDisabledGroup(m, actuator) &&
         !(m.opt.disableflags & mjDSBL_ACTUATION);
}

void ConvertAdhesions(Conversion& c) {
  const mjModel& m = c.m;
  for (int i = 0; i < m.nactuator; ++i) {
    if (!ActsByAdhesion(m, i)) continue;
    const std::string &name = c.actuator_names[i], what = fmt::format("adhesion actuator '{}'", name);
    if (const std::string why = WhyNoAdhesion(c, i); !why.empty()) {
      c.Dropped(what, why);
      continue;
    }
    const BodyPlace& place = c.body[m.actuator_trnid[2 * i]];
    const auto at = static_cast<std::size_t>(place.mechanism);
    MechanismDef& mechanism = c.scene.mechanisms[at];
    AdhesionDef adhesion;
    adhesion.name = adhesion.control = name;
    adhesion.body = mechanism.bodies[place.body.u()].name;
    adhesion.gain = m.actuator_gainprm[mjNGAIN * i];
    if (m.actuator_forcelimited[i]) {
      adhesion.lower = m.actuator_forcerange[2 * i];
      adhesion.upper = m.actuator_forcerange[2 * i + 1];
    }
    mechanism.adhesions.push_back(std::move(adhesion));
    if (m.actuator_delay[i] > 0)
      c.Dropped(fmt::format("part of {}", what),
                fmt::format("the delay of {:.4g} s of its input is left out", m.actuator_delay[i]));
    ActuatorInput input;
    input.name = name;
    input.ctrl = m.actuator_ctrladr[i];
    ReadDynamics(m, i, input);
    AddControl(c, i, place.mechanism, input);
  }
}

}  // namespace fork1s::internal
