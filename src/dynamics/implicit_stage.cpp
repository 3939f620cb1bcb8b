// One implicit stage of a mechanism.
//
// From base points x̂ (configuration) and p̂ (momentum) over a length b,
//     M(x) v - J(x)ᵀ p̂ = b f(x, v) + J_cᵀ λ,   x = x̂ ⊕ b v                                        (1)
// v = [ξ; w] are base twist and reduced rates, J(x)ᵀ p̂ the spatial momenta of the rigid parts as the joints of the pose
// x feel them, λ the impulses of contact and limits. Newton's method linearises at a pose xₖ = x̂ ⊕ b vₖ,
//     A v = J(xₖ)ᵀ p̂ + b f(xₖ) + b² K vₖ + J_cᵀ λ,   A = M + b D + b² K                             (2)
// and its first pose takes vₖ from the start of the step, in the second stage from the line through start and first
// stage. The derivative of M v - Jᵀp̂ with the pose is left out: it is b times the momentum that the stage changes, so
// that the iteration contracts by O(b²) per iteration.
//
// Two stages with b = γ h, γ = 1 - 1/√2, make Alexander's SDIRK2 (SIAM J. Numer. Anal. 14, 1977), of second order
// and L-stable: the second starts from
//     x̂ = x₀ + s (x₁ - x₀),   p̂ = p₀ + s (p₁ - p₀),   s = (1 - γ)/γ                               (3)
// Momenta are taken about a point that moves evenly with the base, in axes that stand still: a flat space, in which the
// momentum of the whole is exact, linear and angular, and a drift of the whole changes nothing.
//
// A driven base follows a path with a rate that is linear in time and continuous from step to step (base_path.hpp).
// A stage takes the rate at its end. As everything else does, the base moves by that rate from the base point of the
// stage, so that what rests on it keeps its gap: its first pose is off by O(h²), the last is that of the input. Where
// the rate jumps, the joints feel an impulse at the start of the step: M (w' - w) = M_0zᵀ (V_last - V).
#include <algorithm>
#include <cmath>
#include <fork1s/linalg/row_squares.hpp>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

Vector3 CenterOfMass(const Matrix6& M_00) { return Vector3(M_00(2, 4), M_00(0, 5), M_00(1, 3)) / M_00(5, 5); }

const RigidTransform kIdentity;

// Centre of mass of a part in R.
Vector3 CenterOfPart(const MechanismStep& here, int part) {
  const auto at = static_cast<std::size_t>(part);
  const RigidTransform& X = part == 0 ? kIdentity : here.work.configuration.kinematics.P[at - 1];
  return X * here.model.rigid_parts.parts[at].inertia_R0.center;
}

// The point that momenta are taken about, from R's origin, in R [m], and the rotation from R to the axes at the start.
struct MomentumFrame {
  Vector3 point, drift;
  Matrix3 R_start_now;
};
MomentumFrame FrameOf(const MechanismStep& here, double time) {
  const auto& [model, state, ws] = here;
  const Matrix3 R_T = state.reduced.X_WR.rotation().transpose();
  return {R_T * (ws.X_WR_before.translation() + time * ws.drift_W - state.reduced.X_WR.translation()),
          R_T * ws.drift_W, ws.X_WR_before.rotation().transpose() * state.reduced.X_WR.rotation()};
}

