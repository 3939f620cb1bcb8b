// A mechanism in motion as others hold it: a model, a state and a workspace of its own.
#pragma once

#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/stepping/linearization_drift.hpp>
#include <fork1s/stepping/mechanism_options.hpp>
#include <fork1s/stepping/mechanism_state.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

struct StepContext;  // insides of src/stepping
struct ConstStepContext;
struct MechanismWorkspace;

class MechanismDynamics {
 public:
  using Options = MechanismOptions;

  /// Starts at joint displacements q0 (loops closed first where they are not) and rates q_dot0.
  static Expected<MechanismDynamics> Create(std::shared_ptr<const Mechanism> mechanism, const VectorX& q0,
                                            const VectorX& q_dot0, const RigidTransform& X_WR,
                                            const Vector6& V_R, const Options& options);
  ~MechanismDynamics();
  MechanismDynamics(const MechanismDynamics& other);
  MechanismDynamics& operator=(const MechanismDynamics& other);
  MechanismDynamics(MechanismDynamics&&) noexcept;
  MechanismDynamics& operator=(MechanismDynamics&&) noexcept;

  /// So that functions of a step take it.
  operator StepContext();
  operator ConstStepContext() const;
  /// All that stands between refreshes.
  const MechanismModel& step_model() const { return *state_.step_model; }

  const Mechanism& mechanism() const { return *model().mechanism; }
  const ReducedModel& model() const { return *state_.model; }
  const ReducedState& state() const { return state_.reduced; }
  const Configuration& configuration() const;
  const std::vector<ContactGroup>& groups() const;
  Recovery recovery() const;
  /// Whether the pose at hand is told by an expansion.
  bool is_expanded() const;
  /// Whether the last step, or the last of its parts, went by an expansion.
  bool went_by_expansion() const;
  /// Number of generalized velocities: r, plus 6 where the base floats.
  int num_velocities() const;
  const std::vector<Mechanism::LengthLimit>& length_limits() const;
  const std::vector<std::string>& warnings() const;

  /// Inputs; they hold until changed. `controls` one per Mechanism::controls().
  VectorX& controls() { return state_.controls; }
  const VectorX& controls() const { return state_.controls; }
  /// Of controls with dynamics, in the order of Mechanism::controls(), 0 of others; empty where none has.
  const VectorX& activation() const { return state_.activation; }
  bool HasDynamics(Eigen::Index control) const { return fork1s::HasDynamics(state_, control); }
  /// What the force of a control is proportional to: its activation, or its input where it has no dynamics.
  double ActivationOf(Eigen::Index control) const { return fork1s::ActivationOf(state_, control); }
  /// Starts from these; one per control, of which those without dynamics are not read.
  void SetActivation(const VectorX& activation);
  /// In the next step controls come from these, counted from the `first`, rather than from those of the last
  /// one.
  void StartControlsFrom(int first, const Eigen::Ref<const VectorX>& from) {
    state_.controls_from.segment(first, from.size()) = from;
  }
  /// In the next step controls move evenly to controls(), rather than jump there at its start. Two stages see
  /// that; backward Euler asks for nothing but the end.
  void MoveControls() { state_.controls_move = true; }
  /// Force [N] and moment [N·m] on a body, constant in world axes during the next step only. The force acts
  /// at the point of the body that is at `point_W` now.
  void AddWrench(BodyIndex body, const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);
  /// Holds until changed; a mechanism has one.
  void SetPointSpring(BodyIndex body, const PointSpring& spring);
  void ClearPointSpring() { state_.point_spring = {}; }
  const PointSpring& point_spring() const { return state_.point_spring; }
  /// After a step its target rests.
  void StopPointSpring() { state_.point_spring.target_start_W = state_.point_spring.target_W; }
  BodyIndex point_spring_body() const { return state_.point_spring_body; }
  bool has_loads() const { return state_.has_loads; }
  /// Those added for the next step, per body about its origin.
  const std::vector<AppliedForces>& loads() const { return state_.loads; }
  /// F <- their wrenches at the present pose [6 x bodies], in the world about its origin.
  void ComputeLoadWrenches_W(Matrix6X& F) const;
  /// Pose that a driven base reaches at the end of the next step.
  void DriveBase(const RigidTransform& X_WR_next) {
    state_.driven_next = X_WR_next;
    state_.knows_driven_rate = false;
  }
  /// The same where it is a sample of a path whose rate is known there: [angular velocity; velocity of the
  /// origin], world axes. Of the next step only.
  void DriveBase(const RigidTransform& X_WR_next, const Vector6& rate_W) {
    state_.driven_next = X_WR_next;
    state_.driven_rate = rate_W;
    state_.knows_driven_rate = true;
  }

  /// Largest turn since the reference, as a share of the refresh angle, of joints whose turn matters, or gap
  /// of a loop that is closed by its curvature, as a share of the refresh gap. A joint
  /// that leaves the reduction as it is does not count, nor one whose every motion the model has.
  LinearizationDrift ComputeLinearizationDrift() const;
  /// Moves the reference to the present pose: another model. False if the mechanism cannot be reduced there:
  /// the old model stays.
  bool Refresh();
  /// All that the next step depends on, into `out`; does not allocate where `out` has its sizes. Between
  /// steps.
  void Save(MechanismState& out) const { out = state_; }
  /// To what loops are closed from the next pose on [rad and m]; kClosingTolerance unless set. Not of the state.
  void SetClosingTolerance(double tolerance);
  /// Puts back what Save gave, here or of another that was created the same way.
  void Restore(const MechanismState& saved);

  /// Servos and motors that give all they can.
  int NumForcesAtBound() const;
  /// Counted from q = 0.
  double Length(const Mechanism::Length& length) const;
  /// tau [n] += what a force along a length is on the joints.
  void AddLengthForce(const Mechanism::Length& length, double force, VectorX& tau) const;
  double KineticEnergy() const;
  /// Springs, controls and gravity at the present pose [J].
  double PotentialEnergy(const Vector3& gravity_W) const;
  double ClosureGapNow() const;
  /// Pose of a body in the world at the present state.
  RigidTransform BodyPose(BodyIndex b) const;
  /// Of all bodies in the frame of its root, side by side where they are many.
  void BodyPoses(std::vector<RigidTransform>& X_RB) const;
  /// Twist of a body in world axes about its own origin.
  Vector6 BodyVelocity(BodyIndex b) const;

 private:
  MechanismDynamics(MechanismState state, std::unique_ptr<MechanismWorkspace> work);

  MechanismState state_;  // with its step_model
  std::unique_ptr<MechanismWorkspace> work_;
};

}  // namespace fork1s
