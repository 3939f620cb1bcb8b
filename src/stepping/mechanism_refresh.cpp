// Moving the reference to the present pose.
#include <algorithm>
#include <cmath>

#include "linalg/cholesky.hpp"
#include "mechanism/periodic_rotation.hpp"
#include "mechanism_detail.hpp"
#include "reduction/reduce_again.hpp"

namespace fork1s {

namespace {

// q, which steps close to far below what is seen, closed to rounding, and its kinematics: by chords with the
// factor of this very pose, each of which squares what is open. False where that does not end, as where loops
// repeat each other but for the digits of a file.
bool CloseBySimplifiedNewton(const ReducedModel& model, const Configuration& at, VectorX& q,
                             Kinematics& kinematics) {
  const Mechanism& m = *model.mechanism;
  const bool all_rows = model.loop_rank() == m.num_constraints();
  VectorX c, d(model.loop_rank()), before;
  LoopFactor own;
  const LoopFactor* factor = &at.factor;
  if (model.curvature.exists()) {  // no step has factored A B
    VectorX A;
    model.loops.Fill(m, at.kinematics, at.q, A);
    own = LoopFactor(model.loops);
    own.Compute(model.loops, A, model.B);
    factor = &own;
  }
  q = at.q;
  kinematics = at.kinematics;
  for (int chords = 0;; ++chords) {
    if (ClosureGap(m, kinematics, q) < 1e-13 * m.length_scale()) return true;
    if (chords == 3) return false;
    ClosureResidual(m, kinematics, q, c);
    for (int k = 0; k < model.loop_rank(); ++k) d(k) = c(model.loops.row(k));
    factor->SolveInPlace(d);
    before = q;
    model.loops.SubtractTransposed(model.B, d, q);
    const double step = (q - before).cwiseAbs().maxCoeff();
    if (!std::isfinite(step)) return false;
    ComputeKinematics(m, q, kinematics);
    if (all_rows && step < 1e-15) return true;
  }
}

}  // namespace

namespace {

// Of coordinate i by `moved` [rad or m]; bounded in rad or lengths of the mechanism.
LinearizationDrift DriftOf(const Mechanism& m, DriftCause cause, int i, double moved, double bound) {
  const bool turns = m.Turns(i);
  return {cause, std::abs(moved) / (turns ? bound : bound * m.length_scale()), std::abs(moved), turns, i};
}

}  // namespace

// Poses drawn by twists age with every joint: the one twist of a wheel is that of all joints on its path.
LinearizationDrift ComputeLinearizationDrift(const ConstStepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const bool by_twists = model.options.recovery == Recovery::kTwist;
  LinearizationDrift largest;
  for (int i = 0; i < model.reduced->num_coordinates(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (!by_twists && (model.invariant[at] || model.whole[at])) continue;
    const double q = ws.expansion.in_use
                         ? ws.expansion.of->expansion.q(i) +
                               ws.expansion.of->expansion.Q.row(i).dot(ws.expansion.pose.delta)
                         : ws.configuration.q(i);
    const LinearizationDrift drift = DriftOf(model.mechanism(), DriftCause::kTurnedJoint, i,
                                             q - model.reduced->q_ref(i), model.options.refresh_angle);
    if (drift.share > largest.share) largest = drift;
  }
  if (model.reduced->curvature.exists()) {
    const double gap = ClosureGapNow(ctx), share = gap / model.options.refresh_gap;
    if (share > largest.share) largest = {DriftCause::kLoopGap, share, gap, false, -1};
  }
  return largest;
}

namespace {

constexpr double kMaxMissing = 1e-3;  // rad, or lengths of the mechanism: errors of shape that nobody sees
constexpr double kMinSteps = 3;       // between two references: one costs about as much as three steps

}  // namespace

// A servo at its bound takes back what its spring has beyond it.
void RecordLoads(const StepContext& ctx, const MechanismState& start,
                 const std::vector<double>& limit_impulses, const std::vector<double>& friction_impulses) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  ws.missing.control_change = state.controls - start.controls_from;
  for (Eigen::Index k = 0; k < state.activation.size(); ++k)
    if (HasDynamics(state, k)) ws.missing.control_change(k) = state.activation(k) - start.activation(k);
  ws.missing.reactions.setZero(m.num_coordinates());
  AddStopForces(ctx, ws.stage.length, limit_impulses, friction_impulses, ws.missing.reactions);
  for (std::size_t k = 0; k < m.force_limits().size(); ++k) {
    const Mechanism::ForceLimit& limit = m.force_limits()[k];
    if (state.at_bound[k] == 0) continue;
    const double bound = state.at_bound[k] > 0 ? limit.upper : limit.lower;
    AddLengthForce(ctx, limit.length, bound - UnboundedForce(ctx, limit), ws.missing.reactions);
  }
}

namespace {

// Joint forces of the exact pose, and those of inertia, that a step by an expansion did not need.
void EvaluateExactForces(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Configuration& c = ConfigurationOf(ctx);
  ComputeJointForces(ctx, state.reduced.X_WR.rotation().transpose() * ws.forces.gravity_W);
  ws.missing.displacement = c.Q_now * state.acceleration;
  ApplyMass(model.mechanism(), c.kinematics, ws.missing.displacement, ws.missing.inertial_force);
  ws.missing.inertial_force *= -1;
}

}  // namespace

// With g the joint forces, reactions and contact forces of the pose and -ṗ those of inertia and dampers, d =
// C_perp g is the column that a new reference adds for g. The part of the load that stays, whichever way
// inertia acts, moves the mechanism at rest by
//     u = d (1 - |ṗᵀd| / gᵀd),
// and within T by u ω² T²/2 at most, ω its frequency. Where the inertia along d exceeds the load, truncated
// modes move, and a column of the load does not follow them.
LinearizationDrift FindMissingLoad(const StepContext& ctx, double h, const Matrix6X& contact_impulses_R) {
  const auto& [model, state, ws] = ctx;
  if (!model.reduced->has_complement) return {};
  const Mechanism& m = model.mechanism();
  const Kinematics& kinematics = ConfigurationOf(ctx).kinematics;
  state.reference_age += h;
  if (ws.start.by_expansion) EvaluateExactForces(ctx);
  ws.forces.F = contact_impulses_R / ws.stage.length;
  AddAppliedWrenches(ctx, ws.forces.F);  // a point spring; loads of the step are in g
  ws.missing.load = ws.forces.g;
  if (ws.missing.reactions.size() > 0) ws.missing.load += ws.missing.reactions;
  AccumulateGeneralizedForce(m, kinematics.S, ws.forces.F, ws.missing.load);
  RemoveConstraintReactions(*model.reduced, ws.configuration, ws.missing.load);
  RemoveConstraintReactions(*model.reduced, ws.configuration, ws.missing.inertial_force);
  ApplyComplement(*model.reduced, ws.missing.load, ws.missing.displacement);
  const double work = ws.missing.load.dot(ws.missing.displacement);
  const double stays =
      work > 0 ? std::max(0.0, 1 - std::abs(ws.missing.inertial_force.dot(ws.missing.displacement)) / work)
               : 0;
  LinearizationDrift missing;
  for (int i = 0; i < ws.missing.displacement.size(); ++i) {
    const LinearizationDrift drift =
        DriftOf(m, DriftCause::kMissingLoad, i, stays * ws.missing.displacement(i), kMaxMissing);
    if (drift.share > missing.share) missing = drift;
  }
  if (!(missing.share > 1)) {
    state.missing_time = 0;
    return {};
  }
  state.missing_time += h;
  ApplyMass(m, kinematics, ws.missing.displacement, ws.missing.inertia);
  const double angle = state.missing_time * std::sqrt(work / ws.missing.displacement.dot(ws.missing.inertia));
  if (!(missing.share * std::min(1.0, angle * angle / 2) > 1) || state.reference_age < (kMinSteps - 0.5) * h)
    return {};
  state.missing_time = 0;
  return missing;
}

bool Refresh(MechanismState& state, MechanismWorkspace& ws) {
  std::shared_ptr<const MechanismModel>& model = state.step_model;
  const Mechanism& m = model->mechanism();
  VectorX q = ConfigurationOf({*model, state, ws}).q;
  Kinematics kinematics(m);
  if (m.num_constraints() == 0) {
    ComputeKinematics(m, q, kinematics);
  } else if (!CloseBySimplifiedNewton(*model->reduced, ws.configuration, q, kinematics)) {
    q = ws.configuration.q;
    CloseLoops(m, q);
    ComputeKinematics(m, q, kinematics);
  }
  VectorX q_dot = ws.configuration.Q_now * state.reduced.w;

  // A rotation vector that nothing acts on is kept below half a turn.
  bool rewritten = false;
  for (const Mechanism::Joint& joint : m.joints()) {
    if (!IsPeriodic(m, joint)) continue;
    const Vector3 v = q.segment<3>(joint.offset);
    const double angle = v.norm();
    if (angle <= M_PI) continue;
    const Vector3 wrapped = v * (1 - 2 * M_PI / angle);
    const Matrix3 rewrite = DexpInverseRotation(wrapped) * DexpRotation(v);
    q_dot.segment<3>(joint.offset) = rewrite * q_dot.segment<3>(joint.offset);
    q.segment<3>(joint.offset) = wrapped;
    rewritten = true;
  }
  if (rewritten) ComputeKinematics(m, q, kinematics);

  const ReductionLoads loads =
      LoadsOf(model->options, state, ws.missing.wrenches_R, ws.missing.control_change);
  auto reduced =
      ReduceAgain(*model->reduced, q, kinematics, model->options.reduction, &loads, ws.missing.reactions);
  if (!reduced) return false;
  if (model->options.recovery == Recovery::kCurved) reduced->curvature = LoopCurvature(*reduced);

  const MechanismState before = state;
  const Vector6 p_0 =
      model->base_size > 0 ? Vector6(ws.mass.M.topRows<6>() * ws.x) : Vector6(Vector6::Zero());

  // Velocity by momentum: joints keep M(q) q̇ as the new coordinates see it, the base keeps its own.
  VectorX Mq;
  ApplyMass(m, kinematics, q_dot, Mq);
  state.model = std::make_shared<const ReducedModel>(std::move(*reduced));
  model = std::make_shared<const MechanismModel>(*model, state.model);
  const StepContext ctx{*model, state, ws};
  const int r = model->size();
  VectorX p = VectorX::Zero(model->base_size + r);
  p.tail(r) = model->reduced->Q.transpose() * Mq;
  if (model->base_size > 0) {
    p.head<6>() = p_0;
    p.tail(r) += model->reduced->M_0z.transpose() * state.reduced.V_R;
  }
  state.reduced.z = VectorX::Zero(r);
  state.reduced.w = VectorX::Zero(r);
  StartAtReference(*model, state);
  state.reference_age = 0;
  state.expanded_at.resize(0);
  const bool expands = ws.expansion.in_use;
  ws.expansion.in_use = false;
  Renew(ctx);
  VectorX x = SolveSymmetric(ws.mass.M, p);
  if (!x.allFinite()) {
    Restore(state, ws, before);
    return false;
  }
  ws.x = x;
  state.reduced.w = x.tail(r);
  if (model->base_size > 0) state.reduced.V_R = x.head<6>();
  UpdateConfiguration(ctx);
  state.mu = ws.configuration.mu;
  if (expands) StartExpansions(ctx);
  return true;
}

}  // namespace fork1s
