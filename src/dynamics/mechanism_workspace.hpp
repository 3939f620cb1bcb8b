// What a step of a mechanism keeps beside its model and its state: functions of the two, and scratch.
#pragma once

#include <fork1s/dynamics/mechanism_model.hpp>
#include <fork1s/dynamics/mechanism_state.hpp>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/reduction/reduced_jacobian.hpp>
#include <utility>
#include <vector>

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
  VectorX z;                                  // r
  Matrix3 R_WR = Matrix3::Identity();         // of a floating base
  Vector3 center_W = Vector3::Zero();         // m, centre of mass of a floating mechanism
  Matrix6X momentum;                          // 6 x k, spatial momenta about a point that drifts with the base [N·m·s; N·s]
  VectorX joint_momentum;                     // n, armature times joint velocity
  // Of a floating mechanism, in the same space: its momentum beyond the sum of its parts', which are known to
  // the tolerance of the stages, while that of the whole is exact.
  Vector6 momentum_defect = Vector6::Zero();
};

/// Sizes: n joint coordinates, r reduced ones.
struct MechanismWorkspace {
  explicit MechanismWorkspace(const MechanismModel& model)
      : configuration(*model.reduced), jacobian(*model.reduced), inertia(*model.reduced) {}

  const RowMatrixX& Q_now() const { return configuration.Q_now; }
  const std::vector<PathState>& paths() const { return configuration.kinematics.paths; }

  // Of the present pose.
  Configuration configuration;
  ReducedJacobian jacobian;  // of configuration
  ReducedInertia inertia;
  MatrixX M_full;  // num_velocities²
  Matrix6 M_00;
  Matrix6X M_0z;

  // Of a step.
  Vector6 V_R_before = Vector6::Zero();  // base twist at the start of the step
  VectorX x;                             // num_velocities
  MatrixX A;                             // num_velocities²
  Cholesky factor;
  VectorX rest;                                     // n
  RowMatrixX rotation_rows;                         // E Q_θ of damped rotations, three rows each
  VectorX q_dot, q_ddot;                            // n
  Vector3 gravity_W = Vector3::Zero();
  std::vector<SlackSpring> slack;                       // those of springs() that have slack
  VectorX limit_force, limit_row, f_z_of_springs;       // force limits: f₀, Qᵀe, and f_z without bounds
  RigidTransform X_WR_before;
  VectorX rhs, solved, f_z, g, tau, momentum;
  Matrix6X F;
  VectorX inertial_force;  // n: J(x)ᵀ (p̂ - p)/b of a stage and dampers, where the model has a complement
  VectorX control_change;  // controls at the end of the step less those at its start, for load columns
  Matrix6X wrenches_R;  // 6 x bodies or empty: applied forces at the end of the step, for load columns
  // n or empty: joint forces of stops, dry frictions and saturated servos in the last stage, for load columns
  VectorX reactions;
  Vector6 base_force;
  VectorX impulse;  // num_velocities: of contact and limits in this step

  VectorX contact_shift;  // num_velocities: less the velocity that a stage is linearised at
  VectorX nu_mixed;       // n: joint velocities that the momentum of the armature is taken of
  MaterialVelocities other_velocity;
  Cholesky inertia_factor;
  VectorX q_dot_start;     // n
  VectorX w_mean, f_used;  // r
  Matrix6X F_parts;
  Matrix3X part_impulses;      // 3 x k, N s: p̂ - p of the rigid parts in a stage, in R
  Vector3 center_W, linear_W;  // of a floating mechanism at the start: centre of mass [m], momentum [N·s]

  // Of its stages.
  StageBase step_start, stage_base, stage_end;
  BasePath base_path;  // of a driven base
  Vector3 drift_W = Vector3::Zero();       // m/s, velocity of the point that momenta are taken about
  double stage_length = 0;                 // s
  double stage_time = 0;  // s, from the start of the step to the pose that a stage is linearized at
  // Where a stage starts (stage_start.cpp); the twist of a driven base in the stage, in R there.
  VectorX z_stage_start;  // r
  VectorX x_stage_start;  // num_velocities
  RigidTransform X_stage_start;
  Vector3 center_stage_start = Vector3::Zero();  // m, centre of mass of a floating mechanism
  double time_stage_start = 0;                   // s
  Vector6 V_R_stage = Vector6::Zero();
  VectorX x_start, x_first;                // num_velocities: at the start of the step, of its first stage
  Vector3 linear_first_W = Vector3::Zero();            // N s, of a floating mechanism after its first stage
  Vector3 stage_center_W = Vector3::Zero();  // m, centre of mass of what floats at the end of the stage
  Vector3 stage_linear_W = Vector3::Zero();            // N s, at the end of the stage
  VectorX stage_correction;                            // num_velocities
  MatrixX A_before;  // num_velocities²: A but for stiffness of the pose at hand
  // A and its factor: length of the stages that they are of [s], 0 for none, and saturation.
  double matrix_b = 0;
  bool matrix_is_definite = false;
  bool matrix_is_inertial = false;  // with AddInertialStiffness()
  std::vector<signed char> matrix_at_bound, matrix_slack_sides;
  VectorX control_jump;  // one of controls at a time (control_jump.cpp)
  // Of loads (applied_forces.cpp).
  MatrixX K_loads;                    // num_velocities², lower triangle
  Matrix3X carried_force;             // 3 x joints, N: on all that a joint carries, in R
  Matrix3X carried_moments;           // 3 x 3 joints, N·m: Σ x Fᵀ likewise, about R's origin
  Matrix6X joint_twist;               // 6 x r, of one joint
  Matrix3X joint_turn, turned_lever;  // 3 x r
  // Of a point spring (point_spring.cpp).
  Matrix3X spring_J;                       // 3 x num_velocities, velocity of its point in R
  Vector3 spring_point_R, spring_force_R;  // m; N, without the damper
  Vector3 spring_base_velocity_R;          // m/s, of its point with a driven base
  // Of force limits and of slack springs at the end of the first stage.
  VectorX stage_limit_force, stage_slack_force;
  std::vector<signed char> stage_at_bound, stage_slack_side;
};

}  // namespace fork1s
