// The workspace of a state: sizes, the pose and what hangs on it, and inputs.
#include <algorithm>

#include "mechanism_detail.hpp"

namespace fork1s {

void StartAtReference(const MechanismModel& model, MechanismState& state) {
  state.mu.setZero(model.reduced->loop_rank());
  state.missing_time = 0;
  state.acceleration.setZero(model.num_velocities());
}

ReductionLoads LoadsOf(const MechanismOptions& options, const MechanismState& state,
                       const Matrix6X& wrenches_R, const VectorX& control_change) {
  return {state.reduced.X_WR.rotation().transpose() * options.gravity_W, ActivationsOf(state), wrenches_R,
          control_change};
}

// The workspace, that of another model so far.
void Renew(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const double closing_tolerance = ws.configuration.closing_tolerance;
  ws.configuration = Configuration(*model.reduced);
  ws.configuration.closing_tolerance = closing_tolerance;
  ws.jacobian = ReducedJacobian(*model.reduced);
  ws.mass.inertia = ReducedInertia(*model.reduced);
  Size(ctx);
}

void Restore(MechanismState& state, MechanismWorkspace& ws, const MechanismState& saved) {
  const bool same_model = saved.model == state.model;
  const auto before = state.step_model;
  state = saved;
  if (!state.step_model)
    state.step_model = same_model ? before : std::make_shared<const MechanismModel>(*before, state.model);
  const auto& model = state.step_model;
  const StepContext ctx{*model, state, ws};
  if (!same_model) Renew(ctx);
  ws.x.tail(model->size()) = state.reduced.w;
  if (model->base_size > 0) ws.x.head<6>() = state.reduced.V_R;
  ws.configuration.mu = state.mu;
  RestoreExpansion(ctx);
  // What the last step left for a new reference is of another state.
  ws.missing.reactions.setZero();
  ws.missing.wrenches_R.setZero();
  ws.missing.control_change.setZero();
  UpdateConfiguration(ctx, true);
}

// Scratch of the sizes of the model.
void Size(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  const int r = model.size(), n = model.reduced->num_coordinates(), nx = model.num_velocities();
  ws.matrix.A.resize(nx, nx);
  ws.matrix.A_before.resize(nx, nx);
  ws.mass.M.resize(nx, nx);
  if (model.base_size > 0) {
    ws.mass.M.topLeftCorner<6, 6>() = model.reduced->M_00;
    ws.mass.M.topRightCorner(6, r) = model.reduced->M_0z;
    ws.mass.M.bottomLeftCorner(r, 6) = model.reduced->M_0z.transpose();
  }
  ws.mass.M.bottomRightCorner(r, r) = model.reduced->M;
  ReducedInertia::ClearApart(ws.jacobian, ws.mass.M.bottomRightCorner(r, r));
  ws.matrix.factor = Cholesky();
  ws.matrix.factor.Compute(MatrixX::Identity(std::max(nx, 1), std::max(nx, 1)));
  ws.x.resize(nx);
  if (model.base_size > 0) ws.x.head<6>() = state.reduced.V_R;
  ws.x.tail(r) = state.reduced.w;
  ws.expansion.pose.scratch.resize(r, r);
  ws.scratch.rhs.resize(nx);
  ws.scratch.solved.resize(nx);
  ws.momentum_change.all.resize(nx);
  ws.forces.f_z.resize(r);
  ws.forces.g.resize(n);
  ws.forces.tau.resize(n);
  ws.scratch.jump.control.resize(state.controls.size());
  ws.scratch.activation.resize(state.activation.size());
  ws.forces.F.resize(6, m.num_bodies());
  ws.loads.K.resize(nx, nx);
  ws.point_spring.J.resize(3, nx);
  ws.loads.carried_force.resize(3, m.num_joints());
  ws.loads.carried_moments.resize(3, 3 * m.num_joints());
  ws.loads.joint_twist.resize(6, r);
  std::size_t parts = 0;
  for (const Mechanism::Path& path : model.mechanism().paths())
    parts = std::max(parts, 2 * path.elements.size());
  ws.loads.path_forces.reserve(model.mechanism().paths().size());
  ws.loads.straight_parts.reserve(parts);
  ws.loads.joint_turn.resize(3, r);
  ws.loads.turned_lever.resize(3, r);
  ws.mass.M_00 = model.reduced->M_00;
  ws.mass.M_0z = model.reduced->M_0z;
  ws.velocities.q_dot.setZero(n);
  SizeForceLimits(ctx);
  DivideIntoParts(ctx);
  ws.stage.v_k.setZero(nx);
  if (ws.start.q_dot.size() != n) ws.start.q_dot.setZero(n);  // a new reference keeps it for ClosureForces
  ws.velocities.joint.setZero(n);
  for (VectorX* v : {&ws.velocities.w, &ws.active_set.way, &ws.momentum_change.reduced,
                     &ws.driven.velocity_jump, &ws.scratch.jump.force, &ws.scratch.jump.damper_force})
    v->setZero(r);
  for (VectorX* v : {&ws.momentum_change.joint, &ws.scratch.jump.tau, &ws.missing.load, &ws.missing.inertia})
    v->setZero(n);
  ws.momentum_change.parts.resize(6, model.rigid_parts.size());
  ws.momentum_change.part_impulses.setZero(3, model.rigid_parts.size());
  FindSlackSprings(ctx);
}

// M of the present pose, by its Jacobians: O(joints x coordinates that reach them).
void UpdateMassMatrix(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use) return ComputeExpandedMass(ctx);
  const int r = model.size();
  ws.mass.inertia.Compute(*model.reduced, model.rigid_parts, ws.configuration, ws.jacobian,
                          ws.mass.M.bottomRightCorner(r, r), ws.mass.M_0z, ws.mass.M_00);
  if (model.base_size > 0) {
    ws.mass.M.topLeftCorner<6, 6>() = ws.mass.M_00;
    ws.mass.M.topRightCorner(6, r) = ws.mass.M_0z;
    ws.mass.M.bottomLeftCorner(r, 6) = ws.mass.M_0z.transpose();
  }
}

