// What a step of a mechanism keeps beside its model and its state: functions of the two, and scratch.
#pragma once

#include <atomic>
#include <cmath>
#include <fork1s/stepping/mechanism_state.hpp>
#include <limits>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "expanded_pose.hpp"
#include "linalg/cholesky.hpp"
#include "mechanism/paths.hpp"
#include "reduction/reduced_jacobian.hpp"
#include "stepping/mechanism_model.hpp"
#include "stepping/step_context.hpp"

namespace fork1s {

/// A spring that is slack over a range (slack.cpp).
struct SlackSpring {
  std::size_t spring = 0;        // in springs()
  int side = 0;                  // at which the step takes it to end, or MechanismState::kInSolve
  double length = 0, force = 0;  // at the start of the step
};

/// Where an implicit stage starts (implicit_stage.cpp): configuration and momentum, in flat spaces, so that stages are
/// sums of these. Sizes: n joint coordinates, r reduced ones, k rigid parts.
struct StageBase {
  VectorX z;                           // r
  Matrix3 R_WR = Matrix3::Identity();  // of a floating base
  Vector3 center_W = Vector3::Zero();  // m, centre of mass of a floating mechanism
  Matrix6X momentum;       // 6 x k, spatial momenta about a point that drifts with the base [N·m·s; N·s]
  VectorX joint_momentum;  // n, armature times joint velocity
  VectorX rates, turned_rates;  // r: by expansions in place of these two (expanded_pose.hpp)
  // Of a floating mechanism, in the same space: its momentum beyond the sum of its parts', which are known to
  // the tolerance of the stages, while that of the whole is exact.
  Vector6 momentum_defect = Vector6::Zero();
};

/// Inertia at a pose.
struct MassAtPose {
  explicit MassAtPose(const ReducedModel& model) : inertia(model) {}

