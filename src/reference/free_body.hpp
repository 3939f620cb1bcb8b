// A free rigid body, as the full-coordinate step moves it.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <vector>

namespace fork1s::internal {

/// Implicit Euler for the centre of mass; for the rotation I (ω⁺ - ω)/h + ω̄ x I ω̄ = τ with ω̄ the mean, which
/// is also the turn of the step. In a stage (two_stages.cpp) momenta l, p of the world's axes are what is
/// stepped, R I ω = l + h τ with R = R_start exp(h ω). Its port for contacts is [ω; velocity of the centre]
/// in world axes.
class FullFreeBody {
 public:
  explicit FullFreeBody(const FreeBodyDef& definition);

  const RigidTransform& pose() const { return X_WB_; }
  /// At the guess of a stage.
  const RigidTransform& NextPose() const { return X_next_; }
  Vector6 NextPortTwist() const;
  Vector3 center_W() const { return X_WB_ * inertia_.center; }
  Vector3 CenterAt(const RigidTransform& X) const { return X * inertia_.center; }
  void SetState(const RigidTransform& X_WB, const Vector3& omega_W, const Vector3& velocity_of_origin_W);
  void AddWrench(const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);
  Vector6 PortTwist() const;
  /// [ω_W; velocity of the origin], world axes.
  Vector6 Velocity() const;

  bool pushed = false;  // contact acts in this step
  void Begin(double h, const Vector3& gravity_W);
  /// These are as those of FullMechanism.
  void BeginStage(double h, const Vector3& gravity_W, bool second);
  void GoOn(double onward);
  Matrix6 InverseInertia() const;
  /// Port twist after one more Newton iteration on the rotation without contact.
  Vector6 FreePortTwist() const;
  /// Takes a port twist as the new guess; the largest change of the step's turn or path [rad, m].
  double Accept(const Vector6& port_twist);
  bool NextIsFinite() const { return omega_B_next_.allFinite() && velocity_next_.allFinite(); }
  void Commit();
  void ClearLoads();

  double KineticEnergy() const;
  double GravityEnergy(const Vector3& gravity_W) const {
    return -weight_share_ * inertia_.mass * gravity_W.dot(center_W());
  }
  Vector6 Momentum() const;

 private:
  struct Load {  // at a point of the body
    Vector3 force_W, moment_W, point_B;
  };
  Vector3 LoadMoment(const Matrix3& R) const;  // about the centre
  RigidTransform Moved(const Vector3& omega_B, const Vector3& velocity, double h) const;
  Vector3 FreeTurning() const;

  SpatialInertia inertia_;
  double weight_share_ = 1;  // of the weight that nothing compensates
  Matrix3 inverse_rotational_;
  RigidTransform X_WB_;
  Vector3 omega_B_ = Vector3::Zero(), velocity_ = Vector3::Zero();  // of the centre, world axes
  Vector3 force_W_ = Vector3::Zero(), moment_W_ = Vector3::Zero();  // about the centre
  std::vector<Load> loads_;
  double h_ = 0;
  Vector3 gravity_W_ = Vector3::Zero();
  bool stage_ = false;
  Vector3 turning_W_ = Vector3::Zero(),
          start_velocity_ = Vector3::Zero();    // l and p/m that a stage starts with
  Vector3 contact_moment_W_ = Vector3::Zero();  // N·m·s about the centre, of the last iteration
  RigidTransform X_next_;
  Vector3 omega_B_next_ = Vector3::Zero(), velocity_next_ = Vector3::Zero();
};

}  // namespace fork1s::internal
