// What a scene measures: sensors as data.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// The quantity that a sensor measures.
enum class SensorKind {
  kUnknown,                 ///< nothing that a simulation has; SensorDef::reason
  kTime,                    ///< s
  kKineticEnergy,           ///< J, of the scene
  kPotentialEnergy,         ///< J, of weight and springs
  kLength,                  ///< of a joint, tendon or actuator: m or rad
  kLengthRate,              ///< m/s or rad/s
  kLimitDistance,           ///< from a limit of a length that is exceeded: m or rad, at most 0
  kLimitRate,               ///< its rate; 0 where no limit is exceeded
  kLimitForce,              ///< N or N·m, at least 0
  kBallRotation,            ///< of a ball joint: quaternion w, x, y, z
  kBallAngularVelocity,     ///< rad/s, in axes of the body
  kPosition,                ///< m, of the origin of a frame
  kRotation,                ///< of a frame: quaternion w, x, y, z
  kXAxis,                   ///< of a frame
  kYAxis,                   ///< of a frame
  kZAxis,                   ///< of a frame
  kVelocity,                ///< m/s, of the origin of a frame
  kAngularVelocity,         ///< rad/s
  kAcceleration,            ///< m/s², of the origin of a frame, less gravity: at rest it points upwards
  kAngularAcceleration,     ///< rad/s²
  kMagneticField,           ///< in axes of a frame
  kSubtreeCenter,           ///< m, centre of mass
  kSubtreeVelocity,         ///< m/s, of the centre of mass
  kSubtreeAngularMomentum,  ///< N·m·s, about the centre of mass
  kForce,                   ///< N, on the subtree from the body that carries it
  kTorque,                  ///< N·m, likewise, about the origin of a frame
  kTouch,                   ///< N, sum of normal forces of contacts within a volume
  kActuatorForce,           ///< N or N·m, along the length of an actuator
  kJointActuatorForce,      ///< N or N·m, of all actuators on a joint coordinate
  kTendonActuatorForce,     ///< N, of all actuators on a tendon
  kDistance,  ///< m, from the origin of a frame along its z axis to the first shape; -1: there is none
  kInside,    ///< 1: the origin of a frame is in a volume, else 0
};

/// A body of a scene; neither of a mechanism nor free: the still world.
struct SensorBody {
  int mechanism = -1;  // index in Scene::mechanisms
  BodyIndex body;      // of that mechanism
  int free_body = -1;  // index in Scene::free_bodies

  bool is_world() const { return mechanism < 0 && free_body < 0; }
};

/// A frame fixed to a body.
struct SensorFrame {
  SensorBody body;
  RigidTransform X_BF;
};

/// Law of an actuator: F = Σ gain u + bias - stiffness L - damping dL/dt within [lower, upper], with its length
/// L = at_reference + Σ coefficient q plus that of a path.
struct SensorActuator {
  int mechanism = -1;  // of the scene
  std::vector<std::pair<FreedomRef, double>> terms;
  PathRef along = {};
  double at_reference = 0;
  std::vector<std::pair<std::string, double>> inputs;  // ControlDef::name, gain
  std::string muscle;                                  // MuscleDef::name, whose force is added; empty: none
  double stiffness = 0, damping = 0;
  double bias = 0;                                          // N or N·m
  double lower = -std::numeric_limits<double>::infinity();  // N or N·m
  double upper = std::numeric_limits<double>::infinity();
};

/// A spring that kPotentialEnergy counts.
struct SensorSpring {
  int mechanism = -1;  // of the scene
  SpringDef spring;
};

struct SensorDef {
  std::string name;
  SensorKind kind = SensorKind::kUnknown;
  int size = 1;           // values
  SensorFrame frame;      // kPosition to kMagneticField, kForce, kTorque, kTouch, kDistance, kInside
  SensorFrame reference;  // kPosition to kAngularVelocity: relative to this frame and in its axes
  bool own_axes = false;  // components along the axes of `frame` rather than of the reference
  std::vector<SensorBody> subtree;  // kSubtreeCenter to kTorque; kPotentialEnergy: all bodies
  // The length of kLength to kLimitForce, kActuatorForce and kJointActuatorForce: at_reference + Σ coefficient q
  // plus that of a path; of kBall...: the freedoms of the joint.
  int mechanism = -1;  // of the scene; -1: the length does not change
  std::vector<std::pair<FreedomRef, double>> terms;
  PathRef along = {};
  double at_reference = 0;  // kPotentialEnergy: J, of bodies that stand still
  double lower =
      -std::numeric_limits<double>::infinity();  // limits of the length; k...ActuatorForce: of the force
  double upper = std::numeric_limits<double>::infinity();
  Shape volume = Sphere{};            // kTouch: in `frame`; kInside: in `reference`
  Vector3 field_W = Vector3::Zero();  // kMagneticField
  std::vector<SensorActuator>
      actuators;                      // kActuatorForce: one; k...ActuatorForce: those on the joint or tendon
  std::vector<SensorSpring> springs;  // kPotentialEnergy
  std::vector<int>
      unseen;         // kDistance: shapes of the body of `frame`, or of the world, that the ray goes through
  std::string limit;  // kLimitForce: LengthLimitDef::name; empty: the limit of the joint coordinate
  double clip_lower = -std::numeric_limits<double>::infinity();  // every value is clipped to these
  double clip_upper = std::numeric_limits<double>::infinity();
  std::string reason;  // kUnknown: why it has no value
};

}  // namespace fork1s
