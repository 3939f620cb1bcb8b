#include "dense_contact_solver.hpp"

#include <algorithm>
#include <limits>

#include "contact_problem.hpp"

namespace fork1s::reference {
namespace {

// The solutions are the same for any ρ, Newton's iterates are not: modes that alternate for one ρ do not for
// another.
constexpr double kRhoFactors[] = {1, 0.1, 10, 0.01, 100};
constexpr double kTarget = 1e-12;         // residual that Newton usually reaches with one more iteration
constexpr int kFirstSweeps = 20;          // of the first set; the next ones are twice as long each
constexpr int kMaxComplianceUpdates = 4;  // deeper penetration is left to the next step, which knows the load

VectorX GatherImpulses(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                       const std::vector<BoundConstraint>& bounds) {
  VectorX x(problem.size());
  for (const PointBlock& block : problem.points) {
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    x.segment<3>(block.row) = p.impulse;
    for (int k = 0; k < 3; ++k)
      if (const int row = block.moment_row[static_cast<std::size_t>(k)]; row >= 0) x[row] = p.moment[k];
  }
  for (std::size_t i = 0; i < bounds.size(); ++i)
    x[problem.first_bound + static_cast<int>(i)] = bounds[i].impulse;
  return x;
}

// |y| over its bound for y = x₀ - w/R. While a point sticks y is its impulse.
double ComputeUtilization(const ContactProblem& problem, const PointBlock& block, const PointConstraint& p,
                          ContactMode mode, const VectorX& x, const VectorX& g) {
  const double bound = p.LargestFriction() * x[block.row];
  if (mode == ContactMode::kOpen || !(bound > 0)) return 0;
  Vector2 y = x.segment<2>(block.row + 1);
  if (mode == ContactMode::kSliding)
    y -= g.segment<2>(block.row + 1).cwiseQuotient(problem.R.segment<2>(block.row + 1));
  return y.cwiseQuotient(p.FrictionShares()).norm() / bound;
}

void StoreSolution(const ContactProblem& problem, const VectorX& x, const NaturalMap& map,
                   std::vector<PointConstraint>& points, std::vector<BoundConstraint>& bounds,
                   FullContactReport& report) {
  for (PointConstraint& p : points) {
    p.impulse.setZero();
    p.moment.setZero();
    p.utilization = 0;
  }
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    const PointBlock& block = problem.points[i];
    PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    p.impulse = x.segment<3>(block.row);
    for (int k = 0; k < 3; ++k)
      if (const int row = block.moment_row[static_cast<std::size_t>(k)]; row >= 0) p.moment[k] = x[row];
    p.utilization = ComputeUtilization(problem, block, p, map.modes[i], x, map.g);
    if (p.impulse.isZero(0)) continue;
    ++report.active;
    ++(map.modes[i] == ContactMode::kSliding ? report.sliding : report.sticking);
  }
  for (std::size_t i = 0; i < bounds.size(); ++i)
    bounds[i].impulse = x[problem.first_bound + static_cast<int>(i)];
}

void AddResponse(const std::vector<ResponseBlock>& blocks, const std::vector<PointConstraint>& points,
                 const std::vector<BoundConstraint>& bounds, VectorX& velocities) {
  VectorX p = VectorX::Zero(velocities.size());
  for (const PointConstraint& point : points) {
    if (point.port_a >= 0) p.segment<6>(point.port_a) += point.ImpulseOn(point.J_a);
    if (point.port_b >= 0) p.segment<6>(point.port_b) += point.ImpulseOn(point.J_b);
  }
  for (const BoundConstraint& bound : bounds) p[bound.row] += bound.sign * bound.impulse;
  for (const ResponseBlock& block : blocks)
    velocities.segment(block.offset, block.W.rows()) += block.W * p.segment(block.offset, block.W.rows());
}

// Newton for each ρ, and sweeps where all of them stagnate. Returns the residual; x is the best iterate.
double SolveAtCompliance(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                         const std::vector<BoundConstraint>& bounds, const FullContactOptions& options,
                         VectorX& x, FullContactReport& report) {
  NaturalMap map;
  VectorX swept = x, best = x;
  double best_residual = std::numeric_limits<double>::infinity();
  for (int set = 0, sweeps = kFirstSweeps;; ++set, sweeps *= 2) {
    for (const double factor : kRhoFactors) {
      ContactProblem scaled = problem;
      scaled.rho *= factor;
      x = swept;
      report.newton_iterations +=
          IterateNewton(scaled, points, bounds, kTarget, options.max_newton_iterations, x);
      EvaluateNaturalMap(problem, points, bounds, x, map);
      if (map.Relative() < best_residual) {
        best_residual = map.Relative();
        best = x;
      }
      if (best_residual <= options.tolerance) break;
    }
    if (best_residual <= options.tolerance || set >= options.max_sweep_sets) break;
    SweepGaussSeidel(problem, points, bounds, sweeps, swept);
    report.sweeps += sweeps;
  }
  // The projection satisfies bounds and cones exactly. It is the solution unless its residual is larger.
  EvaluateNaturalMap(problem, points, bounds, best, map);
  x = map.projection;
  EvaluateNaturalMap(problem, points, bounds, x, map);
  if (map.Relative() <= std::max(best_residual, options.tolerance)) return map.Relative();
  x = best;
  return best_residual;
}

// Marks pairs that x presses in too deep and the solution of hard contact as deep: no force holds up what presses
// them. Their R goes back to that before any load. False if there is none.
bool FindDrivenPairs(const std::vector<PointConstraint>& points, const std::vector<BoundConstraint>& bounds,
                     const FullContactOptions& options, const VectorX& x, ContactProblem& problem) {
  const std::vector<double> before = PenetrationSpeeds(problem, x),
                            excess = ExcessCompliance(points, problem, x);
  if (std::none_of(excess.begin(), excess.end(), [](double e) { return e > 1; })) return false;
  ContactProblem hard = problem;
  std::fill(hard.pair_scale.begin(), hard.pair_scale.end(), 0.0);
  UpdateCompliance(points, options.max_relative_regularization, hard);
  VectorX x_hard = x;
  FullContactReport ignored;
  if (SolveAtCompliance(hard, points, bounds, options, x_hard, ignored) > options.tolerance) return false;
  const std::vector<double> after = PenetrationSpeeds(hard, x_hard);
  bool any = false;
  for (std::size_t pair = 0; pair < before.size(); ++pair) {
    if (problem.driven_pairs[pair] || !(excess[pair] > 1) || !(after[pair] > 0.5 * before[pair])) continue;
    problem.driven_pairs[pair] = any = true;
    problem.pair_scale[pair] = problem.initial_scale[pair];
  }
  return any;
}

}  // namespace

