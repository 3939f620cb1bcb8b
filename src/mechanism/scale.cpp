#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/set_stiffness.hpp>

#include <algorithm>
#include <cmath>

#include "freedoms.hpp"
#include "sensor_stiffness.hpp"

namespace fork1s {

MechanismDef ScaleStiffness(MechanismDef definition, double factor) {
  FORK1S_REQUIRE(factor >= 0 && std::isfinite(factor), "a factor of", factor, "; give 0 or more");
  // Damping goes with the square root so that damping ratios stay as they are.
  const double root = std::sqrt(factor);
  for (auto& joint : definition.joints)
    for (auto& f : joint.freedoms) {
      f.stiffness *= factor;
      f.damping *= root;
    }
  for (auto& spring : definition.springs) {
    spring.stiffness *= factor;
    spring.damping *= root;
    for (double& higher : spring.higher_stiffness) higher *= factor;
    for (double& higher : spring.higher_damping) higher *= root;
  }
  for (auto& limit : definition.force_limits) {
    limit.stiffness *= factor;
    limit.damping *= root;
  }
  for (auto& closure : definition.closures) {
    closure.stiffness *= factor;
    closure.damping *= root;
  }
  for (auto& control : definition.controls)
    if (control.is_setpoint) control.gain *= factor;
  return definition;
}

MechanismDef SetStiffness(MechanismDef definition, FreedomRef freedom, double stiffness) {
  FORK1S_REQUIRE(stiffness >= 0 && std::isfinite(stiffness), "a stiffness of", stiffness, "; give 0 or more");
  internal::RequireIndex("joint", freedom.joint.value(), definition.joints.size());
  internal::RequireIndex("freedom", freedom.freedom, definition.joints[freedom.joint.u()].freedoms.size());
  FreedomDef& own = definition.joints[freedom.joint.u()].freedoms[static_cast<std::size_t>(freedom.freedom)];
  const double factor = own.stiffness > 0 ? stiffness / own.stiffness : 1;
  const double root = std::sqrt(factor);
  own.stiffness = stiffness;
  own.damping *= root;
  for (ForceLimitDef& limit : definition.force_limits)
    if (internal::IsAlong(freedom, limit)) {
      limit.stiffness *= factor;
      limit.damping *= root;
    }
  for (ControlDef& control : definition.controls)
    if (control.is_setpoint && internal::IsAlong(freedom, control)) control.gain *= factor;
  return definition;
}

MechanismDef SetStiffness(MechanismDef definition, const std::string& spring, double stiffness) {
  FORK1S_REQUIRE(stiffness > 0 && std::isfinite(stiffness), "a stiffness of", stiffness,
                 "; give more than 0");
  const double before = StiffnessOf(definition, spring);
  FORK1S_REQUIRE(before > 0, "no spring", spring, "has a stiffness");
  internal::ScaleSprings(spring, {}, stiffness / before, definition);
  return definition;
}

void internal::ScaleSprings(const std::string& name, const std::vector<FreedomRef>& freedoms, double factor,
                            MechanismDef& definition) {
  const double root = std::sqrt(factor);
  const auto is_along_one = [&](const auto& length) {
    return std::any_of(freedoms.begin(), freedoms.end(),
                       [&](FreedomRef freedom) { return IsAlong(freedom, length); });
  };
  for (SpringDef& s : definition.springs) {
    if (s.name != name || !(HasStiffness(s) || is_along_one(s))) continue;
    s.stiffness *= factor;
    s.damping *= root;
    for (double& higher : s.higher_stiffness) higher *= factor;
    for (double& higher : s.higher_damping) higher *= root;
  }
  for (ForceLimitDef& limit : definition.force_limits) {
    if (limit.name != name || is_along_one(limit)) continue;
    limit.stiffness *= factor;
    limit.damping *= root;
  }
  for (ControlDef& control : definition.controls)
    if (control.name == name && control.is_setpoint && !is_along_one(control)) control.gain *= factor;
}

double StiffnessOf(const MechanismDef& definition, const std::string& spring) {
  double sum = 0;
  for (const SpringDef& s : definition.springs)
    if (s.name == spring) sum += s.stiffness;
  return sum;
}

}  // namespace fork1s
