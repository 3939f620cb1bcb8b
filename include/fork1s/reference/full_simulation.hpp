// The full-coordinate simulator: slow and plain, the truth that the reduced model is compared with.
//
// Every moving body has a pose and a twist of its own; joints, loops and couplings are equations between
// them. A step is backward Euler (docs/compare.md), solved by Newton until
// nothing changes any more: springs, dampers and constraint directions are those of the end of the step, and
// so is the contact law. The contact points are those of the reduced simulator, the contact solver is not: it
// is an independent implementation of the same law.
// Or it is two such solves, which together are of second order (docs/compare.md).
#pragma once

#include <cstdint>
#include <fork1s/base/error.hpp>
#include <fork1s/collision/collision_world.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/reference/full_contact.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

/// How a step is taken. kEuler: all forces at its end, first order. kTwoStages: of second order, two stages
/// of implicit Euler whose forces stand at their ends; a step in which something is met is halved about that
/// time, and its shortest part is implicit Euler (docs/compare.md).
enum class FullIntegrator { kEuler, kTwoStages };

struct FullSimulationOptions {
  double dt = 0;  // s; 0: the scene's time step
  FullIntegrator integrator = FullIntegrator::kEuler;
  // Controls are samples of a trajectory, which moves evenly from those of the last step to those of this
  // one; otherwise they stand throughout the step. No difference for kEuler.
  bool controls_move = false;
  int initial_keyframe = -1;  // index in the scene
  /// Per mechanism the bodies that may touch; where empty, those that the definition names.
  std::vector<std::vector<std::string>> interfaces;
  CollisionOptions collision = {.margin = 0.2};
  FullContactMaterial material;
  bool contact_curvature = true;  // adds (h/2) J̇ V to the rows of contacts that persist
  FullContactOptions contact;
  double tolerance = 1e-9;  // change of any pose in the last iteration, in lengths of its mechanism
  int max_iterations = 60;  // Newton steps
};

struct FullStepReport {
  int iterations = 0;        // Newton steps
  double residual = 0;       // m, largest change of a pose (turns times the length scale) in the last of them
  double joint_gap = 0;      // m, largest opening of any joint or loop after the step
  int contacts = 0;          // that carry force
  int limits = 0;            // joint limits that act, the most at a time
  FullContactReport solver;  // of the last contact solve
  double max_penetration = 0;     // m, at the start of the step
  bool contacts_dropped = false;  // the collision detector ran out of room
  bool converged = true;          // poses, loops and contacts are all within tolerance
  bool finite = true;             // false: the step was undone
  // Of kTwoStages:
  bool impact = false;  // something was met within the step, which was halved about that time
  int parts = 1;        // that the step was taken in
  int euler_parts = 0;  // of these, by implicit Euler: what meets something, and what two stages do not solve
};

/// A contact point as it was solved.
struct FullContact {
  ContactPoint point;               // its bodies are places in FullSimulation::bodies(), -1: the still world
  Vector3 force = Vector3::Zero();  // N, on body b, friction included, world axes; mean over the step
};

struct FullBody {
  std::string name;
  int mechanism = -1;  // -1: a free body
  int index = 0;       // body of the mechanism, or free body
  bool is_interface = false;
};

/// How far a joint or loop stands open.
struct FullGap {
  std::string name;
  double gap = 0;  // m: offset of the two sides in their rigid directions
};

/// Steps a scene in full coordinates. Bodies, inputs and start are those of Simulation for the same scene.
class FullSimulation {
 public:
  /// Errors as of BuildMechanism and CollisionWorld::Create; kModel for loops that cannot be closed.
  static Expected<FullSimulation> Create(Scene scene, const FullSimulationOptions& options = {});
  ~FullSimulation();
  FullSimulation(FullSimulation&&) noexcept;
  FullSimulation& operator=(FullSimulation&&) noexcept;

  /// Advances by dt. What went wrong numerically stands in the report; the state stays finite.
  FullStepReport Step();
  double time() const;
  std::int64_t steps() const;
  double dt() const;
  FullIntegrator integrator() const;
  const Scene& scene() const;
  const std::vector<std::string>& warnings() const;

  /// Inputs, in the order and with the names of Simulation: all controls, then six coordinates BASE.x .y .z
  /// .rx .ry .rz a driven base [m, rad], relative to its initial pose. Values beyond a control's limits are
  /// moved to the limit.
  const std::vector<std::string>& control_names() const;
  int FindControl(const std::string& name) const;  // -1: none
  const VectorX& controls() const;
  void SetControl(int index, double value);
  void SetControls(const VectorX& values);
  /// As Simulation::StartFromControls. Throws std::invalid_argument after the first step.
  void StartFromControls();
  /// As Simulation::base_rates(), of the next step only; to be set after the controls.
  void SetBaseRates(const VectorX& rates);
  void SetGravity(const Vector3& gravity_W);  // m/s²; at first the scene's
  /// Force [N], moment [N·m] about `point_W` and point in world axes, for the next step only.
  void ApplyWrench(int body, const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);

  const std::vector<FullBody>& bodies() const;
  int FindBody(const std::string& name) const;  // -1: none
  RigidTransform Pose(int body) const;
  /// Twist of a body [ω_W; velocity of its origin], world axes.
  Vector6 Velocity(int body) const;

  int num_mechanisms() const;
  const Mechanism& mechanism(int i) const;
  /// Joint displacements and rates of a mechanism [n], turns counted beyond π.
  const VectorX& Displacements(int mechanism) const;
  const VectorX& Rates(int mechanism) const;
  /// Reactions of a mechanism's rigid closures and couplings [N, N·m], row by row as in ClosureResidual: the
  /// generalized force of a closure is its Jacobian's transpose times these. After a step, its mean.
  VectorX ClosureForces(int mechanism) const;
  /// Of all mechanisms, largest first.
  std::vector<FullGap> JointGaps() const;

  double KineticEnergy() const;
  double SpringEnergy() const;   // springs of joints, tendons and closures, controls included
  double GravityEnergy() const;  // 0 at the world's origin
  double Energy() const { return KineticEnergy() + SpringEnergy() + GravityEnergy(); }
  /// Linear momentum and angular momentum about the world's origin [angular; linear] of all that moves.
  Vector6 Momentum() const;

  /// Contacts of the last step, those without force included.
  const std::vector<FullContact>& contacts() const;

  /// Lowest `count` natural frequencies [Hz] of a mechanism at the present pose, undamped and unloaded, free
  /// motions left out: a dense eigenproblem on the motions that the constraints leave.
  std::vector<double> Frequencies(int mechanism, int count = 8) const;
  /// Compliance of bodies (6e x 6e) at the present pose, unloaded, the base held: displacement = C load, per body
  /// [rotation; translation] and [moment; force] in world axes about its origin. Empty where a motion without
  /// spring gives way to loads on them.
  MatrixX Compliance(int mechanism, const std::vector<BodyIndex>& bodies) const;

 private:
  FullSimulation();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
