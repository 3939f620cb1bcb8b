// When a mechanism is expanded about its pose, and which steps go by that.
//
// A step by an expansion visits no joint: inertia and forces to first order, interface poses to second
// (reduction/expansion.hpp). Loads from outside may act anywhere; a step with them goes by exact poses, and so does one in
// which joints turn so fast that expansions would come oftener than they pay. Both move the same z and w.
#include <algorithm>
#include <cmath>
#include <limits>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// Where a joint has turned so far since the expansion, what is left out is below the error of a step of 1/60 s, in scenes
// with and without contact (docs/method.md, section 2). Slides: this share of the mechanism's length.
constexpr double kFar = 0.14;  // rad, 8 degrees
// The error of a step grows with speed, that of an expansion with the distance alone: slow joints are expanded again after
// as many steps, or as soon as they have turned by this share of kFar. At rest that is once.
constexpr double kStepsBetween = 120;
constexpr double kNear = 1.0 / 16;
// An expansion costs as much as some steps by exact poses: where fewer steps go by it, or fewer than twice as many by the
// next one, it is not made.
constexpr double kStepsThatPay = 6;
// The same where it is the inertia that asks for the next one: that bounds what is left out, so only the cost counts.
constexpr double kLeastSteps = 3;
// A pose beyond that is none: inertia to first order may have lost its sign.
constexpr double kBeyond = 3;  // times kFar
// The inertia of the pose at hand differs by this share of that at the expansion, in the kinetic metric.
constexpr double kInertiaChanged = 0.3;

// Largest |rows δ| by joint, in kFar.
double FarthestTurn(const ConstStepContext& ctx, const RowMatrixX& rows, const VectorX& delta) {
  const Mechanism& m = ctx.model.mechanism();
  double turn = 0, slide = 0;
  for (int i = 0; i < m.num_coordinates(); ++i) {
    double& of_kind = m.Turns(i) ? turn : slide;
    of_kind = std::max(of_kind, std::abs(rows.row(i).dot(delta)));
  }
  return std::max(turn, slide / m.length_scale()) / kFar;
}

// Of L⁻¹ (G + Gᵀ) L⁻ᵀ, M* = L Lᵀ: its Frobenius norm, which bounds what any motion sees. In kInertiaChanged.
double InertiaChange(const StepContext& ctx) {
  MechanismWorkspace& ws = ctx.work;
  MatrixX& change = ws.expansion.pose.scratch;
  change.noalias() = ws.expansion.of->M_inverse * ws.expansion.pose.G;
  change.noalias() += ws.expansion.of->M_inverse * ws.expansion.pose.G.transpose();
  return std::sqrt(std::max(0.0, change.cwiseProduct(change.transpose()).sum())) / kInertiaChanged;
}

// The same of what the last step, or the last part of one, has changed, as much as that is in h.
double InertiaChangeWithin(const StepContext& ctx, double h) {
  MechanismWorkspace& ws = ctx.work;
  if (!ws.mass.factor.Compute(ws.mass.M)) return std::numeric_limits<double>::infinity();
  MatrixX& change = ws.expansion.pose.scratch;
  for (Eigen::Index k = 0; k < change.cols(); ++k) {
    ws.scratch.rhs = ws.mass.M.col(k) - ws.start.M.col(k);
    ws.mass.factor.SolveInPlace(ws.scratch.rhs);
    change.col(k) = ws.scratch.rhs;
  }
  return h / ws.start.h * std::sqrt(std::max(0.0, change.cwiseProduct(change.transpose()).sum())) /
         kInertiaChanged;
}

// Another evaluator of the same pose, which keeps the momentum of the coordinates.
template <class Change>
void ChangeEvaluator(const StepContext& ctx, const Change& change) {
  const auto& [model, state, ws] = ctx;
  ws.scratch.rhs.noalias() = ws.mass.M * ws.x;
  change();
  UpdateConfiguration(ctx);
  SolveOrFail(ws.mass.factor, ws.mass.M, ws.scratch.rhs);
  ws.x = ws.scratch.rhs;
  state.reduced.w = ws.x;
}

// Where the next exact pose starts from: a function of the state.
void ResetConfiguration(const StepContext& ctx) {
  ctx.work.expansion.in_use = false;
  ctx.work.configuration.mu = ctx.state.mu;
  ctx.work.configuration.has_tangent_predictor = false;
}

// `farthest`: share of kFar by which joints may have turned.
bool IsFar(const StepContext& ctx, double farthest) {
  const MechanismWorkspace& ws = ctx.work;
  return FarthestTurn(ctx, ws.expansion.of->expansion.Q, ws.expansion.pose.delta) > farthest ||
         InertiaChange(ctx) > 1;
}

void DropExpansion(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  ChangeEvaluator(ctx, [&] { ResetConfiguration(ctx); });
  state.expanded_at.resize(0);
  state.mu = ws.configuration.mu;
}

}  // namespace

void DropExpansionIfFar(const StepContext& ctx) {
  if (ctx.work.expansion.in_use && IsFar(ctx, 1)) DropExpansion(ctx);
}

void UseExactPose(const StepContext& ctx) {
  if (!ctx.work.expansion.in_use) return;
  ResetConfiguration(ctx);
  UpdateConfiguration(ctx);
}

void StartExpansions(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  if (!model.expands) return;
  Expand(ctx);
  ws.expansion.in_use = true;
  UpdateConfiguration(ctx);
}

void RestoreExpansion(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  ws.expansion.in_use = state.expanded_at.size() > 0;
  if (!ws.expansion.in_use || (ws.expansion.of && ws.expansion.of->of == model.reduced &&
                               ws.expansion.of->expansion.z == state.expanded_at))
    return;
  ReducedState at = state.reduced;
  at.z = state.expanded_at;
  Configuration c(*model.reduced);
  c.mu = state.mu;
  ConfigureClosed(*model.reduced, at, c);
  ExpandAt(ctx, c);
}

void ChooseEvaluator(const StepContext& ctx) {
  if (HasForcesFromOutside(ctx.state)) UseExactPose(ctx);
}

void EndWithExpansion(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use || state.expanded_at.size() == 0) return;
  ws.expansion.in_use = true;
  UpdatePose(ctx);
  if (IsWithinExpansion(ctx)) return;
  Expand(ctx);
  UpdatePose(ctx);
}

bool IsWithinExpansion(const ConstStepContext& ctx) {
  const MechanismWorkspace& ws = ctx.work;
  return !ws.expansion.in_use ||
         FarthestTurn(ctx, ws.expansion.of->expansion.Q, ws.expansion.pose.delta) < kBeyond;
}

bool UpdateExpansion(const StepContext& ctx, double h) {
  const auto& [model, state, ws] = ctx;
  if (!model.expands) return false;
  ws.velocities.w = h * state.reduced.w;
  const double turn = FarthestTurn(ctx, ws.Q_now(), ws.velocities.w);
  bool expands = false;
  if (ws.expansion.in_use) {
    expands = IsFar(ctx, std::clamp(kStepsBetween * turn, kNear, 1.0));
    if (kStepsThatPay * turn > 1 || (expands && kLeastSteps * InertiaChangeWithin(ctx, h) > 1)) {
      DropExpansion(ctx);
      return false;
    }
  } else {
    expands = 2 * kStepsThatPay * turn < 1 && 2 * kLeastSteps * InertiaChangeWithin(ctx, h) < 1;
  }
  if (expands)
    ChangeEvaluator(ctx, [&] {
      Expand(ctx);
      ws.expansion.in_use = true;
    });
  return expands;
}

}  // namespace fork1s
