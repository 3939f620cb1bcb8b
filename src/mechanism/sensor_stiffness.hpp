// Laws of actuators and springs that sensors measure, as ScaleStiffness and SetStiffness change those of a mechanism.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

/// Those of all sensors.
void ScaleSensorLaws(double factor, Scene& scene);
/// Before SetStiffness of that freedom of a mechanism of the scene.
void SetSensorStiffness(std::size_t mechanism, FreedomRef freedom, double stiffness, Scene& scene);
/// Before SetStiffness of the springs of that name.
void SetSensorStiffness(std::size_t mechanism, const std::string& spring, double stiffness, Scene& scene);

/// Springs of that name with a stiffness, and servos of tendons, with their damping ratio. Along one of `freedoms` alone only the
/// springs: a servo there is part of what SetStiffness of the freedom changes.
void ScaleSprings(const std::string& name, const std::vector<FreedomRef>& freedoms, double factor,
                  MechanismDef& definition);
/// The same in the laws of sensors.
void ScaleSensorSprings(std::size_t mechanism, const std::string& name,
                        const std::vector<FreedomRef>& freedoms, double factor, Scene& scene);

}  // namespace fork1s::internal