// Spatial momenta of the parts at velocity x [num_velocities], in the flat space of the step.
void ComputeFlatMomenta(const MechanismStep& here, double time, StageBase& out) {
  const auto& [model, state, ws] = here;
  ws.q_ddot.setZero();
  if (model.size() > 0) {
    ws.w_mean = ws.x.tail(model.size());
    AddMotion(*model.reduced, ws.Q_now(), ws.w_mean, ws.q_ddot);
  }
  Vector6 V = Vector6::Zero();
  if (model.base_size > 0) V = ws.x.head<6>();
  if (model.mechanism().base() == BaseKind::kDriven) V = state.reduced.V_R;
  ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.q_ddot, V,
                            ws.other_velocity);
  out.momentum.setZero(6, model.rigid_parts.size());
  AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.other_velocity, Matrix3::Identity(), 1,
              out.momentum);
  ComputeJointVelocities(model.mechanism(), ws.configuration.kinematics, ws.q_ddot, ws.nu_mixed);
  out.joint_momentum = model.mechanism().armature().cwiseProduct(ws.nu_mixed);
  if (!model.base_moves()) return;
  const MomentumFrame frame = FrameOf(here, time);
  for (int i = 0; i < model.rigid_parts.size(); ++i) {
    const double mass = model.rigid_parts.parts[static_cast<std::size_t>(i)].inertia_R0.mass;
    if (mass == 0) continue;
    auto p = out.momentum.col(i);
    const Vector3 linear = p.tail<3>() - mass * frame.drift;
    const Vector3 angular = p.head<3>() - CenterOfPart(here, i).cross(mass * frame.drift) - frame.point.cross(linear);
    p << frame.R_start_now * angular, frame.R_start_now * linear;
  }
}

// F_parts <- momenta of `base` as wrenches in R about R's origin at the pose at hand.
void ExpressMomenta(const MechanismStep& here, double time, const StageBase& base) {
  const auto& [model, state, ws] = here;
  ws.F_parts = base.momentum;
  if (!model.base_moves()) return;
  const MomentumFrame frame = FrameOf(here, time);
  const Matrix3 R_now_start = frame.R_start_now.transpose();
  for (int i = 0; i < model.rigid_parts.size(); ++i) {
    const double mass = model.rigid_parts.parts[static_cast<std::size_t>(i)].inertia_R0.mass;
    if (mass == 0) continue;
    auto p = ws.F_parts.col(i);
    const Vector3 linear = R_now_start * p.tail<3>();
    const Vector3 angular = R_now_start * p.head<3>() + frame.point.cross(linear) +
                            CenterOfPart(here, i).cross(mass * frame.drift);
    p << angular, linear + mass * frame.drift;
  }
}

// momentum <- J(x)ᵀ p of `base` at the pose at hand; joints of a driven base feel what its own motion leaves.
void ProjectMomentum(const MechanismStep& here, double time, const StageBase& base) {
  const auto& [model, state, ws] = here;
  ExpressMomenta(here, time, base);
  if (model.mechanism().base() == BaseKind::kDriven) {
    ws.q_ddot.setZero();
    ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.q_ddot,
                              state.reduced.V_R, ws.other_velocity);
    AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.other_velocity, Matrix3::Identity(), -1,
                ws.F_parts);
  }
  ws.tau = base.joint_momentum;
  ConvertToCoordinateForces(model.mechanism(), ws.configuration.kinematics, ws.tau);
  GatherFromParts(model.mechanism(), ws.configuration.kinematics.S, ws.F_parts, ws.tau);
  if (model.size() > 0) {
    ReduceForce(*model.reduced, ws.Q_now(), ws.tau, ws.f_used);
    ws.momentum.tail(model.size()) = ws.f_used;
  }
  if (model.base_size > 0) ws.momentum.head<6>() = ws.F_parts.col(0);
}

// What joint springs are stiff by at the pose beyond K_r, where loops turn Q; adds b² times it to A.
void AddTurnedJointStiffness(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  if (model.reduced->loop_rank() == 0) return;
  for (const WeightedRows& rows : model.joint_springs) {
    AddRowSquares(ws.Q_now(), rows, b * b, ws.A.bottomRightCorner(model.size(), model.size()));
    AddRowSquares(model.reduced->Q_rows, rows, -b * b, ws.A.bottomRightCorner(model.size(), model.size()));
  }
}

// Twist in R of a base that stands at X.
Vector6 BaseTwist(const BasePath& path, double share, const RigidTransform& X) {
  const Vector6 rate = path.RateAt(share);
  const Matrix3 R_T = X.rotation().transpose();
  Vector6 V;
  V << R_T * rate.head<3>(), R_T * rate.tail<3>();
  return V;
}