  MatrixX M;     // num_velocities²
  Matrix6 M_00;  // of the base
  Matrix6X M_0z;
  Cholesky factor;         // scratch of whoever solves by M
  ReducedInertia inertia;  // scratch of Compute
};

/// Where a step starts.
struct StepStart {
  RigidTransform X_WR;
  Vector6 V_R = Vector6::Zero();  // twist of the base
  VectorX q_dot;                  // n
  VectorX x;                      // num_velocities
  MatrixX M;                      // num_velocities², of mechanisms that step by expansions
  double h = 0;                   // s, of the step, or its last part
  StageBase base;
  Vector3 drift_W = Vector3::Zero();  // m/s, of the point that momenta are taken about
  bool by_expansion = false;          // the step, or its last part
};

/// The stage at hand; (1) and (2) of implicit_stage.cpp.
struct StageData {
  StageBase base, end;  // where it starts from, what was found last
  double length = 0;    // s
  double time = 0;      // s, from the start of the step to the pose that it is linearized at
  VectorX v_k;          // num_velocities: the velocity that it is linearized at
  VectorX impulse;      // num_velocities: of contact and limits
  VectorX change;       // num_velocities: by the Newton iteration at hand
  VectorX residual;     // num_velocities, N s, N m s
  VectorX x_first;      // num_velocities: of the first stage
};

/// Where the stage at hand starts, of the step or after the first stage (stage_start.cpp).
struct StageStart {
  VectorX z;  // r
  VectorX x;  // num_velocities
  RigidTransform X_WR;
  Vector3 center_W = Vector3::Zero();  // m, centre of mass of a floating mechanism
  double time = 0;                     // s
  Vector6 V_R_end = Vector6::Zero();   // of a driven base, at the end of the stage, in the R of its start
};

/// Centre of mass [m] and linear momentum [N s] of a floating mechanism, world axes.
struct FloatingMotion {
  Vector3 center_W, linear_W;                // at the start of the step
  Vector3 linear_first_W = Vector3::Zero();  // after the first stage
  Vector3 stage_center_W = Vector3::Zero();  // at the end of the stage at hand
  Vector3 stage_linear_W = Vector3::Zero();
  Vector3 linear_change_W = Vector3::Zero();  // of stage_linear_W by the Newton iteration at hand
};

/// A of (2) of implicit_stage.cpp.
struct StageMatrix {
  MatrixX A;         // num_velocities²
  MatrixX A_before;  // num_velocities²: but for stiffness of the pose at hand, or before what may fail
  Cholesky factor;   // of A
  double b = 0;      // s: length of the stages that it is of, 0 for none
  bool is_definite = false;
  GeometricStiffness of_parts = GeometricStiffness::kNone;
  double artificial_damping = 0;                   // SetArtificialDamping
  std::vector<signed char> at_bound, slack_sides;  // saturation that it is of
};

/// Of the velocity that momenta are computed of, at the pose at hand.
struct VelocitiesAtPose {
  VectorX w;      // r
  VectorX q_dot;  // n
  VectorX joint;  // n: relative velocities of joints, which the momentum of the armature is of
  MaterialVelocities parts;
};

/// J(x)ᵀ (p̂ - p) at the pose at hand, and what it is made of [N s, N m s].
struct MomentumChange {
  VectorX all;             // num_velocities
  VectorX reduced;         // r
  VectorX joint;           // n
  Matrix6X parts;          // 6 x k, in R about R's origin
  Matrix3X part_impulses;  // 3 x k: linear parts of these without dampers, in R
};

/// At the pose at hand, but for what the contact solve finds.
struct ForcesAtPose {
  Vector3 gravity_W = Vector3::Zero();  // m/s²
  VectorX f_z;                          // r
  VectorX g;                            // n: all joint forces
  VectorX tau;                          // n: those of weight, loads and controls
  Matrix6X F;                           // 6 x bodies: wrenches on bodies in R about R's origin
  Vector6 base;                         // wrench on the base, likewise
};

/// Forces with bounds and springs with slack (force_limits.cpp, slack.cpp).
struct ActiveSetForces {
  std::vector<SlackSpring> slack;  // those of springs() that have slack
  VectorX servo_force;             // per force limit: f₀, at the start of the stage
  VectorX f_z_without;             // r: f_z without bounds
  VectorX way;                     // r: displacement to where forces act
  // At the end of the first stage.
  VectorX first_servo_force, first_slack_force;
  std::vector<signed char> first_at_bound, first_slack_side;
};

/// Geometric stiffness of loads (applied_forces.cpp).
struct LoadStiffness {
  MatrixX K;                          // num_velocities², lower triangle
  Matrix3X carried_force;             // 3 x joints, N: on all that a joint carries, in R
  Matrix3X carried_moments;           // 3 x 3 joints, N·m: Σ x Fᵀ likewise, about R's origin
  Matrix6X joint_twist;               // 6 x r, of one joint
  Matrix3X joint_turn, turned_lever;  // 3 x r
  std::vector<double> path_forces;    // N, per Mechanism::paths(); below 0 it pulls
  std::vector<internal::StraightPart> straight_parts;  // of one path
};

/// A point spring at the pose at hand (point_spring.cpp).
struct PointSpringAtPose {
  Matrix3X J;                // 3 x num_velocities, velocity of its point in R
  Vector3 point_R, force_R;  // m; N, without the damper
  Vector3 base_velocity_R;   // m/s, of its point with a driven base
};

/// What a new reference is asked for: loads that the coordinates miss (mechanism_refresh.cpp).
struct MissingLoad {
  VectorX
      inertial_force;  // n, N, N m: J(x)ᵀ (p̂ - p)/b of a stage and dampers, where the model has a complement
  VectorX control_change;  // controls at the end of the step less those at its start
  Matrix6X wrenches_R;     // 6 x bodies or empty: applied forces at the end of the step
  VectorX
      reactions;  // n or empty: joint forces of stops, dry frictions and saturated servos in the last stage
  VectorX load;   // n: all joint forces
  VectorX displacement;  // n: C_perp load
  VectorX inertia;       // n: M(q) displacement
};

/// One control that jumps (control_jump.cpp).
struct ControlJump {
  VectorX control;       // as controls
  VectorX tau, force;    // n, r
  VectorX damper_force;  // r
};

/// Whether something was made, and who makes it; a copy has a mutex of its own.
class PoseFlag {
 public:
  PoseFlag() = default;
  PoseFlag(const PoseFlag& other) : value_(other.value_.load()) {}
  PoseFlag& operator=(const PoseFlag& other) {
    value_ = other.value_.load();
    return *this;
  }
  void store(bool value) { value_ = value; }
  /// Makes it once, whoever else asks meanwhile.
  template <class F>
  void MakeOnce(const F& make) {
    if (value_) return;
    const std::lock_guard lock(mutex_);
    if (value_) return;
    make();
    value_ = true;
  }

