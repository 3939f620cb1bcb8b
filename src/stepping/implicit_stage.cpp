// One implicit stage of a mechanism.
//
// From base points x̂ (configuration) and p̂ (momentum) over a length b,
//     M(x) v - J(x)ᵀ p̂ = b f(x, v) + J_cᵀ λ,   x = x̂ ⊕ b v                                        (1)
// v = [ξ; w] are base twist and reduced rates, J(x)ᵀ p̂ the spatial momenta of the rigid parts as the joints
// of the pose x feel them, λ the impulses of contact and limits. Simplified Newton iteration (Hairer & Wanner
// II, IV.8) evaluates the residual at a pose xₖ = x̂ ⊕ b vₖ, where no matrix is needed,
//     A (v - vₖ) = J(xₖ)ᵀ (p̂ - p(vₖ, xₖ)) + b f(xₖ, vₖ) + J_cᵀ λ,   A = M + b D + b² K                 (2)
// with the inertia M of the start of the step and D, K of its first pose, for both stages and all iterations.
// A is renewed where saturation changes or the iteration contracts slowly. The first pose takes vₖ = v + b a,
// a from the last step, in the second stage from the line through start and first stage.
//
// Two stages with b = γ h, γ = 1 - 1/√2, make Alexander's SDIRK2 (SIAM J. Numer. Anal. 14, 1977), of second
// order and L-stable: the second starts from
//     x̂ = x₀ + s (x₁ - x₀),   p̂ = p₀ + s (p₁ - p₀),   s = (1 - γ)/γ                               (3)
//
// A driven base follows a path with a rate that is quadratic in time and continuous from step to step
// (base_path.hpp). A stage takes the rate at its end. As everything else does, the base moves by that rate
// from the base point of the stage, so that what rests on it keeps its gap: its first pose is off by O(h²),
// the last is that of the input. Steps and parts of backward Euler go by the mean rate: what sticks to the base moves by h
// times the rate of their end. Where the rate jumps, the joints feel an impulse at the start of the step: M
// (w' - w) = M_0zᵀ (V_last - V).
#include <algorithm>
#include <cmath>
#include <limits>

#include "mechanism_detail.hpp"
#include "stage_momentum.hpp"

