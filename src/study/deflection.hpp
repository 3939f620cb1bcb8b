// Where a body goes under a dead load, to first order and in full.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "reduction/buckling.hpp"
#include "reduction/point_stiffness.hpp"
#include "study/posed_mechanism.hpp"

namespace fork1s {

/// A force and moment of fixed direction at a point of a body, world axes.
struct BodyLoad {
  std::string body;
  Vector3 force_W = Vector3::Zero();   // N
  Vector3 moment_W = Vector3::Zero();  // N·m
  Vector3 point_B = Vector3::Zero();   // m, from the body's origin, in its axes
};

/// A point fixed to a body.
struct NamedPoint {
  std::string body;
  Vector3 p_B = Vector3::Zero();  // m, from the body's origin, in its axes
};

/// What forces meet at a point, of the springs alone at the start and about the equilibrium under load (none
/// where there is no equilibrium).
struct MeasuredPoint {
  NamedPoint point;
  Vector3 reference_W = Vector3::Zero();  // m, at the start
  PointStiffness springs;
  std::optional<PointStiffness> loaded;
};

struct Deflection {
  Vector3 position_W = Vector3::Zero();  // m, of the loaded point
  Vector3 rotation_W = Vector3::Zero();  // rad, rotation vector from where it was
  double max_joint_rotation = 0;         // rad, of any hinge or ball
};

struct LoadedBody {
  Vector3 reference_position_W = Vector3::Zero();  // m, without load
  Deflection linear, nonlinear;
  bool floats = false;  // the base would move, and is held here
  int iterations = 0;
  double residual = 0;               // relative to the forces
  bool stable = true;                // false: a slight push makes the mechanism leave this equilibrium
  double lowest_stiffness = 0;       // N·m, lowest eigenvalue of the tangent stiffness (TangentStiffness)
  std::vector<double> limit_shares;  // of all loads, at the limit points passed on the way (StaticsResult)
  std::vector<double> spring_frequencies_hz;  // as FullFrequencies
  std::vector<double> frequencies_hz;         // about the equilibrium under load (TangentFrequencies)
  std::vector<MeasuredPoint> points;          // the loaded one, then those asked for
  std::vector<BucklingMode> buckling;         // as asked for
  std::vector<std::string> coordinates;       // names of the joint coordinates of buckling modes
  std::vector<std::string> locked;            // joint coordinates that were held where they were
  /// Sentences on joints that the load bends beyond their stops, which statics does not know.
  std::vector<std::string> beyond_stops;
};

/// Gravity [m/s²] and the controls' initial values on one mechanism.
StaticsOptions WeightAndControls(const PosedMechanism& posed, const Vector3& gravity_W);

/// Small motions about the equilibrium under gravity, controls and the preload of springs, the base held.
struct LoadedState {
  VectorX q;
  TangentStiffness tangent;
  VibrationModes modes;
  std::vector<ModePair> pairs;     // for each mode of the springs alone, which of these has its shape
  InterfaceCompliance compliance;  // of the bodies asked for
};
/// Coordinates in `locked` stay where they are. Errors: kNumerics where no equilibrium is found.
Expected<LoadedState> ComputeLoadedState(const PosedMechanism& posed, const std::vector<BodyIndex>& bodies,
                                         const Vector3& gravity_W, const std::vector<int>& locked = {},
                                         int num_frequencies = 8);

/// Without `loaded` of the springs alone. Coordinates in `locked` stay where they are.
MeasuredPoint MeasurePoint(const PosedMechanism& posed, const NamedPoint& point,
                           const std::vector<int>& locked, const LoadedState* loaded);

struct DeflectionOptions {
  OnFreeMotion on_free = OnFreeMotion::kRefuse;
  int buckling_modes = 0;
  std::vector<NamedPoint> points;  // beside the loaded one, of the same mechanism
};

/// Deflection of the loaded body under load, gravity [m/s²] and the controls' initial values, the base held.
/// With OnFreeMotion::kLock a joint of every spring-free motion is locked. Errors: kModel for a body that no
/// mechanism has, or that is not of the loaded one; as of LinearDeflection where such a motion takes the load;
/// kNumerics where no equilibrium is found; as of ComputeBucklingModes where such modes are asked for.
Expected<LoadedBody> Deflect(const std::vector<PosedMechanism>& mechanisms, const BodyLoad& load,
                             const Vector3& gravity_W, const DeflectionOptions& options = {});

}  // namespace fork1s
