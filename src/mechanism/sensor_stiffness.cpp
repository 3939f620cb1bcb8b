#include "sensor_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/set_stiffness.hpp>

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
  const auto is_of_it_alone = [&](int of, const auto& length) {
    return of == static_cast<int>(mechanism) && length.along.path < 0 && length.terms.size() == 1 &&
           length.terms[0].first.joint == freedom.joint && length.terms[0].first.freedom == freedom.freedom;
  };
  for (SensorDef& sensor : scene.sensors) {
    for (SensorActuator& actuator : sensor.actuators)
      if (is_of_it_alone(actuator.mechanism, actuator)) Scale(scene, factor, actuator);
    for (SensorSpring& of : sensor.springs)
      if (is_of_it_alone(of.mechanism, of.spring)) of.spring.stiffness *= factor;
    if (sensor.kind != SensorKind::kPotentialEnergy || own.stiffness > 0 || stiffness == 0) continue;
    SpringDef spring;  // there was none
    spring.terms = {{freedom, 1.0}};
    spring.rest = own.rest;
    spring.stiffness = stiffness;
    sensor.springs.push_back({static_cast<int>(mechanism), std::move(spring)});
  }
}

void SetSensorStiffness(std::size_t mechanism, const std::string& spring, double stiffness, Scene& scene) {
  const double factor = stiffness / StiffnessOf(scene.mechanisms[mechanism], spring);
  const auto is_servo = [&](const SensorActuator& actuator) {
    return actuator.mechanism == static_cast<int>(mechanism) &&
           std::any_of(actuator.inputs.begin(), actuator.inputs.end(),
                       [&](const auto& input) { return input.first == spring; });
  };
  for (SensorDef& sensor : scene.sensors) {
    for (SensorActuator& actuator : sensor.actuators)
      if (is_servo(actuator)) Scale(scene, factor, actuator);
    for (SensorSpring& of : sensor.springs) {
      if (of.mechanism != static_cast<int>(mechanism) || of.spring.name != spring) continue;
      of.spring.stiffness *= factor;
      for (double& higher : of.spring.higher_stiffness) higher *= factor;
    }
  }
}

}  // namespace fork1s::internal
