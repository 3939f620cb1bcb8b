// Laws of actuators and springs that sensors measure, as ScaleStiffness and SetStiffness change those of a mechanism.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <string>

namespace fork1s::internal {

/// Those of all sensors.
void ScaleSensorLaws(double factor, Scene& scene);
/// Before SetStiffness of that freedom of a mechanism of the scene.
void SetSensorStiffness(std::size_t mechanism, FreedomRef freedom, double stiffness, Scene& scene);
/// Before SetStiffness of the springs of that name.
void SetSensorStiffness(std::size_t mechanism, const std::string& spring, double stiffness, Scene& scene);

}  // namespace fork1s::internal
