// Numbers of a model that viewers change while it runs: gains, damping coefficients, limits, masses, friction.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// What of a joint's, or of a spring's, stiffness and damping a servo brings. Definitions hold the sum; an
/// importer knows the parts. Per unit of the control's own length ℓ from the reference, gear included:
/// F = gain u + bias - stiffness (at_reference + ℓ) - damping dℓ/dt.
struct ServoShare {
  int mechanism = 0;
  std::string control;
  double stiffness = 0, damping = 0;
  double bias = 0, at_reference = 0;

  /// ℓ at which nothing but the input pushes.
  double Rest() const { return stiffness > 0 ? bias / stiffness - at_reference : 0; }
};

struct Tunable {
  enum class Of { kJoint, kActuator, kBody, kWorld };
  enum class Quantity {
    kStiffness,  ///< of a joint without its servos, or of a servo
    kDamping,    ///< likewise
    kLower,      ///< of a joint's displacement
    kUpper,
    kDryFriction,  ///< of a joint
    kForceLower,   ///< of an actuator
    kForceUpper,
    kMass,      ///< inertia goes with it
    kFriction,  ///< sliding, of all shapes of a body
  };
  Of of = Of::kJoint;
  Quantity quantity = Quantity::kStiffness;
  std::string owner;  // joint coordinate, control, body or shape of the world
  std::string unit;
  int mechanism = -1;              // -1: of a free body or the still world
  int item = 0, freedom = 0;       // place of the joint, control, body or shape in its list
  double original = 0, value = 0;  // of the file and now; bounds may be infinite
  double least = 0, most = 0;      // that may be asked
};
/// "joint", "actuator", "body", "world"; "stiffness", "force_upper", ...: words of the wire.
const char* Name(Tunable::Of of);
const char* Name(Tunable::Quantity quantity);

/// All of a scene, in its order.
std::vector<Tunable> FindTunables(const Scene& scene, const std::vector<ServoShare>& servos);
/// Works those into the scene whose value is not the original.
void ApplyTunables(const std::vector<Tunable>& tunables, const std::vector<ServoShare>& servos, Scene& scene);

/// The servos as they are with the values of now.
std::vector<ServoShare> TunedServos(const std::vector<Tunable>& tunables, std::vector<ServoShare> servos);

}  // namespace fork1s
