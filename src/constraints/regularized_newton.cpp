#include "regularized_newton.hpp"

#include <algorithm>
#include <cmath>

#include "line_search.hpp"

namespace fork1s::internal {
namespace {

constexpr int kPatience = 12, kConvexIterations = 100, kMaxFrozenBoundRounds = 30;
// Each dilatancy is this share of the one before, or once its root where that is not found; below the least it is none.
// They change what a solve costs and not what it finds: decision 011 has the cost by each of these.
constexpr double kDilatancyFactor = 0.4, kMaxDilatancyFactor = 0.7, kMinDilatancy = 0.004;
constexpr double kDilatantTolerance = 1e-4;  // the next begins there
constexpr int kPaths = 8;  // with another shift each; of twice as many the second half brought no answer
constexpr double kShift = 0.01;                 // of the fastest point
constexpr double kGoldenRatio = 0.61803398875;  // its multiples fill [0, 1] evenly
// Corrections of all paths: of 2000 jams four times as many solve two more (decision 011), and a step is halved sooner.
constexpr int kMaxPathIterations = 5000;

}  // namespace

void RegularizedNewton::Reserve(int num_contacts, int num_limits, int freedoms) {
  const auto n = static_cast<std::size_t>(freedoms);
  lu_.Reserve(freedoms);
  for (std::vector<double>* v : {&d_, &trial_, &step_, &kept_, &last_level_}) v->reserve(n);
  path_.Reserve(num_contacts, num_limits, freedoms);
}

bool RegularizedNewton::Run(RegularizedContactProblem& rows, double tolerance, int max_iterations,
                            int patience, int& iterations) {
  double best = 1e300;
  int best_at = 0;
  const std::size_t n = d_.size();
  rows.Evaluate(d_.data(), true);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (rows.Reached(tolerance)) return true;
    if (rows.F_norm() < 0.5 * best) {
      best = rows.F_norm();
      best_at = iteration;
    } else if (iteration - best_at >= patience) {
      return false;
    }
    ++iterations;
    for (std::size_t i = 0; i < n; ++i) step_[i] = -rows.F()[i];
    if (!lu_.Factor(rows)) return false;
    lu_.Solve(rows, step_.data());
    const double start = Dot(step_, rows.F());
    const auto evaluate = [&](double length, bool with_derivative) {
      for (std::size_t i = 0; i < n; ++i) trial_[i] = d_[i] + length * step_[i];
      rows.Evaluate(trial_.data(), with_derivative);
      return Dot(step_, rows.F());
    };
    const double slope = evaluate(1, true);
    if (!rows.Reached(tolerance)) {
      const double length = FindSlopeRoot(start, slope, [&](double at) { return evaluate(at, false); });
      if (length < 1) evaluate(length, true);
    }
    d_.swap(trial_);
  }
  return rows.Reached(tolerance);
}

// From the answer without friction, a convex problem, along the path of answers. Where several modes change
// at once a path may get lost; a problem whose velocities are shifted a little, less and less with friction,
// ends at the same answer, and almost none of its paths has such places.
bool RegularizedNewton::SolveByContinuation(RegularizedContactProblem& rows, double tolerance,
                                            int& iterations) {
  double speed = 0, next = 0;
  for (const PointRows& point : rows.points) speed = std::max(speed, point.velocity.base.norm());
  bool found = false;
  const int begun = iterations;
  for (int path = 0; path < kPaths && !found && iterations - begun < kMaxPathIterations; ++path) {
    for (PointRows& point : rows.points)
      for (double& x : point.velocity.shift) {
        next += kGoldenRatio;
        x = path * kShift * speed * (2 * (next - std::floor(next)) - 1);
      }
    std::fill(d_.begin(), d_.end(), 0.0);
    rows.SetFrictionShare(0);
    found = Run(rows, tolerance, kConvexIterations, kConvexIterations, iterations);
    rows.SetFrictionShare(1);
    found = found && path_.Follow(rows, d_, tolerance, begun + kMaxPathIterations, iterations);
  }
  for (PointRows& point : rows.points) point.velocity.shift.setZero();
  return found;
}

// From the solution of the associated law, a convex problem, along those of laws with less and less dilatancy. Where the
// next is not found the way to it is halved; d_ ends at the last one found. Moments, whose bounds would follow a normal
// impulse of another law, are not continued.
bool RegularizedNewton::SolveByDilatancy(RegularizedContactProblem& rows, double tolerance, int& iterations) {
  for (const PointRows& point : rows.points)
    if (point.HasMoments()) return false;
  const auto run = [&](double dilatancy) {
    for (PointRows& point : rows.points) point.law.dilatancy = dilatancy;
    const int patience = dilatancy < 1 ? kPatience : kConvexIterations;
    return Run(rows, dilatancy > 0 ? kDilatantTolerance : tolerance, 4 * patience, patience, iterations);
  };
  double at = 1, factor = kDilatancyFactor;
  bool found = run(at);
  while (found && at > 0 && factor < kMaxDilatancyFactor) {
    const double next = at * factor < kMinDilatancy ? 0 : at * factor;
    last_level_ = d_;
    if (run(next)) {
      at = next;
      factor = std::max(kDilatancyFactor, factor * factor);
      continue;
    }
    d_ = last_level_;
    factor = std::sqrt(factor);
    if (next == 0) break;
  }
  for (PointRows& point : rows.points) point.law.dilatancy = 0;
  return found && at == 0;
}

