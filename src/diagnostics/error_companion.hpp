// What the equations of motion of all coordinates miss in the motion of one mechanism, and their tangent.
#pragma once

#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/world/world.hpp>
#include <vector>

#include "linalg/solve.hpp"

namespace fork1s {

/// The load at a node between two steps [moment; force]. Implicit Euler applies what acts at the end of a
/// step, the other scheme what acts half way.
Vector6 LoadAtNode(const Vector6& before, const Vector6& after, bool by_euler);

/// Derivatives at node n of mean rates v0 to v4 over the steps (n-4, n-3) to (n, n+1), right to h^2.
template <typename T>
struct RateDerivatives {
  RateDerivatives(const T& v0, const T& v1, const T& v2, const T& v3, const T& v4, double h)
      : second((3 * (v4 - v3) - 4 * (v3 - v2) + (v2 - v1)) / (2 * h * h)),
        // From nodes n-1 and n-2 on to n.
        third((2 * ((v4 - v3) - 2 * (v3 - v2) + (v2 - v1)) - ((v3 - v2) - 2 * (v2 - v1) + (v1 - v0))) /
              (h * h * h)) {}
  T second, third;
};

/// Coordinates y of a mechanism's error: a small turn and shift of a floating base in R, then motions of the
/// joints that keep loops closed.
class ErrorCompanion {
 public:
  explicit ErrorCompanion(const MechanismDynamics& m);

  int size() const { return base_ + static_cast<int>(basis_.B.cols()); }
  int base_size() const { return base_; }
  /// Base and joints, of which y are those that keep loops closed.
  int full_size() const { return base_ + static_cast<int>(basis_.B.rows()); }
  void ToBasis(const VectorX& full, Eigen::Ref<VectorX> y) const;

  /// Loads of the coming step.
  void Begin(const MechanismDynamics& m);
  /// The step's end: pose and the contacts' wrenches [6 x bodies] about the world's origin in world axes,
  /// those of the step before, as they lie at the node, and those of this one; forces of stops [n]. `smooth`:
  /// in the last five steps forces of contacts changed gently, by `contacts_curved_W` from step to step (second
  /// difference of the last three, as they lie at the node).
  void End(const MechanismDynamics& m, const Matrix6X& contacts_before_W, const Matrix6X& contacts_W,
           const Matrix6X& contacts_curved_W, const VectorX& stops, const StepOptions& options, bool smooth);

  /// New basis and tangent at the node: M, D, K of y. `from`: coefficients [size x k] of the old basis become
  /// those of the new one.
  void Linearise(const MechanismDynamics& m, const Vector3& gravity_W, MatrixX& from);
  /// By how much [rad] joints or base have left the motion of then, `age` [s] ago; slides in lengths of the
  /// mechanism.
  double Moved(const MechanismDynamics& m, double age);
  const MatrixX& M() const { return tangent_.M; }
  const MatrixX& D() const { return tangent_.D; }
  const MatrixX& K() const { return tangent_.K; }

  /// Residual at the node, by centred differences; that of backward Euler's equations there; and the force
  /// that is missing on the straight way between nodes, where rates do not change.
  void Residuals(const MechanismDynamics& m, const Vector3& gravity_W, Eigen::Ref<VectorX> centred,
                 Eigen::Ref<VectorX> euler, Eigen::Ref<VectorX> straight);
  /// Sum [size] over both steps of the forces of controls, weighted by 1 - |t - t_n|/h, over h and less the
  /// force at the node: what a change of slope there adds. None in the first step and at its end.
  void ControlKink(const MechanismDynamics& m, Eigen::Ref<VectorX> kink);
  /// By how much rates of y differ on both sides of the node.
  VectorX Turn() const;
  /// The part of a residual [size] that the reduced coordinates see, by M.
  void SplitOff(const MechanismDynamics& m, const Eigen::Ref<const VectorX>& residual,
                Eigen::Ref<VectorX> seen);

  /// Row [full_size] of a wrench in world axes about the world's origin on what joint `last_joint` carries.
  VectorX WrenchRow(const MechanismDynamics& m, int last_joint, const Vector6& F_W) const;
  /// Its power in the motion of the step from the node.
  double SpeedAlong(const MechanismDynamics& m, int last_joint, const Vector6& F_W) const;
  /// Displacement of a body's origin, world axes.
  Vector3 Displacement(const MechanismDynamics& m, BodyIndex b, const Eigen::Ref<const VectorX>& y) const;
  /// Of the body at the node.
  RigidTransform Pose(BodyIndex b) const { return X_[1] * kinematics_.X_RB[b.u()]; }

 private:
  struct Motion {
    Vector6 V = Vector6::Zero(), A = Vector6::Zero();
    VectorX q_dot, q_ddot;
  };
  struct Loads {
    Matrix6X F_W;
    VectorX controls, stops;  // at the end of the step
    VectorX controls_from;    // at its start, between which controls are linear
  };
  void Centre();
  void CorrectCentred();
  bool ControlsKink() const;
  // [base; n] force that is missing.
  void Missing(const MechanismDynamics& m, const Vector3& gravity_W, const VectorX& q,
               const RigidTransform& X_WR, const Motion& motion, const Loads& loads, VectorX& out);

  int base_ = 0, steps_ = 0;
  int nodes_without_kink_ = 0;  // of controls, up to the present one
  bool smooth_ = false;
  double h_ = 0;
  bool by_euler_ = true;
  VectorX q_[3];         // of the node before, the node, the node after it
  RigidTransform X_[3];  // X_WR
  VectorX v_[3];         // between: before the node before, before the node, after it
  Vector6 V_[3];
  struct {  // in the step before that of v_[0], and in the one before
    VectorX v, v_before;
    Vector6 V = Vector6::Zero(), V_before = Vector6::Zero();
  } earlier_;
  Matrix6X contacts_curved_;
  VectorX stop_forces_[3];  // in the step to the node before, to the node, and from it
  Loads loads_[2], mean_;   // of the step to the node, and from it
  Kinematics kinematics_;
  struct {  // loads without contacts, in the step to the node and in the one from it
    Matrix6X before, now;
  } applied_;
  struct {
    Motion centred, euler;
  } motion_;
  struct {  // where the tangent is of
    VectorX q;
    RigidTransform X;
    Motion motion;
  } linearised_;
  struct {
    bool tree = true;
    MatrixX B;         // n x nB; identity on trees
    MatrixX to_basis;  // nB x n: B y = q  =>  y = to_basis q; not on trees
  } basis_;
  struct {  // by y
    MatrixX M, D, K, damping;
    MatrixX seen;  // size x size: M Q (QᵀMQ)⁻¹ Qᵀ
  } tangent_;
  struct Scratch {
    explicit Scratch(const Mechanism& mechanism) : kinematics(mechanism) {}
    Kinematics kinematics;
    Matrix6X F, body_V, body_A;
    VectorX tau, spring, full;
  };
  Scratch scratch_;
};

}  // namespace fork1s