namespace fork1s {
namespace {

// Twist in R of a base that stands at X.
Vector6 BaseTwist(const BasePath& path, double share, const RigidTransform& X) {
  return InAxes(X.rotation().transpose(), path.RateAt(share));
}

// Centre of mass in R of an inertia about R's origin.
Vector3 CenterOf(const Matrix6& M_00) { return Vector3(M_00(2, 4), M_00(0, 5), M_00(1, 3)) / M_00(5, 5); }

// Of weight and of forces from outside, but for contact, world axes [N].
Vector3 AppliedForce(const StepContext& ctx) {
  Vector3 force_W = ctx.model.mechanism().weighed_mass() * ctx.work.forces.gravity_W;
  if (ctx.state.has_loads)
    for (const AppliedForces& load : ctx.state.loads) force_W += load.force_W;
  return force_W;
}

}  // namespace

// Predicts the linear momentum of a floating mechanism at the end of the stage, world axes [N s]: its centre
// of mass moves by it, and the velocity of the base in x has it at the pose at hand. Were the centre beside
// the parabola, the weight would turn the whole.
void PredictLinearMomentum(const StepContext& ctx, double time, const Vector3& linear_W) {
  const auto& [model, state, ws] = ctx;
  if (model.base_size == 0) return;
  ws.floating.stage_linear_W = linear_W;
  ComputeFlatMomenta(ctx, time, ws.stage.end);
  ws.x.segment<3>(3) += state.reduced.X_WR.rotation().transpose() *
                        (linear_W - LinearMomentum(ctx, ws.stage.end)) / ws.mass.M_00(5, 5);
}

namespace {

// Pose and twist of a driven base in the stage that ends at `time`.
void MoveDrivenBase(const StepContext& ctx, double time) {
  const auto& [model, state, ws] = ctx;
  const BasePath& path = ws.driven.path;
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

}  // namespace

// Momenta and forces of the stage at the pose that the velocity x has led to.
void EvaluateStage(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  ws.stage.v_k = ws.x;
  ws.stage.length = b;
  ComputeMomentumResidual(ctx, ws.stage.time, ws.stage.base, ws.x, b);
  const Vector3 gravity_R = state.reduced.X_WR.rotation().transpose() * ws.forces.gravity_W;
  if (ws.expansion.in_use) {
    LoadExpandedForces(ctx, gravity_R);
  } else {
    if (model.reduced->has_complement) ws.missing.inertial_force = ws.momentum_change.joint / b;
    ComputeJointForces(ctx, gravity_R);
    if (model.size() > 0) ReduceForce(*model.reduced, ws.Q_now(), ws.forces.g, ws.forces.f_z);
  }
  if (state.point_spring.IsActive()) EvaluatePointSpring(ctx);
  if (HasComplementarity(ctx)) InitializeActiveSet(ctx);
}

void BeginStep(const StepContext& ctx, double h, double b, bool by_chord, const Vector3& gravity_W) {
  const auto& [model, state, ws] = ctx;
  const int r = model.size();
  ws.forces.gravity_W = gravity_W;
  ChooseEvaluator(ctx);
  ws.start.by_expansion = ws.expansion.in_use;
  if (model.expands) ws.start.M = ws.mass.M;
  ws.start.h = h;
  ws.start.X_WR = state.reduced.X_WR;
  ws.start.V_R = state.reduced.V_R;
  if (ws.expansion.in_use) {
    ComputeExpandedJointRates(ctx, state.reduced.w, ws.start.q_dot);
  } else {
    ws.start.q_dot.setZero();
    AddMotion(*model.reduced, ws.Q_now(), state.reduced.w, ws.start.q_dot);
  }
  if (model.base_size > 0) {
    const Vector6 p = ws.mass.M.topRows<6>() * ws.x;
    ws.floating.center_W = state.reduced.X_WR * CenterOf(ws.mass.M_00);
    ws.floating.linear_W = state.reduced.X_WR.rotation() * p.tail<3>();
  }
  ws.start.drift_W.setZero();
  if (model.base_size > 0) ws.start.drift_W = ws.floating.linear_W / ws.mass.M_00(5, 5);
  if (model.mechanism().base() == BaseKind::kDriven) {
    ws.driven.path = PathOfBase(state, h);
    if (by_chord) {
      ws.driven.path.slope_start = ws.driven.path.slope_end = ws.driven.path.MeanRate();
      ws.driven.path.jumps = false;
    }
    ws.start.drift_W = ws.driven.path.MeanRate().tail<3>();
    if (ws.driven.path.jumps) state.reduced.V_R = BaseTwist(ws.driven.path, 0, state.reduced.X_WR);
    if (ws.driven.path.jumps && r > 0) {
      ws.driven.velocity_jump.noalias() = ws.mass.M_0z.transpose() * (ws.start.V_R - state.reduced.V_R);
      SolveOrFail(ws.mass.factor, ws.mass.M, ws.driven.velocity_jump);
      ws.x += ws.driven.velocity_jump;
    }
  }
  StageBase& start = ws.start.base;
  start.z = state.reduced.z;
  start.R_WR = state.reduced.X_WR.rotation();
  start.center_W = ws.floating.center_W;
  ComputeFlatMomenta(ctx, 0, start);
  ws.stage.base = start;
  ws.start.x = ws.x;
  ws.x += b * state.acceleration;
  if (model.base_size > 0)
    PredictLinearMomentum(ctx, 0,
                          ws.floating.linear_W + b * (AppliedForce(ctx) +
                                                      ws.mass.M_00(5, 5) * state.acceleration.segment<3>(3)));
  ws.matrix.b = 0;
  ws.matrix.of_parts = GeometricStiffness::kNone;
}

namespace {

// Pose of x̂ ⊕ b v: with Q and Jacobians, or that of bodies alone.
void MovePose(const StepContext& ctx, double b, double time, bool with_derivatives) {
  const auto& [model, state, ws] = ctx;
  state.reduced.z = ws.stage.base.z;
  if (model.size() > 0) state.reduced.z += b * ws.x.tail(model.size());
  if (model.base_size > 0)
    ws.floating.stage_center_W = ws.stage.base.center_W + b / ws.mass.M_00(5, 5) * ws.floating.stage_linear_W;
  ws.stage.time = time;
  if (model.mechanism().base() == BaseKind::kDriven) MoveDrivenBase(ctx, time);
  if (model.base_size > 0) {
    Matrix3& R_WR = state.reduced.X_WR.rotation();
    const Vector3 velocity_W = R_WR * ws.x.segment<3>(3);
    R_WR = ws.stage.base.R_WR * ExpRotation(b * ws.x.head<3>());
    state.reduced.X_WR.Orthonormalize();
    // The same velocity in the axes of the pose found: a turn by δ would change one of V by V δ.
    ws.x.segment<3>(3) = R_WR.transpose() * velocity_W;
  }
  if (with_derivatives) {
    UpdatePose(ctx);
  } else if (ws.expansion.in_use) {
    MoveExpanded(ctx);
  } else {
    ConfigurePose(*model.reduced, state.reduced, ws.configuration);
  }
  if (model.base_size > 0)
    state.reduced.X_WR.translation() =
        ws.floating.stage_center_W -
        state.reduced.X_WR.rotation() * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
}

// Of the velocity found at the pose at hand: by these the stage ends.
void RecordStageMomenta(const StepContext& ctx, double b, double time) {
  const auto& [model, state, ws] = ctx;
  ComputeFlatMomenta(ctx, time, ws.stage.end);
  if (model.base_size == 0) return;
  Vector6 impulse = b * ws.forces.base + ws.stage.impulse.head<6>();
  if (HasForcesFromOutside(state)) {
    // As the velocity found has changed them.
    ws.scratch.rhs = ws.x - ws.stage.v_k;
    ws.scratch.solved.noalias() = ws.loads.K.selfadjointView<Eigen::Lower>() * ws.scratch.rhs;
    impulse -= b * b * ws.scratch.solved.head<6>();
    if (state.point_spring.IsActive())
      impulse -= state.point_spring.ImplicitMass(b) *
                 (ws.point_spring.J.leftCols<6>().transpose() * (ws.point_spring.J * ws.scratch.rhs));
  }
  ws.stage.end.momentum_defect =
      Total(ws.stage.base) + FlattenWrench(ctx, time, impulse) - ws.stage.end.momentum.rowwise().sum();
  ws.floating.linear_change_W = -ws.floating.stage_linear_W;
  ws.floating.stage_linear_W = LinearMomentum(ctx, ws.stage.end);
  ws.floating.linear_change_W += ws.floating.stage_linear_W;
}

}  // namespace

void MoveToStagePose(const StepContext& ctx, double b, double time) {
  MovePose(ctx, b, time, true);
  EvaluateStage(ctx, b);
}

void AcceptStage(const StepContext& ctx, double b, double time, bool with_derivatives) {
  RecordStageMomenta(ctx, b, time);
  MovePose(ctx, b, time, with_derivatives);
}

namespace {

// Residual of (1) without contact at the pose at hand.
void ComputeStageResidual(const StepContext& ctx, double b, VectorX& residual) {
  const auto& [model, state, ws] = ctx;
  if (HasComplementarity(ctx)) AddActiveSetForces(ctx);
  residual = ws.momentum_change.all;
  if (model.base_size > 0) residual.head<6>() += b * ws.forces.base;
  if (model.size() > 0) residual.tail(model.size()) += b * ws.forces.f_z;
  if (HasComplementarity(ctx)) AddBackSaturatedDampers(ctx, b, residual);
  if (ws.matrix.artificial_damping > 0 && model.size() > 0)
    residual.tail(model.size()) -=
        ws.matrix.artificial_damping *
        (ws.mass.M.bottomRightCorner(model.size(), model.size()) * ws.stage.v_k.tail(model.size()));
}

}  // namespace

void SolveFreeStage(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  if (model.num_velocities() == 0) {
    if (HasComplementarity(ctx)) AddActiveSetForces(ctx);
    return;
  }
  ws.stage.impulse.setZero(model.num_velocities());
  ComputeStageResidual(ctx, b, ws.x);
  UpdateStageMatrix(ctx, b);
  if (ws.matrix.is_definite)
    ws.matrix.factor.SolveInPlace(ws.x);
  else
    ws.x.setConstant(std::numeric_limits<double>::quiet_NaN());
  ws.x += ws.stage.v_k;
}

namespace {

// Displacement [m] by a velocity x [num_velocities] within b, in the kinetic metric.
double Displacement(const StepContext& ctx, double b, const VectorX& x) {
  MechanismWorkspace& ws = ctx.work;
  ws.scratch.solved.noalias() = ws.mass.M * x;
  return b * RootOfProduct(x, ws.scratch.solved) /
         std::sqrt(std::max(ctx.model.mechanism().total_mass(), 1e-300));
}

}  // namespace

StageChange ComputeStageChange(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  StageChange out;
  if (model.num_velocities() == 0) return out;
  ws.scratch.rhs = ws.x - ws.stage.v_k;
  out.change = Displacement(ctx, b, ws.scratch.rhs);
  out.square = ws.scratch.rhs.dot(ws.scratch.solved);
  if (ws.stage.change.size() == ws.x.size()) out.with_before = ws.stage.change.dot(ws.scratch.solved);
  ws.stage.change = ws.scratch.rhs;
  ws.scratch.rhs = ws.x - ws.start.x;
  out.velocity_change = Displacement(ctx, b, ws.scratch.rhs);
  // Beside the drift of the base: what moves along with something is solved as well as what rests.
  out.motion = Displacement(ctx, b, ws.x);
  if (model.base_size > 0)
    out.motion = RootOf(out.motion * out.motion - b * b * ws.scratch.solved.segment<3>(3).squaredNorm() /
                                                      (ws.mass.M_00(5, 5) * model.mechanism().total_mass()));
  return out;
}

double MoveAndComputeResidual(const StepContext& ctx, double b, double time) {
  const auto& [model, state, ws] = ctx;
  RecordStageMomenta(ctx, b, time);
  MoveToStagePose(ctx, b, time);
  if (model.num_velocities() == 0) return 0;
  ComputeStageResidual(ctx, b, ws.stage.residual);
  ws.stage.residual += ws.stage.impulse;
  ws.scratch.rhs = ws.stage.residual;
  ws.matrix.factor.SolveInPlace(ws.scratch.rhs);
  return b * RootOfProduct(ws.stage.residual, ws.scratch.rhs) /
         std::sqrt(std::max(model.mechanism().total_mass(), 1e-300));
}

void SetArtificialDamping(const StepContext& ctx, double ratio) {
  ctx.work.matrix.artificial_damping = ratio;
}

double JointDisplacement(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  const int r = model.size();
  ws.scratch.rhs = ws.x.tail(r);
  ws.scratch.solved.noalias() = ws.mass.M.bottomRightCorner(r, r) * ws.scratch.rhs;
  return b * RootOfProduct(ws.scratch.rhs, ws.scratch.solved) /
         std::sqrt(std::max(model.mechanism().total_mass(), 1e-300));
}

void ShortenStage(const StepContext& ctx, double share, StageChange& change) {
  ctx.work.x -= share * ctx.work.stage.change;
  ctx.work.stage.change *= 1 - share;
  change.change *= 1 - share;
  change.with_before *= 1 - share;
  change.square *= (1 - share) * (1 - share);
}

void RelaxStage(const StepContext& ctx, double b, double time, double share) {
  MechanismWorkspace& ws = ctx.work;
  if (ctx.model.num_velocities() > 0) ws.x -= share * ws.stage.change;
  ws.floating.stage_linear_W -= share * ws.floating.linear_change_W;
  MoveToStagePose(ctx, b, time);
}

void ExtrapolateStage(const StepContext& ctx, double b, double onward) {
  const auto& [model, state, ws] = ctx;
  const StageBase& start = ws.start.base;
  StageBase& base = ws.stage.base;
  base.z = start.z + onward * (state.reduced.z - start.z);
  base.momentum = start.momentum + onward * (ws.stage.end.momentum - start.momentum);
  base.momentum_defect = onward * ws.stage.end.momentum_defect;
  base.joint_momentum = start.joint_momentum + onward * (ws.stage.end.joint_momentum - start.joint_momentum);
  base.rates = start.rates + onward * (ws.stage.end.rates - start.rates);
  base.turned_rates = start.turned_rates + onward * (ws.stage.end.turned_rates - start.turned_rates);
  if (model.base_size > 0) {
    base.R_WR = start.R_WR * ExpRotation(onward * b * ws.x.head<3>());
    base.center_W = start.center_W + onward * (ws.floating.stage_center_W - start.center_W);
  }
  // The second stage is linearized first by the velocity on the line through the start and the first stage.
  ws.stage.x_first = ws.x;
  ws.floating.linear_first_W = LinearMomentum(ctx, ws.stage.end);
  ws.x = ws.start.x + (1 + onward) * (ws.stage.x_first - ws.start.x);
  PredictLinearMomentum(
      ctx, ws.stage.time,
      ws.floating.linear_W + (1 + onward) * (ws.floating.linear_first_W - ws.floating.linear_W));
}

void EndStep(const StepContext& ctx, double between_stages) {
  const auto& [model, state, ws] = ctx;
  state.acceleration.setZero();
  if (between_stages > 0) {
    state.acceleration = (ws.x - ws.stage.x_first) / between_stages;
    if (model.base_size > 0)
      state.acceleration.segment<3>(3) =
          ((LinearMomentum(ctx, ws.stage.end) - ws.floating.linear_first_W) / between_stages -
           AppliedForce(ctx)) /
          ws.mass.M_00(5, 5);
  }
  EndWithExpansion(ctx);
  UpdateMassMatrix(ctx);
  if (model.base_size > 0) {
    // The momentum of the whole is exact; seen from the pose found, it gives the velocity.
    ws.x.setZero();
    ComputeMomentumResidual(ctx, ws.stage.time, ws.stage.end, ws.x, 0);
    ws.x = ws.momentum_change.all;
    SolveOrFail(ws.mass.factor, ws.mass.M, ws.x);
    state.reduced.V_R = ws.x.head<6>();
  }
  state.reduced.w = ws.x.tail(model.size());
  ws.stage.v_k.setZero();
  if (state.expanded_at.size() == 0) state.mu = ws.configuration.mu;
  const bool has_columns = HasForcesFromOutside(state);
  ws.missing.wrenches_R.setZero(6, has_columns ? model.mechanism().num_bodies() : 0);
  if (has_columns) AddAppliedWrenches(ctx, ws.missing.wrenches_R);
  ClearOneShotInputs(ctx);
}

void SolveOrFail(Cholesky& factor, const MatrixX& A, VectorX& x) {
  if (factor.Compute(A))
    factor.SolveInPlace(x);
  else
    x.setConstant(std::numeric_limits<double>::quiet_NaN());
}

void ApplyImpulse(const StepContext& ctx, const VectorX& p) {
  const auto& [model, state, ws] = ctx;
  if (p.isZero(0)) return;
  ws.scratch.rhs = p;
  ws.matrix.factor.SolveInPlace(ws.scratch.rhs);
  ws.x += ws.scratch.rhs;
  ws.stage.impulse += p;
}

// What was meant for one step alone.
void ClearOneShotInputs(const StepContext& ctx) {
  MechanismState& state = ctx.state;
  state.controls_from = state.controls;
  state.controls_move = state.knows_driven_rate = false;
  ClearLoads(state);
}

}  // namespace fork1s