// Rounds of the convex problem whose friction bounds are frozen, half way to what the last one bore each.
bool RegularizedNewton::SolveByTresca(RegularizedContactProblem& rows, int rounds, double tolerance,
                                      int& iterations) {
  for (PointRows& point : rows.points) point.law.frozen_normal = point.impulse[0];
  const auto set = [&](bool frozen) {
    for (PointRows& point : rows.points) point.law.frozen_normal = frozen ? point.frozen_before : -1;
  };
  for (int round = 1; round <= rounds; ++round) {
    Run(rows, 1e-4, kConvexIterations, kConvexIterations, iterations);
    for (PointRows& point : rows.points)
      point.frozen_before = point.law.frozen_normal = 0.5 * (point.law.frozen_normal + point.impulse[0]);
    if (round % 3 != 0 && round != rounds) continue;
    set(false);
    kept_ = d_;
    if (Run(rows, tolerance, kPatience, kPatience, iterations)) return true;
    d_ = kept_;
    set(round < rounds);
  }
  rows.Evaluate(d_.data(), false);
  return false;
}

// What is left where no answer was found. Impulses of the law at some d are not it: where F(d) is not 0 they
// are those of w/R, a thousand times what the points need, and did work. A convex problem with frozen bounds
// always has an answer, in which impulses only take energy; its bounds come down to what each point bears
// until all lie within their cones. What is wrong with it is that some points slide with less than all of
// their friction.
void RegularizedNewton::SolveConvexFallback(RegularizedContactProblem& rows, double tolerance,
                                            int& iterations) {
  for (PointRows& point : rows.points) point.law.frozen_normal = std::max(0.0, point.frozen_before);
  for (int round = 0; round < kMaxFrozenBoundRounds; ++round) {
    Run(rows, tolerance, kConvexIterations, kConvexIterations, iterations);
    double over = 0, most = 0;
    for (PointRows& point : rows.points) {
      over = std::max(over, point.law.frozen_normal - point.impulse[0]);
      most = std::max(most, point.impulse[0]);
      point.law.frozen_normal = std::min(point.law.frozen_normal, point.impulse[0]);
    }
    if (!(over > tolerance * most)) break;
  }
  for (PointRows& point : rows.points) {
    point.law.frozen_normal = -1;
    point.ProjectToCone();
  }
}

// What was found in d alone, taken up by modes: their impulses are free of rounding.
bool RegularizedNewton::RefineBySemismooth(RegularizedContactProblem& rows, SemismoothNewton& semismooth,
                                           double tolerance, int& iterations) {
  trial_ = d_;
  if (semismooth.Solve(rows, trial_, tolerance, iterations)) {
    d_.swap(trial_);
    return true;
  }
  return semismooth.RefineInFixedModes(rows, d_, tolerance);
}

void RegularizedNewton::Solve(RegularizedContactProblem& rows, SemismoothNewton& semismooth,
                              const ContactSolverOptions& options, std::vector<double>& change,
                              ContactSolverReport& report) {
  const double tolerance = options.tolerance;
  int& iterations = report.newton_iterations;
  for (std::vector<double>* v : {&trial_, &step_}) v->assign(change.size(), 0.0);
  kept_ = d_ = change;
  const auto refines = [&] { return RefineBySemismooth(rows, semismooth, tolerance, iterations); };
  const int patience = kPatience + static_cast<int>(rows.points.size());
  report.converged = Run(rows, tolerance, options.max_newton_iterations, patience, iterations) && refines();
  if (!report.converged) {
    report.fallback = std::max(report.fallback, 1);
    d_ = kept_;
    report.converged = SolveByDilatancy(rows, tolerance, iterations) && refines();
  }
  if (!report.converged) {
    report.fallback = std::max(report.fallback, 2);
    rows.Evaluate(d_.data(), false);
    report.converged = SolveByTresca(rows, 12, tolerance, iterations) && refines();
  }
  if (!report.converged) {
    report.fallback = std::max(report.fallback, 3);
    std::fill(d_.begin(), d_.end(), 0.0);
    rows.Evaluate(d_.data(), false);
    bool found = false;
    for (double share : {0.1, 0.01, 0.001, 0.0}) {
      rows.IncreaseRegularization(share);
      found = SolveByTresca(rows, share > 0 ? 3 : 30, share > 0 ? 1e-2 : tolerance, iterations);
    }
    report.converged = found && refines();
  }
  if (!report.converged) {
    report.fallback = 4;
    kept_ = d_;
    report.converged = SolveByContinuation(rows, tolerance, iterations) && refines();
    if (!report.converged) {  // what softer contact left
      d_ = kept_;
      SolveConvexFallback(rows, tolerance, iterations);
      semismooth.AcceptImpulses(rows, d_);
    }
  }
  change.swap(d_);
}

}  // namespace fork1s::internal
