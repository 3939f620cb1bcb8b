// One mechanism in full coordinates.
//
// Unknowns of a step, in this order: twists V_b of all moving bodies, each in its body's axes about its
// origin; joint rates q̇; multipliers ν of the links (six a moving body that hangs on a parent) and of the
// loops. With G the constraint rows, p the momentum at the start seen from the body's new pose (so that it is
// carried along without loss), and everything on the right taken at the end of the step:
//     I_b V_b  + G_bᵀ ν = p_b + h F_b(X) + contact impulses
//     Eᵀ a E q̇ + G_qᵀ ν = Eᵀ a E_0 q̇_0 + h τ(q, q̇)   a: armature; E q̇: joint velocities, ω of rotation vectors
//     G_b V + G_q q̇     = 0
// Poses follow from q = q_0 + h q̇ and the base by solving the link and loop equations themselves.
//
// A stage (two_stages.cpp) is such a step. The second one of two starts where nothing has been: p_b and a q̇_0
// are then not those of twists, and q_0 closes no loop.
#pragma once

#include <array>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <memory>
#include <string>
#include <vector>

#include "saddle_solver.hpp"

namespace fork1s::internal {

/// A body hanging on its parent: X_pb = X_PB Exp(S_1 q_1) ... Exp(S_k q_k), none where it is welded. All six
/// directions of Log(X_pb(q)⁻¹ X_p⁻¹ X_b) are rigid, q are unknowns of their own.
struct Link {
  int body = 0, parent = 0;
  int first_joint = 0, num_joints = 0;
  int offset = 0, size = 0;  // coordinates
  int row = 0;               // first of six constraint rows, counted from the first constraint
};

/// Rows of a link on the twists of its two bodies and its joint rates: V_b + on_parent V_p + on_rates q̇ = 0.
struct LinkRows {
  Matrix6 on_parent;
  Matrix6X on_rates;
};

/// ω = E θ̇ of a joint whose rotation is a rotation vector, along its axes as the body carries them.
struct RotationMap {
  std::array<int, 3> at;  // coordinates of θ
  Matrix3 E;
};

class FullMechanism {
 public:
  static Expected<FullMechanism> Create(std::shared_ptr<const Mechanism> mechanism, const VectorX& q0,
                                        const VectorX& q_dot0, const RigidTransform& X_WR,
                                        const Vector6& V_R);

  const Mechanism& mechanism() const { return *mechanism_; }
  const std::vector<RigidTransform>& poses() const { return X_; }
  RigidTransform Pose(int body) const { return X_[static_cast<std::size_t>(body)]; }
  /// Twist of a body in its own axes about its origin.
  Vector6 BodyTwist(int body) const { return V_.col(body); }
  const VectorX& q() const { return q_; }
  const VectorX& q_dot() const { return q_dot_; }
  /// What a length is at q, and its rate there; paths of the joint coordinates.
  double Length(const Mechanism::Length& length, const VectorX& q) const {
    return LengthOf(*mechanism_, length, At(q), q);
  }
  double LengthRate(const Mechanism::Length& length, const VectorX& q, const VectorX& q_dot) const {
    double rate = 0;
    ForEachArmAt(length, q, [&](int i, double c) { rate += c * q_dot(i); });
    return rate;
  }
  /// f(coordinate, ∂length/∂q)
  template <class F>
  void ForEachArmAt(const Mechanism::Length& length, const VectorX& q, F&& f) const {
    if (length.path < 0 || mechanism_->paths()[static_cast<std::size_t>(length.path)].rates.empty()) {
      ForEachArm(length, At(q).paths, f);
      return;
    }
    for (const auto& [i, c] : length.terms) f(i, c);
    VectorX arms = VectorX::Zero(mechanism_->num_coordinates());
    for (const auto& [i, c] : mechanism_->paths()[static_cast<std::size_t>(length.path)].rates)
      arms(i) += length.gear * c;
    for (const RotationMap& rotation : RotationMaps(q)) {
      const Vector3 on_theta = rotation.E.transpose() * arms(rotation.at);
      if (on_theta.isZero(0)) continue;
      for (int k = 0; k < 3; ++k) f(rotation.at[static_cast<std::size_t>(k)], on_theta(k));
    }
  }
  /// Of every rotation vector (mechanism_rows.cpp).
  std::vector<RotationMap> RotationMaps(const VectorX& q) const;
  /// Joint velocities at q: ω of rotation vectors, q̇ of all other coordinates.
  VectorX JointVelocities(const VectorX& q, const VectorX& q_dot) const;
  /// Forces on joint velocities as forces on coordinates.
  VectorX CoordinateForces(const VectorX& q, VectorX force) const;
  /// Eᵀ diag(weights) E (n x n).
  MatrixX OnCoordinates(const VectorX& q, const VectorX& weights) const;
  const std::vector<Mechanism::LengthLimit>& length_limits() const { return mechanism_->length_limits(); }
  const std::vector<std::string>& warnings() const { return warnings_; }

