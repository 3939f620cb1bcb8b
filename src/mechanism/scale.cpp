#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/set_stiffness.hpp>

#include <cmath>

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
  const auto pulls_it_alone = [&](const auto& d) {
    return d.along.path < 0 && d.terms.size() == 1 && d.terms[0].first.joint == freedom.joint &&
           d.terms[0].first.freedom == freedom.freedom;
  };
  own.stiffness = stiffness;
  own.damping *= root;
  for (ForceLimitDef& limit : definition.force_limits)
    if (pulls_it_alone(limit)) {
      limit.stiffness *= factor;
      limit.damping *= root;
    }
  for (ControlDef& control : definition.controls)
    if (control.is_setpoint && pulls_it_alone(control)) control.gain *= factor;
  return definition;
}

MechanismDef SetStiffness(MechanismDef definition, const std::string& spring, double stiffness) {
  FORK1S_REQUIRE(stiffness > 0 && std::isfinite(stiffness), "a stiffness of", stiffness,
                 "; give more than 0");
  const double before = StiffnessOf(definition, spring);
  FORK1S_REQUIRE(before > 0, "no spring", spring, "has a stiffness");
  const double factor = stiffness / before, root = std::sqrt(factor);
  for (SpringDef& s : definition.springs) {
    if (s.name != spring) continue;
    s.stiffness *= factor;
    s.damping *= root;
    for (double& higher : s.higher_stiffness) higher *= factor;
    for (double& higher : s.higher_damping) higher *= root;
  }
  for (ForceLimitDef& limit : definition.force_limits) {
    if (limit.name != spring) continue;
    limit.stiffness *= factor;
    limit.damping *= root;
  }
  for (ControlDef& control : definition.controls)
    if (control.name == spring && control.is_setpoint) control.gain *= factor;
  return definition;
}

double StiffnessOf(const MechanismDef& definition, const std::string& spring) {
  double sum = 0;
  for (const SpringDef& s : definition.springs)
    if (s.name == spring) sum += s.stiffness;
  return sum;
}

}  // namespace fork1s