void UpdatePose(const StepContext& ctx, bool loops_are_closed) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use) return MoveExpanded(ctx);
  if (loops_are_closed)
    ConfigureClosed(*model.reduced, state.reduced, ws.configuration);
  else
    Configure(*model.reduced, state.reduced, ws.configuration);
  ws.jacobian.Compute(*model.reduced, ws.configuration);
}

void UpdateConfiguration(const StepContext& ctx, bool loops_are_closed) {
  UpdatePose(ctx, loops_are_closed);
  UpdateMassMatrix(ctx);
}

void SetInputsWithin(const StepContext& ctx, const MechanismState& start, double share) {
  MechanismState& state = ctx.state;
  state.loads = start.loads;
  state.has_loads = start.has_loads;
  state.point_spring = start.point_spring.Within(0, share);
  state.point_spring_body = start.point_spring_body;
  state.driven_next = start.driven_next;
  state.controls = start.controls;
  if (share >= 1) return;
  const RigidTransform& X = start.reduced.X_WR;
  state.driven_next = X * Exp(share * Log(X.inverse() * start.driven_next));
  if (start.controls_move)
    state.controls = start.controls_from + share * (start.controls - start.controls_from);
}

BasePath PathOfBase(const MechanismState& state, double h) {
  const Vector6 rate_W = InAxes(state.reduced.X_WR.rotation(), state.reduced.V_R);
  return ComputeBasePath(state.reduced.X_WR, rate_W, state.driven_next,
                         state.knows_driven_rate ? std::optional(state.driven_rate) : std::nullopt,
                         state.base_history, h);
}

void StoreBaseHistory(const StepContext& ctx, const MechanismState& start, double h) {
  if (ctx.model.mechanism().base() != BaseKind::kDriven) return;
  ctx.state.base_history = PathOfBase(start, h).History(start.base_history);
}