FullContactReport SolveContacts(const std::vector<ResponseBlock>& blocks,
                                std::vector<PointConstraint>& points, std::vector<BoundConstraint>& bounds,
                                VectorX& velocities, const FullContactOptions& options) {
  FullContactReport report;
  if (points.empty() && bounds.empty()) {
    report.converged = velocities.allFinite();
    return report;
  }
  ContactProblem problem = AssembleContactProblem(blocks, points, bounds, velocities);
  RelaxInternalForces(points, problem);
  InitializePairCompliance(points, options.max_relative_regularization, problem);
  VectorX x = GatherImpulses(problem, points, bounds);
  if (!x.allFinite() || !problem.W.allFinite() || !problem.b.allFinite() || !problem.previous.allFinite()) {
    for (PointConstraint& p : points) {
      p.impulse.setZero();
      p.moment.setZero();
    }
    for (BoundConstraint& bound : bounds) bound.impulse = 0;
    report.converged = false;
    return report;
  }
  for (int update = 0;; ++update) {
    UpdateCompliance(points, options.max_relative_regularization, problem);
    report.residual = SolveAtCompliance(problem, points, bounds, options, x, report);
    report.converged = report.residual <= options.tolerance;
    if (!report.converged || update == kMaxComplianceUpdates) break;
    // Most is held by the first reduction.
    const bool driven = update == 1 && FindDrivenPairs(points, bounds, options, x, problem);
    if (!ReducePairCompliance(points, x, problem) && !driven) break;
  }
  NaturalMap map;
  EvaluateNaturalMap(problem, points, bounds, x, map);
  StoreSolution(problem, x, map, points, bounds, report);
  AddResponse(blocks, points, bounds, velocities);
  return report;
}

}  // namespace fork1s::reference
