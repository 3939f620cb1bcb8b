#include "sensor_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/set_stiffness.hpp>

#include "freedoms.hpp"

namespace fork1s::internal {
namespace {

void Scale(const Scene& scene, double factor, SensorActuator& actuator) {
  const auto& controls = scene.mechanisms[static_cast<std::size_t>(actuator.mechanism)].controls;
  for (auto& [name, gain] : actuator.inputs)
    for (const ControlDef& control : controls)
      if (control.name == name && control.is_setpoint) gain *= factor;
  actuator.damping *= std::sqrt(factor);
  // A bias is the rest of a spring where there is one.
  if (actuator.stiffness > 0) actuator.bias *= factor;
  actuator.stiffness *= factor;
}

// Whether a spring of the mechanism is that of the sensor; else it is part of the stiffness of a joint.
bool HasSpringOf(const MechanismDef& def, const SensorSpring& of) {
  return std::any_of(def.springs.begin(), def.springs.end(), [&](const SpringDef& s) {
    return s.name == of.spring.name && HasStiffness(s) && s.along.path == of.spring.along.path &&
           std::equal(s.terms.begin(), s.terms.end(), of.spring.terms.begin(), of.spring.terms.end(),
                      [](const auto& a, const auto& b) {
                        return a.first.joint == b.first.joint && a.first.freedom == b.first.freedom &&
                               a.second == b.second;
                      });
  });
}

}  // namespace

void ScaleSensorLaws(double factor, Scene& scene) {
  for (SensorDef& sensor : scene.sensors) {
    for (SensorActuator& actuator : sensor.actuators) Scale(scene, factor, actuator);
    for (SensorSpring& of : sensor.springs) {
      of.spring.stiffness *= factor;
      for (double& higher : of.spring.higher_stiffness) higher *= factor;
    }
  }
}

void SetSensorStiffness(std::size_t mechanism, FreedomRef freedom, double stiffness, Scene& scene) {
  const FreedomDef& own = scene.mechanisms[mechanism]
                              .joints[freedom.joint.u()]
                              .freedoms[static_cast<std::size_t>(freedom.freedom)];
  const double factor = own.stiffness > 0 ? stiffness / own.stiffness : 1;
  const auto is_along = [&](int of, const auto& length) {
    return of == static_cast<int>(mechanism) && IsAlong(freedom, length);
  };
  for (SensorDef& sensor : scene.sensors) {
    for (SensorActuator& actuator : sensor.actuators)
      if (is_along(actuator.mechanism, actuator)) Scale(scene, factor, actuator);
    for (SensorSpring& of : sensor.springs)
      if (is_along(of.mechanism, of.spring) && !HasSpringOf(scene.mechanisms[mechanism], of))
        of.spring.stiffness *= factor;
    if (sensor.kind != SensorKind::kPotentialEnergy || own.stiffness > 0 || stiffness == 0) continue;
    SpringDef spring;  // there was none
    spring.name = scene.mechanisms[mechanism].joints[freedom.joint.u()].name;
    spring.terms = {{freedom, 1.0}};
    spring.rest = own.rest;
    spring.stiffness = stiffness;
    sensor.springs.push_back({static_cast<int>(mechanism), std::move(spring)});
  }
}

void SetSensorStiffness(std::size_t mechanism, const std::string& spring, double stiffness, Scene& scene) {
  ScaleSensorSprings(mechanism, spring, {}, stiffness / StiffnessOf(scene.mechanisms[mechanism], spring),
                     scene);
}

void ScaleSensorSprings(std::size_t mechanism, const std::string& name,
                        const std::vector<FreedomRef>& freedoms, double factor, Scene& scene) {
  const auto is_servo = [&](const SensorActuator& actuator) {
    return actuator.mechanism == static_cast<int>(mechanism) &&
           std::any_of(actuator.inputs.begin(), actuator.inputs.end(),
                       [&](const auto& input) { return input.first == name; }) &&
           std::none_of(freedoms.begin(), freedoms.end(),
                        [&](FreedomRef freedom) { return IsAlong(freedom, actuator); });
  };
  for (SensorDef& sensor : scene.sensors) {
    for (SensorActuator& actuator : sensor.actuators)
      if (is_servo(actuator)) Scale(scene, factor, actuator);
    for (SensorSpring& of : sensor.springs) {
      if (of.mechanism != static_cast<int>(mechanism) || of.spring.name != name ||
          !HasSpringOf(scene.mechanisms[mechanism], of))
        continue;
      of.spring.stiffness *= factor;
      for (double& higher : of.spring.higher_stiffness) higher *= factor;
    }
  }
}

}  // namespace fork1s::internal
