#include "stage_residual.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace fork1s {
namespace {

// The matrix of a stage is renewed where this many more iterations would not solve it: they cost as much as a
// new matrix.
constexpr int kIterationsOfMatrix = 3;
// Shares of the stage's motion and of a mechanism's length below which something does not matter. Residuals of that
// size add up to at most 1e-4 of the length in ten thousand steps; contacts of curved shapes and meshes leave them,
// since their normals jump between poses. A change of saturation, which no stage solves for, may move a tenth of that.
constexpr double kRelativeTolerance = 1e-6, kResidualTolerance = 1e-8, kSaturationTolerance = 1e-9;
// A stage is solved where another iteration would change poses by less than the tolerance, a share of the motion,
// and than ten times that share of what the velocity has changed by in the step. What is left adds up to at most
// that share of all that the velocity changes by, however many steps that takes. kRounding is a share of the
// length below which nothing is counted. Stiff mechanisms leave more by rounding: where an iteration no
// longer helps, what does not matter is accepted, and where it helps slowly, the same share of that as the tolerance is
// of the default.
constexpr double kRounding = 1e-12;
// Contacts of meshes jump from one facet to another between iterations. A stage that would be halved is
// accepted with a residual within this share of the length, and reported.
constexpr double kStagnationTolerance = 1e-6;

// The contraction of an iteration is taken for no less than rounding leaves, and for no contraction from 1
// on.
constexpr double kLeastContraction = 1e-12, kNoContraction = 1 - 1e-6;
// Residual after an iteration and change by it, in tolerances.
bool IsSlow(double residual, double change) {
  const double contraction = change > 0 ? residual / change : 0;
  return !(residual * std::pow(contraction, kIterationsOfMatrix) <= 1);
}

// Lengths: of a motion beyond them, as of an iteration that has run away, the residual is no smaller share.
constexpr double kMaxMotionForTolerance = 100;

double Tolerance(double share, const StageMotion& moved, double length) {
  return share * std::min({moved.motion, 10 * moved.velocity_change, kMaxMotionForTolerance * length}) +
         std::min(kRounding, share) * length;
}

// Adds a residual [m] of something that moves by `motion` [m] in the stage.
void Add(double residual, double tolerance, const StageMotion& moved, double length, StepSubject subject,
         StageResidual& out) {
  // What is beyond the range of numbers is not solved, however large the motion that the residual is compared
  // with.
  if (!(std::isfinite(moved.motion) && std::isfinite(residual))) {
    out.ratio = out.negligible = std::numeric_limits<double>::infinity();
    out.is_small = false;
    out.subject = subject;
    return;
  }
  const double ratio = residual / std::max(Tolerance(tolerance, moved, length), 1e-300);
  out.largest = std::max(out.largest, residual);
  const double negligible = kRelativeTolerance * std::min(moved.motion, kMaxMotionForTolerance * length) +
                            kResidualTolerance * length;
  out.negligible = std::max(out.negligible, residual / std::max(negligible, 1e-300));
  out.is_small = out.is_small && (ratio <= 1 || residual <= kStagnationTolerance * length);
  if (ratio <= out.ratio && out.subject.kind != StepSubject::Kind::kNone) return;
  out.ratio = ratio;
  out.subject = subject;
}

// An iteration is near its solution where it moves nothing by more than this share of its length. Relaxed
// farther from it, it may settle on another solution: a stiff thread half a turn from its length.
constexpr double kNear = 1e-3;
// The row of a stop vanishes where a loop drives its joint through a dead centre. Linearized beside that pose it moves
// the loop by more than the mechanism is long, and further iterations part from there. The last resort takes no more
// than this share of the length of an iteration.
constexpr double kMaxIterationDisplacement = 0.1;

// Of two changes of velocity d₀ and d₁, whose directions oppose each other, the share w of d₁ to take back that
// makes (1 - w) d₁ + w d₀ least: Anderson's acceleration of depth one (Walker & Ni 2011) where it interpolates. An
// extrapolation may lead to another solution.
void FindSwinging(const StageEnd& at, const Changes& by_last, NewtonIteration& newton) {
  const Changes before = std::exchange(newton.changes_before, by_last);
  newton.relaxation = 0;
  if (at.is_first || !at.measures || before.square == 0) return;
  if (!(by_last.with_before < 0)) return;
  if (!at.is_last_resort && std::max(before.share, by_last.share) > kNear) return;
  if (IsSlow(by_last.ratio, before.ratio))
    newton.relaxation =
        (by_last.square - by_last.with_before) / (by_last.square - 2 * by_last.with_before + before.square);
}

}  // namespace