// Of a floating mechanism, from momenta about the drifting point, world axes [N s].
Vector3 LinearMomentum(const MechanismStep& here, const StageBase& of) {
  const auto& [model, state, ws] = here;
  if (model.base_size == 0) return Vector3::Zero();
  return ws.X_WR_before.rotation() * of.momentum.bottomRows<3>().rowwise().sum() + ws.M_00(5, 5) * ws.drift_W;
}

// Of weight and of forces from outside, but for contact, world axes [N].
Vector3 AppliedForce(const MechanismStep& here) {
  Vector3 force_W = here.model.mechanism().weighed_mass() * here.work.gravity_W;
  if (here.state.has_loads)
    for (const AppliedForces& load : here.state.loads) force_W += load.force_W;
  return force_W;
}

// Velocity of the base in x with which the whole has this linear momentum, world axes [N s], at the pose at
// hand. Were the predicted centre of mass beside the parabola, the weight would turn the whole.
void SetLinearMomentum(const MechanismStep& here, const Vector3& linear_W) {
  const auto& [model, state, ws] = here;
  if (model.base_size == 0) return;
  ws.x.segment<3>(3) +=
      (state.reduced.X_WR.rotation().transpose() * linear_W - ws.M_full.middleRows<3>(3) * ws.x) /
      ws.M_00(5, 5);
}

// Pose and twist of a driven base in the stage that ends at `time`.
void MoveDrivenBase(const MechanismStep& here, double time) {
  const auto& [model, state, ws] = here;
  const BasePath& path = ws.base_path;
  const double share = time / path.h;
  if (share < 1) {
    const Vector6 moved = time * path.RateAt(share);
    state.reduced.X_WR = {Matrix3(ExpRotation(moved.head<3>()) * path.X_start.rotation()),
                          Vector3(path.X_start.translation() + moved.tail<3>())};
  } else {
    state.reduced.X_WR = path.X_end;
  }
  state.reduced.V_R = BaseTwist(path, share, state.reduced.X_WR);
}

// Momentum and forces of the stage at the pose that the velocity x has led to.
void EvaluateStage(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.contact_shift = -ws.x;
  ProjectMomentum(here, ws.stage_time, ws.stage_base);
  LoadForces(here, state.reduced.X_WR.rotation().transpose() * ws.gravity_W);
  if (model.size() > 0) ReduceForce(*model.reduced, ws.Q_now(), ws.g, ws.f_z);
  if (state.point_spring.IsActive()) EvaluatePointSpring(here);
  if (HasSwitches(here)) OpenSwitches(here);
}

}  // namespace

void BeginTwoStageStep(const MechanismStep& here, double h, double b, const Vector3& gravity_W) {
  const auto& [model, state, ws] = here;
  FORK1S_REQUIRE(!model.by_twists());
  const int r = model.size();
  ws.rule = StepRule::kStage;
  ws.order = 1;
  ws.touches = ws.first_order = ws.matches = false;
  ws.minimum_found = true;
  ws.newton_steps = 0;
  ws.gravity_W = gravity_W;
  ws.X_WR_before = state.reduced.X_WR;
  ws.V_R_before = state.reduced.V_R;
  SeeStart(here, h, StepRule::kEuler);
  if (model.reduced->has_complement) {
    LoadForces(here, state.reduced.X_WR.rotation().transpose() * gravity_W);
    FollowLoads(here);
    if (state.interior.offset.size() > 0)
      state.interior.offset *= std::exp(-h / model.options.complement_relaxation);
  }
  ws.drift_W.setZero();
  if (model.base_size > 0) ws.drift_W = ws.linear_W / ws.M_00(5, 5);
  if (model.mechanism().base() == BaseKind::kDriven) {
    ws.base_path = PathOfBase(state, h);
    ws.drift_W = ws.base_path.MeanRate().tail<3>();
    if (ws.base_path.jumps) state.reduced.V_R = BaseTwist(ws.base_path, 0, state.reduced.X_WR);
    if (ws.base_path.jumps && r > 0) {
      ws.f_used.noalias() = ws.M_0z.transpose() * (ws.V_R_before - state.reduced.V_R);
      SolveOrFail(ws.inertia_factor, ws.M_full, ws.f_used);
      ws.x += ws.f_used;
    }
  }
  StageBase& start = ws.step_start;
  start.z = state.reduced.z;
  start.R_WR = state.reduced.X_WR.rotation();
  start.center_W = ws.center_W;
  ComputeFlatMomenta(here, 0, start);
  ws.stage_base = start;
  ws.x_start = ws.x;
  ws.x += b * state.acceleration;
  if (model.base_size > 0)
    SetLinearMomentum(
        here, ws.linear_W + b * (AppliedForce(here) + ws.M_00(5, 5) * state.acceleration.segment<3>(3)));
}