 private:
  std::atomic<bool> value_ = false;
  std::mutex mutex_;
};

/// The expansion that poses are told by (expansions.cpp).
struct PoseByExpansion {
  std::shared_ptr<const ExpandedMechanism> of;
  ExpandedPose pose;
  bool in_use = false;  // the pose at hand is told by it
};

/// A driven base in the step at hand.
struct DrivenBase {
  BasePath path;
  VectorX velocity_jump;  // r: by the jump of its twist
};

/// Scratch of one function at a time.
struct Scratch {
  ControlJump jump;
  VectorX rhs, solved;  // num_velocities: right side of a linear system, solution
  VectorX activation;   // as MechanismState::activation; of all controls what their force is proportional to
  VectorX length_row;   // r: rate of a length per unit of the rates
  RowMatrixX rotation_rows;  // E Q_θ of damped rotations, three rows each
};

/// Sizes: n joint coordinates, r reduced ones, k rigid parts.
struct MechanismWorkspace {
  explicit MechanismWorkspace(const MechanismModel& model)
      : configuration(*model.reduced), jacobian(*model.reduced), mass(*model.reduced) {}

  /// Rows of coordinates that nobody names are those of the expansion, where the pose is told by one.
  const RowMatrixX& Q_now() const { return expansion.in_use ? expansion.pose.Q : configuration.Q_now; }
  const VectorX& q() const { return expansion.in_use ? expansion.pose.q : configuration.q; }
  const std::vector<PathState>& paths() const { return configuration.kinematics.paths; }

  // Of the pose at hand. Between expansions the configuration is made when somebody asks for it
  // (ConfigurationOf).
  mutable Configuration configuration;
  mutable PoseFlag has_exact_pose;
  ReducedJacobian jacobian;  // of configuration
  MassAtPose mass;
  ForcesAtPose forces;
  VelocitiesAtPose velocities;
  MomentumChange momentum_change;
  PointSpringAtPose point_spring;

  PoseByExpansion expansion;

  VectorX x;  // num_velocities: the velocity at hand
  DrivenBase driven;
  StepStart start;
  FloatingMotion floating;
  StageStart stage_start;
  StageData stage;
  StageMatrix matrix;
  ActiveSetForces active_set;
  LoadStiffness loads;
  MissingLoad missing;

  Scratch scratch;
};

/// x <- A⁻¹ x. An A that is no inertia gives no number, which World::Step finds, takes back and reports.
void SolveOrFail(Cholesky& factor, const MatrixX& A, VectorX& x);

/// √s of a square s that rounding may have made negative; NaN for NaN, which std::max would turn into 0.
inline double RootOf(double s) { return s < 0 ? 0 : std::sqrt(s); }

/// √(xᵀ y) of y = A x or A⁻¹ x; NaN where the product is more negative than by the rounding of y: far beyond the size of
/// a mechanism its inertia loses all digits, and A is not positive definite.
inline double RootOfProduct(const VectorX& x, const VectorX& y) {
  const double s = x.dot(y);
  return s < -1e-8 * x.cwiseProduct(y).cwiseAbs().sum() ? std::numeric_limits<double>::quiet_NaN()
                                                        : RootOf(s);
}

}  // namespace fork1s