StageResidual MoveAndComputeResiduals(const StageEnd& at, Bodies& all, NewtonIteration& newton) {
  const double b = at.b;
  StageResidual bodies, body_changes, changes, found;
  Changes all_changes;
  const auto add = [&](const StageChange& change, double length) {
    all_changes.square += change.square;
    all_changes.with_before += change.with_before;
    all_changes.share = std::max(all_changes.share, change.change / std::max(length, 1e-300));
  };
  for (std::size_t i = 0; i < all.free_bodies.size(); ++i) {
    FreeBody& body = all.free_bodies[i];
    const StageChange change = body.ComputeStageChange(b);
    const double length = std::sqrt(body.inertia().rotational.trace() / body.inertia().mass);
    add(change, length);
    StageMotion moved;
    const double residual = body.MoveAndComputeResidual(b, moved);
    const StepSubject subject = {StepSubject::Kind::kFreeBody, static_cast<int>(i), -1};
    Add(residual, at.tolerance, moved, length, subject, bodies);
    Add(change.change, at.tolerance, moved, length, subject, body_changes);
  }
  const auto length = [&](std::size_t i) { return all.mechanisms[i].mechanism().length_scale(); };
  const auto subject = [](std::size_t i) {
    return StepSubject{StepSubject::Kind::kMechanism, static_cast<int>(i), -1};
  };
  bool shortened = false;
  newton.changes.resize(all.mechanisms.size());
  for (std::size_t i = 0; i < all.mechanisms.size(); ++i) {
    newton.changes[i] = ComputeStageChange(all.mechanisms[i], b);
    const double most = kMaxIterationDisplacement * length(i);
    if (at.is_last_resort && newton.changes[i].change > most) {
      ShortenStage(all.mechanisms[i], 1 - most / newton.changes[i].change, newton.changes[i]);
      shortened = true;
    }
    Add(newton.changes[i].change, at.tolerance, newton.changes[i], length(i), subject(i), changes);
    add(newton.changes[i], length(i));
  }
  all_changes.ratio = std::max(changes.ratio, body_changes.ratio);
  FindSwinging(at, all_changes, newton);
  double& contraction = newton.contraction[at.scheme == StageScheme::kSecondOfTwo ? 1 : 0];
  const double next = contraction / (1 - contraction);
  if (bodies.ratio <= 1 && next * changes.ratio <= 1 && at.may_accept && !shortened) {
    const bool is_last = at.scheme != StageScheme::kFirstOfTwo;
    all.ForMechanisms([&](std::size_t i) { AcceptStage(all.mechanisms[i], b, at.time, is_last); });
    for (std::size_t i = 0; i < all.mechanisms.size(); ++i)
      Add(next * newton.changes[i].change, at.tolerance, newton.changes[i], length(i), subject(i), bodies);
    // What is not measured is trusted less and less (Hairer & Wanner II, IV.8).
    contraction = std::pow(contraction, 0.8);
    return bodies;
  }
  for (std::size_t i = 0; i < all.mechanisms.size(); ++i)
    Add(MoveAndComputeResidual(all.mechanisms[i], b, at.time), at.tolerance, newton.changes[i], length(i),
        subject(i), found);
  if (changes.ratio > 0 && at.measures && !shortened) {
    const double measured = std::clamp(found.ratio / changes.ratio, kLeastContraction, kNoContraction);
    contraction = at.is_first ? measured : std::max(contraction, measured);
  }
  found.is_slow = IsSlow(found.ratio, changes.ratio);
  if (bodies.ratio <= found.ratio && found.subject.kind != StepSubject::Kind::kNone)
    bodies.subject = found.subject;
  found.subject = bodies.subject;
  found.ratio = std::max(found.ratio, bodies.ratio);
  found.largest = std::max(found.largest, bodies.largest);
  found.is_small = found.is_small && bodies.is_small;
  found.negligible = std::max(found.negligible, bodies.negligible);
  return found;
}

void RelaxSwinging(double b, double time, Bodies& all, NewtonIteration& newton) {
  if (newton.relaxation == 0) return;
  all.ForMechanisms([&](std::size_t i) { RelaxStage(all.mechanisms[i], b, time, newton.relaxation); });
  for (FreeBody& body : all.free_bodies) body.RelaxStage(b, newton.relaxation);
  newton.changes_before = {};
}

StepSubject FindSaturationChange(Bodies& bodies, double b) {
  for (std::size_t i = 0; i < bodies.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies.mechanisms[i];
    if (!HasComplementarity(m)) continue;
    const SaturationChange change = ComputeSaturationChange(bodies.mechanisms[i], b, kOnward);
    const double negligible =
        kRelativeTolerance * change.motion + kSaturationTolerance * m.mechanism().length_scale();
    if (change.displacement <= negligible) continue;
    return {change.is_servo ? StepSubject::Kind::kServo : StepSubject::Kind::kSpring, static_cast<int>(i),
            change.index};
  }
  return {};
}

}  // namespace fork1s