void MoveToStagePose(const MechanismStep& here, double b, double time) {
  const auto& [model, state, ws] = here;
  const StageBase& base = ws.stage_base;
  const int r = model.size();
  ws.stage_time = time;
  state.reduced.z = base.z;
  if (r > 0) state.reduced.z += b * ws.x.tail(r);
  if (model.mechanism().base() == BaseKind::kDriven) MoveDrivenBase(here, time);
  Vector3 center_W = Vector3::Zero();
  if (model.base_size > 0) {
    const Vector3 linear = ws.M_full.middleRows<3>(3) * ws.x;
    Matrix3& R_WR = state.reduced.X_WR.rotation();
    center_W = base.center_W + b / ws.M_00(5, 5) * (R_WR * linear);
    const Vector3 velocity_W = R_WR * ws.x.segment<3>(3);
    R_WR = base.R_WR * ExpRotation(b * ws.x.head<3>());
    state.reduced.X_WR.Orthonormalize();
    // The same velocity in the axes of the pose found: a turn by δ would change one of V by V δ.
    ws.x.segment<3>(3) = R_WR.transpose() * velocity_W;
  }
  UpdateConfiguration(here);
  if (model.base_size > 0)
    state.reduced.X_WR.translation() =
        center_W -
        state.reduced.X_WR.rotation() * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
}

// (2) without contact: A and right side at the pose at hand, which the velocity x has led to.
void AssembleStage(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  ws.A = ws.M_full;
  ws.stage_rhs = ws.momentum;
  if (model.base_size > 0) ws.stage_rhs.head<6>() += b * ws.base_force;
  if (state.has_loads || state.point_spring.IsActive()) {
    ComputeLoadStiffness(here);
    ws.A.triangularView<Eigen::Lower>() += b * b * ws.K_loads;
    ws.stage_rhs.noalias() -= b * b * ws.K_loads.selfadjointView<Eigen::Lower>() * ws.contact_shift;
  }
  if (state.point_spring.IsActive()) AddPointSpringOperator(here, b);
  if (r == 0) return;
  auto A_z = ws.A.bottomRightCorner(r, r);
  ws.w_mean = -ws.contact_shift.tail(r);
  const VectorX& v = ws.w_mean;  // that leads from the base point to the pose at hand
  auto rhs = ws.stage_rhs.tail(r);
  rhs += b * ws.f_z;
  A_z += b * model.reduced->D;
  if (DampersTurn(model) || model.has_bent_springs) AddDampersBeyond(here, b, true, v, A_z);
  // A minus its damping and inertia is b² K, which acts on the whole way from the base point.
  rhs.noalias() -= A_z.selfadjointView<Eigen::Lower>() * v;
  A_z.diagonal() += b * b * model.reduced->K_r;
  AddTurnedJointStiffness(here, b);
  AddNonlinearStiffness(here, b * b);
  TurnServos(here, b);
  rhs.noalias() += A_z.selfadjointView<Eigen::Lower>() * v;
  AddBackBoundedSprings(here, b, 0, ws.contact_shift.tail(r), rhs);
  TakeBoundedSpringsOut(here, b);
}

void SolveFreeStage(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  ws.all_at_end = true;
  if (HasSwitches(here)) AddSwitchedForces(here);
  if (model.num_velocities() == 0) return;
  ws.impulse.setZero(model.num_velocities());
  AssembleStage(here, b);
  ws.x = ws.stage_rhs;
  SolveOrFail(ws.factor, ws.A, ws.x);
}

