// A free rigid body.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <fork1s/stepping/applied_forces.hpp>
#include <fork1s/stepping/point_spring.hpp>
#include <string>

namespace fork1s {

struct StageMotion;
struct StageChange;  // src/stepping/stage_motion.hpp

/// Coordinates are the angular rate in the body's own axes and the velocity of the centre of mass in the
/// world.
class FreeBody {
 public:
  FreeBody(const FreeBodyDef& definition);

  const std::string& name() const { return name_; }
  const SpatialInertia& inertia() const { return inertia_; }
  const RigidTransform& pose() const { return state_.X_WB; }
  Vector3 omega_W() const { return state_.X_WB.rotation() * state_.omega_B; }
  const Vector3& omega_B() const { return state_.omega_B; }
  const Vector3& velocity_of_center() const { return state_.velocity; }
  /// Twist in world axes about the body's own origin.
  Vector6 OriginVelocity() const;
  Vector3 center_W() const { return state_.X_WB * inertia_.center; }
  /// Share of the weight that nothing compensates.
  double weight_share() const { return weight_share_; }
  /// Forces gathered for the next step, about the centre of mass.
  const AppliedForces& load() const { return state_.load; }

  void SetState(const RigidTransform& X_WB, const Vector3& omega_W, const Vector3& velocity_of_origin_W);
  /// Constant in world axes during the next step only. The force acts at the point of the body that is at
  /// `point_W` now.
  void AddWrench(const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);

  /// Holds until changed.
  void SetPointSpring(const PointSpring& spring) { state_.point_spring = spring; }
  void ClearPointSpring() { state_.point_spring = {}; }
  const PointSpring& point_spring() const { return state_.point_spring; }
  /// After a step its target rests.
  void StopPointSpring() { state_.point_spring.target_start_W = state_.point_spring.target_W; }

  /// [R ω_B; v_centre]: the six-vector on which contacts work, about the centre of mass in world axes.
  Vector6 PortTwist() const;
  /// The same where the stage at hand starts.
  Vector6 StartPortTwist() const;
  /// Y with YᵀY the inverse inertia on that six-vector.
  Matrix6 InverseInertiaRoot() const;
  /// The twist that contact leaves.
  void SetPortTwist(const Vector6& V);
  /// The free velocity, and back to it as before SetPortTwist.
  struct Velocity {
    Vector3 omega_B = Vector3::Zero(), center = Vector3::Zero();
  };
  Velocity velocity() const { return {state_.omega_B, state_.velocity}; }
  void ResetVelocity(const Velocity& free) {
    state_.omega_B = free.omega_B;
    state_.velocity = free.center;
    step_.pushed = false;
  }
  /// A step, as the functions of mechanism_step.hpp: base points are the pose, the spin in world axes and
  /// the velocity of the centre.
  void BeginStep(double b, const Vector3& gravity_W);
  void MoveToStagePose(double b);
  void RecordStageStart(bool of_step);
  void MoveToStageStart(double b);
  /// Velocity of the stage without contact. `touched`: it is linearized at the pose at hand, as contact is.
  void PredictStage(double b, bool touched);
  /// After contact: moves to the pose found; the change of position that another iteration would make [m], in
  /// the kinetic metric. `moved`: by the stage, but for the translation that nothing makes
  /// stiff.
  double MoveAndComputeResidual(double b, StageMotion& moved);
  /// After contact, at the pose linearized at, without `motion`.
  StageChange ComputeStageChange(double b);
  /// After MoveAndComputeResidual: takes back a share of the change of velocity that the iteration made, and moves.
  void RelaxStage(double b, double share);
  void ExtrapolateStage(double b, double onward);
  void EndStep(double between_stages);
  /// All that the next step depends on.
  struct State {
    RigidTransform X_WB;
    Vector3 omega_B = Vector3::Zero(), velocity = Vector3::Zero();  // of the centre, world axes
    AppliedForces load;                                             // of the next step; about the centre
    PointSpring point_spring;
    Vector3 angular_acceleration_B = Vector3::Zero(), acceleration = Vector3::Zero();  // as MechanismState's
  };
  State Save() const { return state_; }
  void Restore(const State& state);
  /// Loads and point spring are those between two shares of a step that begins at `start`.
  void SetInputsWithin(const State& start, double share_start, double share_end) {
    state_.load = start.load;
    state_.point_spring = start.point_spring.Within(share_start, share_end);
  }

  double KineticEnergy() const;
  double PotentialEnergy(const Vector3& gravity_W) const {
    return -weight_share_ * inertia_.mass * gravity_W.dot(center_W());
  }
  bool IsFinite() const {
    return state_.X_WB.IsFinite() && state_.omega_B.allFinite() && state_.velocity.allFinite();
  }

 private:
  struct StageBase {
    Matrix3 R_WB = Matrix3::Identity();
    Vector3 center_W = Vector3::Zero(), spin_W = Vector3::Zero(), velocity = Vector3::Zero();
  };
  /// Where the step at hand starts, and what acts in it.
  struct Step {
    RigidTransform X_WB;
    Vector3 omega_B = Vector3::Zero(), velocity = Vector3::Zero();
    StageBase base;
    Vector3 gravity_W = Vector3::Zero();
    bool pushed = false;  // contact acted
  };
  struct StageStart {
    RigidTransform X_WB;
    Velocity velocity;
    Vector3 center_W = Vector3::Zero();
  };
  struct Stage {
    StageBase base;
    Vector3 spin_end_W = Vector3::Zero();
    Velocity pose_velocity;  // that led to the pose at hand
    Velocity change;         // by the Newton iteration at hand
    Vector3 omega_B_first = Vector3::Zero(), velocity_first = Vector3::Zero();  // of the first stage
    Vector3 velocity_end = Vector3::Zero();   // that the momentum of the stage gives
    Vector3 load_moment_W = Vector3::Zero();  // at the pose that it is linearized at
    bool is_stiff = false;                    // it has the stiffness of loads or of the spring
    // Of such a stage, A V = rhs in PortTwist()'s coordinates: the operator, Y with YᵀY = A⁻¹, the right side.
    Matrix6 A = Matrix6::Zero(), root = Matrix6::Zero();
    Vector6 rhs = Vector6::Zero();
  };
  Vector6 StageForce() const;
  Vector6 StageMomentum(double b) const;
  Eigen::Matrix<double, 3, 6> SpringJacobian() const;
  void PredictStiffStage(double b);
  double MoveAndComputeStiffResidual(double b, StageMotion& moved);
  Matrix3 InverseInertia_B() const { return rotational_root_ * rotational_root_.transpose(); }
  Vector3 FreeTurning(double b, Vector3 guess) const;

  std::string name_;
  SpatialInertia inertia_;
  double weight_share_ = 1;  // of the weight that nothing compensates
  Matrix3 rotational_root_;  // C: C Cᵀ = I_B⁻¹
  State state_;
  Step step_;
  StageStart stage_start_;
  Stage stage_;
};

}  // namespace fork1s