  VectorX controls;  // what forces are proportional to: inputs, or activations where they have dynamics
  RigidTransform driven_next;              // pose that a driven base reaches in the next step
  Vector6 driven_twist = Vector6::Zero();  // of a driven base at the end of the next stage, body axes
  bool pushed = false;                     // contact acts in this step
  /// Wrench on a body in world axes, until ClearLoads. Throughout a step about the point of the world;
  /// within stages the force keeps to the point of the body.
  void AddWrench(int body, const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);
  void ClearLoads();

  /// Opens a step: momenta and a first guess of its end.
  bool Begin(double h, const Vector3& gravity_W);
  /// The same for a stage; `second`: from where GoOn has led, and not from the state.
  bool BeginStage(double h, const Vector3& gravity_W, bool second);
  /// Moves to where the stage that was solved leads if it goes on for `onward` times its length. What Pose
  /// and q tell is then that place, BodyTwist and q_dot what the stage ended with.
  void GoOn(double onward);
  /// Takes equations and their tangent at the present guess, with contact impulses `on_bodies` (6 x bodies,
  /// body axes) as they were, whose directions turn with the bodies. Without `stiffening`, loads leave no
  /// stiffness in the tangent: slower and safer.
  bool Linearise(const Matrix6X& on_bodies, bool stiffening);
  int num_unknowns() const { return num_velocities_ + num_rows_; }
  /// First of the six unknowns of a body's twist, -1 for bodies whose motion is given.
  int ColumnOfBody(int body) const { return column_[static_cast<std::size_t>(body)]; }
  int ColumnOfCoordinate(int i) const { return num_body_columns_ + i; }
  const SaddleSolver& solver() const { return dynamics_; }
  /// Unknowns after this iteration, before contact impulses are added.
  const MatrixX& free_unknowns() const { return free_; }
  /// Accepts unknowns as the new guess and brings its poses up to date. Returns the largest change of a pose
  /// [m].
  double Accept(const MatrixX& unknowns);
  const RigidTransform& NextPose(int body) const { return X_next_[static_cast<std::size_t>(body)]; }
  Vector6 NextTwist(int body) const { return V_next_.col(body); }
  const VectorX& next_q() const { return q_next_; }
  const VectorX& next_q_dot() const { return q_dot_next_; }
  bool NextIsFinite() const;
  /// Largest opening of a link or loop at the guess [m].
  double NextGap() const { return gap_; }
  /// Ends the step: the guess becomes the state.
  void Commit();
  /// All that a step starts from.
  struct State {
    std::vector<RigidTransform> X;
    Matrix6X V;
    VectorX q, q_dot, nu, reactions;
    double h_last = 0, reaction_time = 0;
  };
  State Save() const { return {X_, V_, q_, q_dot_, nu_, reactions_, h_last_, reaction_time_}; }
  void Restore(const State& state);
  /// From here on ClosureForces is the mean of what steps and stages add.
  void StartReactions();

  double KineticEnergy() const;
  double StoredEnergy() const;
  double GravityEnergy(const Vector3& gravity_W) const;
  Vector6 Momentum() const { return MomentumOf(X_, V_); }
  VectorX ClosureForces() const;
  /// Opening [m] of every link and closure, by name.
  std::vector<std::pair<std::string, double>> Gaps() const;
  std::vector<double> Frequencies(int count) const;
  MatrixX Compliance(const std::vector<BodyIndex>& bodies) const;

 private:
  void LayOut();
  /// Joints posed by their coordinates alone, where paths ask for it. Kept for the last q.
  const Kinematics& At(const VectorX& q) const;
  void StartMotion(const VectorX& q_dot0, const Vector6& V_R);
  bool Moves(int body) const { return column_[static_cast<std::size_t>(body)] >= 0; }
  int Row(int constraint) const { return num_velocities_ + constraint; }