void PredictStage(const MechanismStep& here, double b) {
  const auto& [model, state, ws] = here;
  ws.pushed = false;
  EvaluateStage(here);
  SolveFreeStage(here, b);
}

double MoveAndComputeResidual(const MechanismStep& here, double b, double time, double& motion) {
  const auto& [model, state, ws] = here;
  motion = 0;
  ComputeFlatMomenta(here, time, ws.stage_end);
  MoveToStagePose(here, b, time);
  if (model.num_velocities() == 0) return 0;
  ws.stage_impulse = ws.impulse;
  EvaluateStage(here);
  if (HasSwitches(here)) AddSwitchedForces(here);
  AssembleStage(here, b);
  ws.stage_correction = ws.stage_rhs + ws.stage_impulse;
  ws.stage_correction.noalias() -= ws.A.selfadjointView<Eigen::Lower>() * ws.x;
  const double mass = std::max(model.mechanism().total_mass(), 1e-300);
  ws.rhs = ws.stage_correction;
  ws.factor.SolveInPlace(ws.rhs);
  // Beside the drift of the base: what moves along with something is solved as well as what rests.
  ws.solved.noalias() = ws.M_full * ws.x;
  double twice_energy = ws.x.dot(ws.solved);
  if (model.base_size > 0) twice_energy -= ws.solved.segment<3>(3).squaredNorm() / ws.M_00(5, 5);
  motion = b * RootOf(twice_energy / mass);
  return b * RootOf(ws.stage_correction.dot(ws.rhs) / mass);
}

void ExtrapolateStage(const MechanismStep& here, double b, double onward) {
  const auto& [model, state, ws] = here;
  const StageBase& start = ws.step_start;
  StageBase& base = ws.stage_base;
  base.z = start.z + onward * (state.reduced.z - start.z);
  base.momentum = start.momentum + onward * (ws.stage_end.momentum - start.momentum);
  base.joint_momentum = start.joint_momentum + onward * (ws.stage_end.joint_momentum - start.joint_momentum);
  if (model.base_size > 0) {
    base.R_WR = start.R_WR * ExpRotation(onward * b * ws.x.head<3>());
    const Vector3 center_W = state.reduced.X_WR * CenterOfMass(ws.M_00);
    base.center_W = start.center_W + onward * (center_W - start.center_W);
  }
  // The second stage is linearised first by the velocity on the line through the start and the first stage.
  ws.x_first = ws.x;
  ws.linear_first_W = LinearMomentum(here, ws.stage_end);
  ws.x = ws.x_start + (1 + onward) * (ws.x_first - ws.x_start);
  SetLinearMomentum(here, ws.linear_W + (1 + onward) * (ws.linear_first_W - ws.linear_W));
}

void EndTwoStageStep(const MechanismStep& here, double between_stages) {
  const auto& [model, state, ws] = here;
  state.acceleration.setZero();
  if (between_stages > 0) {
    state.acceleration = (ws.x - ws.x_first) / between_stages;
    if (model.base_size > 0)
      state.acceleration.segment<3>(3) =
          ((LinearMomentum(here, ws.stage_end) - ws.linear_first_W) / between_stages - AppliedForce(here)) /
          ws.M_00(5, 5);
  }
  if (model.base_size > 0) {
    // The momentum of the whole is exact; seen from the pose found, it gives the velocity.
    ProjectMomentum(here, ws.stage_time, ws.stage_end);
    ws.x = ws.momentum;
    SolveOrFail(ws.inertia_factor, ws.M_full, ws.x);
    state.reduced.V_R = ws.x.head<6>();
  }
  state.reduced.w = ws.x.tail(model.size());
  ws.q_dot = ws.q_dot_start;  // ClosureForces takes the rate of joint rates from it
  ws.contact_shift.setZero();
  ws.rule = StepRule::kEuler;
  state.past.h = 0;
  state.mu = ws.configuration.mu;
  ForgetInputs(here);
}

}  // namespace fork1s
