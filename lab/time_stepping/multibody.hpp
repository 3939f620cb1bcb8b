// Rigid bodies in maximal coordinates and one implicit stage on them.
//
// State: pose (x, R) and momentum p = [L; m v] of each body, L = R I Rᵀ ω in world axes, so that momenta are
// a flat space and no velocity forces occur. Velocities V = [ω; v] are in world axes as well.
//
// A stage takes base points x̂, p̂ and a length b, and solves
//     p(V, x) = p̂ + b (f(x, V) + Jᵀλ + Cᵀφ),     x = x̂ ⊕ b V,     R = exp(b ω) R̂
// for V by Newton's method, with rigid constraints c(x) = 0 at its end and the contact law
//     φ_n = k max(0, δ + τ δ̇),     φ_t = −k ξ,  ξ = ξ̂ + b u_t projected to |φ_t| <= µ φ_n
// solved in each iteration by fork1s::ContactSolver. ξ is the elastic displacement of the contact's tangents;
// schemes treat it as a configuration.
#pragma once

#include <fork1s/base/types.hpp>
#include <vector>

namespace fork1s::lab {

struct Pose {
  Vector3 x = Vector3::Zero();
  Matrix3 R = Matrix3::Identity();
};

struct Body {
  double mass = 1;
  Vector3 inertia = Vector3::Ones();  // principal, in body axes
};

/// Linear spring and damper between point `point_a` of body `a` and `point_b` of body `b` (-1: the world).
struct PointSpring {
  int a = 0, b = -1;
  Vector3 point_a = Vector3::Zero(), point_b = Vector3::Zero();
  double stiffness = 0, rest_length = 0, damping = 0;
};

/// Spring and damper on the angle of a hinge, from body `b` to body `a` about `axis` (in either body's axes;
/// the bodies' axes coincide at angle 0). A servo, where `target` is set from outside.
struct TorsionSpring {
  int a = 0, b = -1;
  Vector3 axis = Vector3::UnitY();
  double stiffness = 0, damping = 0, target = 0;
};

/// Point `point_a` of `a` coincides with `point_b` of `b` along the world directions that are set.
struct PointConstraint {
  int a = 0, b = -1;
  Vector3 point_a = Vector3::Zero(), point_b = Vector3::Zero();
  bool directions[3] = {true, true, true};
};

/// axis_a of `a` stays perpendicular to axis_b of `b`.
struct AxisConstraint {
  int a = 0, b = -1;
  Vector3 axis_a = Vector3::UnitX(), axis_b = Vector3::UnitY();
};

/// Distance between two points.
struct DistanceConstraint {
  int a = 0, b = -1;
  Vector3 point_a = Vector3::Zero(), point_b = Vector3::Zero();
  double length = 1;
};

/// Ball of `radius` (0: a corner) about `center` of body `a` against a plane of body `b`.
struct ContactPair {
  int a = 0, b = -1;
  Vector3 center = Vector3::Zero();
  double radius = 0;
  Vector3 origin = Vector3::Zero(), normal = Vector3::UnitZ();  // of the plane, in the axes of `b`
  double friction = 0.5, restitution = 0;
};

struct System {
  std::vector<Body> bodies;
  std::vector<PointSpring> springs;
  std::vector<TorsionSpring> torsions;
  std::vector<PointConstraint> points;
  std::vector<AxisConstraint> axes;
  std::vector<DistanceConstraint> distances;
  std::vector<ContactPair> contacts;
  Vector3 gravity = Vector3(0, 0, -9.81);
  double contact_stiffness = 1e6;      // N/m
  double contact_damping_time = 2e-3;  // τ [s], critical for 1 kg
  double size = 1;                     // m, of displacements beside radians

  int num_rows() const;
  void AddHinge(int a, int b, const Vector3& point_a, const Vector3& point_b, const Vector3& axis);
  void AddLockedRotation(int a, int b);
};

struct State {
  std::vector<Pose> poses;
  VectorX p, V, p_rate;                   // p_rate: (p − p̂)/b of the last stage
  VectorX lambda;                         // forces of rigid constraints, last stage
  std::vector<Vector3> xi, xi_rate, phi;  // of contacts, in world axes; phi: force on body a
  VectorX V_before;          // velocity at the end of the stage before the last one, empty: unknown
  double time_between = 0;   // from that to the last one [s]
  std::vector<char> closed;  // the contact carried load at the end of the last step
};

enum class ConstraintForm { kPosition, kRate };  // c(x) = 0 by V (index 3); J V = 0 and x projected (index 2)
/// How a stage is solved: one linear solve at the pose of its start; one at the predicted pose, x̂ ⊕ b V of
/// the last stage; Newton to a residual; Newton to a displacement, from the predicted pose or from that of
/// the start; Newton from the predicted pose to a residual of `momentum_tolerance`; one linear solve, and
/// Newton to that residual, at the pose predicted by the velocity on the line through the last two.
enum class Newton {
  kStart,
  kPredicted,
  kResidual,
  kDisplacement,
  kDisplacementFromStart,
  kMomentum,
  kExtrapolated,
  kExtrapolatedMomentum
};

struct StageSettings {
  Newton newton = Newton::kResidual;
  ConstraintForm form = ConstraintForm::kRate;
  double residual_tolerance = 1e-10;
  double displacement_tolerance = 1e-3;  // rad, or of System::size
  double momentum_tolerance =
      1e-4;  // residual of the momentum equation in shares of the momentum, metric M⁻¹
  int max_iterations = 60;
};

struct StageInput {
  std::vector<Pose> poses;  // x̂
  VectorX p;                // p̂
  std::vector<Vector3> xi;  // ξ̂
  double b = 0;
  double advance = 0;  // time from the end of the last stage to the end of this one [s]
  VectorX
      restitution_speed;  // of contacts: > 0: V_n = at least this at the end (impact law), instead of the gap
};

struct Counts {
  long steps = 0, stages = 0, iterations = 0, evaluations = 0, impacts = 0, unconverged = 0;
  double largest_residual = 0;
};

/// Solves a stage. `state`: in, the state at the stage's start (warm start, last velocity, flags); out, at
/// its end.
void SolveStage(const System& system, const StageInput& input, const StageSettings& settings, State* state,
                Counts* counts);

State MakeState(const System& system, const std::vector<Pose>& poses, const VectorX& V);
/// Removes what rigid constraints do not allow from V, in the kinetic metric.
VectorX ProjectVelocity(const System& system, const std::vector<Pose>& poses, const VectorX& V);
std::vector<Pose> ProjectPoses(const System& system, std::vector<Pose> poses);

Pose Compose(const Pose& X, const Vector6& displacement);  // displacement = [turn; shift] in world axes
Vector6 Difference(const Pose& X, const Pose& Y);          // X ⊖ Y: Compose(Y, X ⊖ Y) = X
std::vector<Pose> Extrapolate(const std::vector<Pose>& from, const std::vector<Pose>& to, double s);

struct ContactReading {
  double gap = 0;
  Vector3 velocity = Vector3::Zero();  // normal first
};
ContactReading ReadContact(const System& system, const ContactPair& contact, const State& state);

/// Forces of springs, dampers and gravity at a state.
VectorX AppliedForce(const System& system, const State& state);
double PotentialEnergy(const System& system, const State& state);
double KineticEnergy(const System& system, const State& state);
inline double Energy(const System& system, const State& state) {
  return PotentialEnergy(system, state) + KineticEnergy(system, state);
}
Vector3 AngularMomentum(const System& system, const State& state);  // about the origin
double HingeAngle(const TorsionSpring& spring, const State& state);

}  // namespace fork1s::lab
