// What the sensors of a scene measure.
#pragma once

#include <fork1s/collision/ray_world.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/sim/simulation.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace fork1s {

/// Values of all sensors of a scene at the end of the last step (docs/formats.md). Accelerations, and forces between
/// bodies, are the mean over that step: NaN before the first one. A sensor that has no value here is NaN, and
/// SensorDef::reason says why.
///
///     Sensors sensors(simulation);
///     simulation.Step();
///     sensors.Update(simulation);
///     std::span<const double> rate = sensors["gyro"];
class Sensors {
 public:
  /// Values at the present state.
  explicit Sensors(const Simulation& simulation);
  /// The same of others than those of the scene.
  Sensors(const Simulation& simulation, std::vector<SensorDef> definitions);
  /// Evaluates all at the present state of this simulation, or of one of the same scene.
  void Update(const Simulation& simulation);

  int count() const { return static_cast<int>(definitions_.size()); }
  const SensorDef& definition(int sensor) const;
  /// Of all sensors, in the order of the scene.
  const VectorX& values() const { return values_; }
  /// Throw std::invalid_argument for a sensor that there is not; the message has the nearest names.
  std::span<const double> operator[](int sensor) const;
  std::span<const double> operator[](const std::string& name) const;

 private:
  struct Coordinates {  // of a mechanism of the scene
    VectorX q, q_dot;
    VectorX rates;  // of ball joints the angular velocity along their axes, else q_dot
    std::optional<Kinematics> kinematics;
  };
  struct Frame {
    RigidTransform X_WF;
    Vector3 omega_W = Vector3::Zero(), velocity_W = Vector3::Zero();  // of its origin
  };
  struct Scalar {
    double length = 0, rate = 0;
  };
  int BodyOf(const SensorBody& body) const;  // place in Simulation::bodies(), -1: the world
  Frame FrameOf(const Simulation& simulation, const SensorFrame& frame) const;
  Mechanism::Length LengthFrom(const Simulation& simulation, int mechanism,
                               const std::vector<std::pair<FreedomRef, double>>& terms, const PathRef& along);
  Scalar LengthOf(const Simulation& simulation, int mechanism, const Mechanism::Length& length,
                  double at_reference) const;
  Scalar LengthOf(const Simulation& simulation, std::size_t sensor) const;
  void Evaluate(const Simulation& simulation, std::size_t sensor, double* out);
  double DistanceAlongRay(const Simulation& simulation, const SensorDef& s);
  bool IsInside(const Simulation& simulation, const SensorDef& s) const;
  double PotentialEnergy(const Simulation& simulation, std::size_t sensor) const;
  void EvaluateBall(const Simulation& simulation, const SensorDef& s, double* out) const;
  void EvaluateFrame(const Simulation& simulation, const SensorDef& s, double* out) const;
  void EvaluateAcceleration(const Simulation& simulation, const SensorDef& s, double* out) const;
  void EvaluateCut(const Simulation& simulation, const SensorDef& s, double* out) const;
  double TouchForce(const Simulation& simulation, const SensorDef& s) const;
  double LimitForce(const Simulation& simulation, std::size_t sensor) const;
  double ActuatorForce(const Simulation& simulation, const SensorActuator& actuator,
                       const Mechanism::Length& length) const;
  double JointActuatorForce(const Simulation& simulation, std::size_t sensor) const;
  double TendonActuatorForce(const Simulation& simulation, std::size_t sensor) const;
  struct FrameInStep {
    Frame start, end;
    RigidTransform X_WF_middle;
  };
  /// In the last step; nothing before the first one.
  std::optional<FrameInStep> FrameInStepOf(const Simulation& simulation, const SensorFrame& frame) const;
  void EvaluateSubtree(const Simulation& simulation, const SensorDef& s, double* out) const;

  std::vector<SensorDef> definitions_;
  std::vector<int> first_;                  // value of each sensor, and the number of all
  std::vector<Mechanism::Length> lengths_;  // of each sensor
  std::vector<std::vector<Mechanism::Length>> actuator_lengths_;  // of each sensor: of its actuators
  std::vector<std::vector<Mechanism::Length>> spring_lengths_;    // likewise of its springs
  std::optional<RayWorld> rays_;                                  // where a sensor casts one
  std::vector<Coordinates> coordinates_;                          // of each mechanism that a sensor asks for
  std::vector<std::vector<int>> body_of_;  // places of bodies, by mechanism of the scene
  std::vector<int> free_body_of_;
  VectorX values_;
};

}  // namespace fork1s