void SetInputsOfPart(const StepContext& ctx, const MechanismState& start, double h, double share_start,
                     double share_end) {
  MechanismState& state = ctx.state;
  SetInputsWithin(ctx, start, share_end);
  if (ctx.model.mechanism().base() == BaseKind::kDriven) {
    const BasePath path = PathOfBase(start, h);
    state.driven_next = path.PoseAt(share_end);
    state.driven_rate = path.RateAt(share_end);
    state.knows_driven_rate = true;
  }
  state.point_spring = start.point_spring.Within(share_start, share_end);
  state.controls_move = start.controls_move;
  state.controls_from = start.controls_from;
  if (share_start == 0) return;
  // Controls that are held jump at the start.
  if (start.controls_move)
    state.controls_from += share_start * (start.controls - start.controls_from);
  else
    state.controls_from = start.controls;
}

RigidTransform GroupPose(const ConstStepContext& ctx, int g) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use) return state.reduced.X_WR * ws.expansion.pose.X_RG[static_cast<std::size_t>(g)];
  return BodyPose(ctx, model.groups[static_cast<std::size_t>(g)].body);
}

RigidTransform BodyPose(const ConstStepContext& ctx, BodyIndex b) {
  return ctx.state.reduced.X_WR * ConfigurationOf(ctx).kinematics.X_RB[b.u()];
}

void BodyPoses(const ConstStepContext& ctx, std::vector<RigidTransform>& X_RB) {
  X_RB = ConfigurationOf(ctx).kinematics.X_RB;
}

namespace {

// Of a twist in R about R's origin, in world axes about the origin of X_WB.
Vector6 InWorldAt(const RigidTransform& X_WR, const Vector6& V_R, const RigidTransform& X_WB) {
  const Vector6 V_W = AdjointApply(X_WR, V_R);
  Vector6 out;
  out << V_W.head<3>(), V_W.tail<3>() + V_W.head<3>().cross(X_WB.translation());
  return out;
}

}  // namespace

Vector6 BodyVelocity(const ConstStepContext& ctx, BodyIndex b) {
  const auto& [model, state, ws] = ctx;
  Vector6 V = state.reduced.V_R;
  if (const int j = model.mechanism().body(b).last_joint; ws.expansion.in_use) {
    const Configuration& c = ConfigurationOf(ctx);
    V += BodyJacobian(model.mechanism(), c.kinematics, b) * (c.Q_now * state.reduced.w);
  } else if (j >= 0) {
    const auto T = ws.jacobian.T(j);
    for (int k = 0; k < T.cols(); ++k) V += state.reduced.w(ws.jacobian.begin(j) + k) * T.col(k);
  }
  return InWorldAt(state.reduced.X_WR, V, BodyPose(ctx, b));
}

Vector6 GroupVelocity(const ConstStepContext& ctx, int g) {
  const auto& [model, state, ws] = ctx;
  const auto at = static_cast<std::size_t>(g);
  if (!ws.expansion.in_use) return BodyVelocity(ctx, model.groups[at].body);
  return InWorldAt(state.reduced.X_WR, ws.expansion.pose.J[at] * state.reduced.w, GroupPose(ctx, g));
}

const Configuration& ConfigurationOf(const ConstStepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use)
    ws.has_exact_pose.MakeOnce([&, &m = model, &s = state, &w = ws] {
      w.configuration.mu = s.mu;
      w.configuration.has_tangent_predictor = false;
      Configure(*m.reduced, s.reduced, w.configuration);
    });
  return ws.configuration;
}

bool IsFinite(const ConstStepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  // 0 times what is not finite is no number.
  const auto finite = [](const VectorX& x) { return (0 * x).sum() == 0; };
  return finite(ws.x) && finite(state.reduced.z) && finite(ws.q()) && state.reduced.X_WR.IsFinite();
}

bool PosesAreFinite(const ConstStepContext& ctx) {
  const auto& X =
      ctx.work.expansion.in_use ? ctx.work.expansion.pose.X_RG : ctx.work.configuration.kinematics.X_RB;
  return std::all_of(X.begin(), X.end(), [](const RigidTransform& of) { return of.IsFinite(); });
}

double LoopResidualNow(const ConstStepContext& ctx) {
  return ctx.work.expansion.in_use ? 0 : ctx.work.configuration.loop_residual;
}

double ClosureGapNow(const ConstStepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  if (model.mechanism().num_constraints() == 0) return 0;
  const Configuration& c = ConfigurationOf(ctx);
  return ClosureGap(model.mechanism(), c.kinematics, c.q);
}

}  // namespace fork1s
