#include <fork1s/mechanism/mechanism.hpp>

#include <cmath>

namespace fork1s {

MechanismDef ScaleStiffness(MechanismDef definition, double factor) {
  FORK1S_REQUIRE(factor >= 0 && std::isfinite(factor), factor);
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

}  // namespace fork1s
