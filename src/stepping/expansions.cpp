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
double FarthestTurn(const MechanismView& here, const RowMatrixX& rows, const VectorX& delta) {
  const Mechanism& m = here.model.mechanism();
  double turn = 0, slide = 0;
  for (int i = 0; i < m.num_coordinates(); ++i) {
    double& of_kind = m.Turns(i) ? turn : slide;
    of_kind = std::max(of_kind, std::abs(rows.row(i).dot(delta)));
  }
  return std::max(turn, slide / m.length_scale()) / kFar;
}

// Of L⁻¹ (G + Gᵀ) L⁻ᵀ, M* = L Lᵀ: its Frobenius norm, which bounds what any motion sees. In kInertiaChanged.
double InertiaChange(const MechanismStep& here) {
  MechanismWorkspace& ws = here.work;
  MatrixX& change = ws.expansion.pose.scratch;
  change.noalias() = ws.expansion.of->M_inverse * ws.expansion.pose.G;
  change.noalias() += ws.expansion.of->M_inverse * ws.expansion.pose.G.transpose();
  return std::sqrt(std::max(0.0, change.cwiseProduct(change.transpose()).sum())) / kInertiaChanged;
}

// The same of what the last step, or the last part of one, has changed, as much as that is in h.
double InertiaChangeWithin(const MechanismStep& here, double h) {
  MechanismWorkspace& ws = here.work;
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
void ChangeEvaluator(const MechanismStep& here, const Change& change) {
  const auto& [model, state, ws] = here;
  ws.scratch.rhs.noalias() = ws.mass.M * ws.x;
  change();
  UpdateConfiguration(here);
  SolveOrFail(ws.mass.factor, ws.mass.M, ws.scratch.rhs);
  ws.x = ws.scratch.rhs;
  state.reduced.w = ws.x;
}

// Where the next exact pose starts from: a function of the state.
void ResetConfiguration(const MechanismStep& here) {
  here.work.expansion.in_use = false;
  here.work.configuration.mu = here.state.mu;
  here.work.configuration.foresees = false;
}

// `farthest`: share of kFar by which joints may have turned.
bool IsFar(const MechanismStep& here, double farthest) {
  const MechanismWorkspace& ws = here.work;
  return FarthestTurn(here, ws.expansion.of->expansion.Q, ws.expansion.pose.delta) > farthest ||
         InertiaChange(here) > 1;
}

void DropExpansion(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ChangeEvaluator(here, [&] { ResetConfiguration(here); });
  state.expanded_at.resize(0);
  state.mu = ws.configuration.mu;
}

}  // namespace

void DropExpansionIfFar(const MechanismStep& here) {
  if (here.work.expansion.in_use && IsFar(here, 1)) DropExpansion(here);
}

void UseExactPose(const MechanismStep& here) {
  if (!here.work.expansion.in_use) return;
  ResetConfiguration(here);
  UpdateConfiguration(here);
}

void StartExpansions(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (!model.expands) return;
  Expand(here);
  ws.expansion.in_use = true;
  UpdateConfiguration(here);
}

void RestoreExpansion(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  ws.expansion.in_use = state.expanded_at.size() > 0;
  if (!ws.expansion.in_use || (ws.expansion.of && ws.expansion.of->of == model.reduced &&
                               ws.expansion.of->expansion.z == state.expanded_at))
    return;
  ReducedState at = state.reduced;
  at.z = state.expanded_at;
  Configuration c(*model.reduced);
  c.mu = state.mu;
  ConfigureClosed(*model.reduced, at, c);
  ExpandAt(here, c);
}

void ChooseEvaluator(const MechanismStep& here) {
  if (HasForcesFromOutside(here.state)) UseExactPose(here);
}

void EndWithExpansion(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (ws.expansion.in_use || state.expanded_at.size() == 0) return;
  ws.expansion.in_use = true;
  UpdatePose(here);
  if (IsWithinExpansion(here)) return;
  Expand(here);
  UpdatePose(here);
}

bool IsWithinExpansion(const MechanismView& here) {
  const MechanismWorkspace& ws = here.work;
  return !ws.expansion.in_use ||
         FarthestTurn(here, ws.expansion.of->expansion.Q, ws.expansion.pose.delta) < kBeyond;
}

bool UpdateExpansion(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  if (!model.expands) return false;
  ws.velocities.w = h * state.reduced.w;
  const double turn = FarthestTurn(here, ws.Q_now(), ws.velocities.w);
  bool expands = false;
  if (ws.expansion.in_use) {
    expands = IsFar(here, std::clamp(kStepsBetween * turn, kNear, 1.0));
    if (kStepsThatPay * turn > 1 || (expands && kLeastSteps * InertiaChangeWithin(here, h) > 1)) {
      DropExpansion(here);
      return false;
    }
  } else {
    expands = 2 * kStepsThatPay * turn < 1 && 2 * kLeastSteps * InertiaChangeWithin(here, h) < 1;
  }
  if (expands)
    ChangeEvaluator(here, [&] {
      Expand(here);
      ws.expansion.in_use = true;
    });
  return expands;
}

}  // namespace fork1s