  // Geometry of constraints (mechanism_rows.cpp).
  RigidTransform LinkPose(const Link& link, const VectorX& q) const;
  LinkRows RowsOf(const Link& link, const std::vector<RigidTransform>& X, const VectorX& q) const;
  /// Stiffness that link multipliers ν leave between joints stacked on one body, ν·[J_k, J_i].
  void AddLinkStiffening(const Link& link, const LinkRows& rows, const Vector6& nu, double h);
  Vector6 ClosureError(const ClosureDef& closure, const std::vector<RigidTransform>& X) const;
  /// 6 x 12 on [V_a; V_b].
  Eigen::Matrix<double, 6, 12> ClosureRows(const ClosureDef& closure, const RigidTransform& X_a,
                                           const RigidTransform& X_b) const;
  double CouplingError(const Mechanism::Coupling& coupling, const VectorX& q) const;
  double CouplingSlope(const Mechanism::Coupling& coupling, const VectorX& q) const;
  /// All rows G into `solver`, loop rows shifted by `epsilon`. `base_moves`: with the columns of a floating
  /// base.
  void AddConstraints(const std::vector<RigidTransform>& X, const VectorX& q, bool base_moves, double epsilon,
                      SaddleSolver& solver) const;
  /// G on twists that are given, such as a driven base's (num_rows).
  VectorX GivenVelocities(const std::vector<RigidTransform>& X, const VectorX& q, const Matrix6X& V) const;

  // A stage (mechanism_stages.cpp).
  Vector6 LoadsAt(int body, const RigidTransform& X) const;
  Vector6 DriftMomentum(int body, const RigidTransform& X) const;
  Vector6 CarriedMomentum(int body, const RigidTransform& X) const;

  // The step (mechanism_step.cpp).
  void StartMomenta();
  VectorX Unknowns() const;
  void AddBodies(const Matrix6X& on_bodies, bool stiffening, MatrixX& right);
  void AddJoints(MatrixX& right);
  /// tau += pull along a length; its slopes in the matrix.
  void AddAlongLength(const Mechanism::Length& length, double pull, double stiffness, double damping,
                      VectorX& tau);
  void AddMuscle(const MuscleDef& muscle, VectorX& tau);
  double ServoForce(const Mechanism::ForceLimit& limit, const VectorX& q) const;  // at rest, without bounds
  void AddClosures(bool stiffening, MatrixX& right);
  // Poses that satisfy every constraint (mechanism_poses.cpp).
  struct Matrices {
    MatrixX G, M, K;
  };
  Matrices LinearMatrices() const;
  Vector6 MomentumOf(const std::vector<RigidTransform>& X, const Matrix6X& V) const;
  /// Velocity of the centre of mass, world axes.
  Vector3 Drift(const std::vector<RigidTransform>& X, const Matrix6X& V) const {
    return MomentumOf(X, V).tail<3>() / mechanism_->total_mass();
  }
  RigidTransform NextBasePose() const;
  RigidTransform BaseMoved(const Vector6& V, const Matrix3& R_end, double h) const;
  double AdvancePoses();
  double Project(std::vector<RigidTransform>& X, VectorX& q);

  std::shared_ptr<const Mechanism> mechanism_;
  mutable std::vector<Kinematics> posed_;  // none or one
  mutable VectorX posed_at_;
  std::vector<Link> links_;
  std::vector<int> column_;  // per body
  std::vector<Matrix6> inertia_;
  int num_body_columns_ = 0, num_velocities_ = 0, num_rows_ = 0, first_loop_row_ = 0;
  std::vector<std::string> warnings_;

  // State.
  std::vector<RigidTransform> X_;
  Matrix6X V_;
  VectorX q_, q_dot_, nu_;
  double h_last_ = 0;
  VectorX reactions_;  // sum of ν of the last step [N·s, N·m·s], over this time
  double reaction_time_ = 0;

  // Of the step under way.
  double h_ = 0;
  Vector3 gravity_W_ = Vector3::Zero();
  bool has_wrenches_ = false;
  Matrix6X wrenches_W_;  // about the world's origin
  struct Load {          // at a point of the body
    int body = 0;
    Vector3 force_W, moment_W, point_B;
  };
  std::vector<Load> loads_;
  bool stage_ = false;
  Matrix6X momentum_;    // per body at the start, seen from X_; in stages that of the drift taken off
  VectorX rates_start_;  // joint velocities E_0 q̇_0
  Vector3 drift_W_ = Vector3::Zero();
  std::vector<RigidTransform> X_next_;
  Matrix6X V_next_;
  VectorX q_next_, q_dot_next_, nu_next_;
  double gap_ = 0;
  SaddleSolver dynamics_, positions_;
  MatrixX free_;
};

}  // namespace fork1s::internal
