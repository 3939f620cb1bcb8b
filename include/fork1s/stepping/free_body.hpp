// A free rigid body.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <fork1s/stepping/applied_forces.hpp>
#include <fork1s/stepping/point_spring.hpp>
#include <fork1s/stepping/stage_motion.hpp>
#include <string>

namespace fork1s {

/// Coordinates are the angular rate in the body's own axes and the velocity of the centre of mass in the
/// world.
class FreeBody {
 public:
  FreeBody(const FreeBodyDef& definition);

  const std::string& name() const { return name_; }
  const SpatialInertia& inertia() const { return inertia_; }
  const RigidTransform& pose() const { return X_WB_; }
  Vector3 omega_W() const { return X_WB_.rotation() * omega_B_; }
  const Vector3& omega_B() const { return omega_B_; }
  const Vector3& velocity_of_center() const { return velocity_; }
  /// Twist in world axes about the body's own origin.
  Vector6 OriginVelocity() const;
  Vector3 center_W() const { return X_WB_ * inertia_.center; }
  /// Share of the weight that nothing compensates.
  double weight_share() const { return weight_share_; }
  /// Forces gathered for the next step, about the centre of mass.
  const AppliedForces& load() const { return load_; }

  void SetState(const RigidTransform& X_WB, const Vector3& omega_W, const Vector3& velocity_of_origin_W);
  /// Constant in world axes during the next step only. The force acts at the point of the body that is at
  /// `point_W` now.
  void AddWrench(const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);

  /// Holds until changed.
  void SetPointSpring(const PointSpring& spring) { point_spring_ = spring; }
  void ClearPointSpring() { point_spring_ = {}; }
  const PointSpring& point_spring() const { return point_spring_; }
  /// After a step its target rests.
  void StopPointSpring() { point_spring_.target_start_W = point_spring_.target_W; }

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
  Velocity velocity() const { return {omega_B_, velocity_}; }
  void ResetVelocity(const Velocity& free) {
    omega_B_ = free.omega_B;
    velocity_ = free.center;
    pushed_ = false;
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
  State Save() const {
    return {X_WB_, omega_B_, velocity_, load_, point_spring_, angular_acceleration_B_, acceleration_};
  }
  void Restore(const State& state);
  /// Loads and point spring are those between two shares of a step that begins at `start`.
  void SetInputsWithin(const State& start, double share_start, double share_end) {
    load_ = start.load;
    point_spring_ = start.point_spring.Within(share_start, share_end);
  }

  double KineticEnergy() const;
  double PotentialEnergy(const Vector3& gravity_W) const {
    return -weight_share_ * inertia_.mass * gravity_W.dot(center_W());
  }
  bool IsFinite() const { return X_WB_.IsFinite() && omega_B_.allFinite() && velocity_.allFinite(); }

 private:
  std::string name_;
  SpatialInertia inertia_;
  double weight_share_ = 1;  // of the weight that nothing compensates
  Matrix3 rotational_root_;  // C: C Cᵀ = I_B⁻¹
  RigidTransform X_WB_;
  Vector3 omega_B_ = Vector3::Zero();
  Vector3 omega_B_before_ = Vector3::Zero();
  Vector3 velocity_ = Vector3::Zero();
  Vector3 velocity_before_ = Vector3::Zero();
  bool pushed_ = false;  // contact acted in this step
  RigidTransform X_WB_before_;
  AppliedForces load_;  // about the centre of mass
  struct StageBase {
    Matrix3 R_WB = Matrix3::Identity();
    Vector3 center_W = Vector3::Zero(), spin_W = Vector3::Zero(), velocity = Vector3::Zero();
  };
  StageBase step_start_, stage_base_;
  Vector3 gravity_W_ = Vector3::Zero(), spin_end_W_ = Vector3::Zero();
  Vector3 omega_B_first_ = Vector3::Zero(), velocity_first_ = Vector3::Zero();  // of the first stage
  Vector3 angular_acceleration_B_ = Vector3::Zero(), acceleration_ = Vector3::Zero();
  RigidTransform X_stage_start_;
  Velocity stage_start_;
  Vector3 center_stage_start_ = Vector3::Zero();
  Vector3 load_moment_W_ = Vector3::Zero();  // at the pose that the stage is linearised at
  PointSpring point_spring_;
  bool is_stiff_ = false;  // the stage at hand has the stiffness of loads or of the spring
  // Of such a stage, A V = rhs in PortTwist()'s coordinates: the operator, Y with YᵀY = A⁻¹, the right side.
  Matrix6 stage_A_ = Matrix6::Zero(), stage_root_ = Matrix6::Zero();
  Vector6 stage_rhs_ = Vector6::Zero();
  Vector3 velocity_end_ = Vector3::Zero();  // that the momentum of the stage gives
  Vector6 StageForce() const;
  Vector6 StageMomentum(double b) const;
  Eigen::Matrix<double, 3, 6> SpringJacobian() const;
  void PredictStiffStage(double b);
  double MoveAndComputeStiffResidual(double b, StageMotion& moved);
  Matrix3 InverseInertia_B() const { return rotational_root_ * rotational_root_.transpose(); }
  Vector3 FreeTurning(double b, Vector3 guess) const;
};

}  // namespace fork1s
