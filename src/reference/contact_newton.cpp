// Semismooth Newton on the natural map F(x) = x - Π(x - ρ (A x + c)).
//
// With the modes of y = x - ρ g a step solves linear equations for the next iterate x⁺:
//     open       x⁺ = 0
//     sticking   g⁺ = 0
//     sliding    g_n⁺ = 0,   x_t⁺ = Π_t' (x_n⁺, y_t⁺), the derivative of friction_law.hpp
//     moments and bounds   g⁺ = 0, or at a bound x⁺ = ± r x_n⁺ or x⁺ = bound
// (P. Alart and A. Curnier, CMAME 92, 1991). Steps are damped until the residual decreases.
#include <algorithm>
#include <cmath>
#include <limits>

#include "bound_laws.hpp"
#include "contact_problem.hpp"
#include "linalg/solve.hpp"

namespace fork1s::reference {
namespace {

constexpr int kMaxHalvings = 5;  // of a step
constexpr int kPatience = 8;     // iterations without half of the best residual

// M x⁺ = r
struct NewtonSystem {
  MatrixX M;
  VectorX r;

  // ρ g⁺ = 0
  void SetFree(const ContactProblem& problem, Eigen::Index row) {
    M.row(row) = problem.rho[row] * problem.A.row(row);
    r[row] = -problem.rho[row] * problem.c[row];
  }
  // x⁺ = value
  void SetValue(Eigen::Index row, double value) {
    M.row(row).setZero();
    M(row, row) = 1;
    r[row] = value;
  }
  // x_t⁺ = P_n x_n⁺ + P_t (x_t⁺ - ρ (A_t x⁺ + c_t)), P the derivative of the projection at y
  void SetSliding(const ContactProblem& problem, Eigen::Index normal, const Matrix3& P) {
    const Eigen::Matrix2d across = P.bottomRightCorner<2, 2>(),
                          scaled = across * problem.rho.segment<2>(normal + 1).asDiagonal();
    M.middleRows<2>(normal + 1) = scaled * problem.A.middleRows<2>(normal + 1);
    M.block<2, 2>(normal + 1, normal + 1) += Eigen::Matrix2d::Identity() - across;
    M.block<2, 1>(normal + 1, normal) -= P.bottomLeftCorner<2, 1>();
    r.segment<2>(normal + 1) = -scaled * problem.c.segment<2>(normal + 1);
  }
};

void AssembleNewtonSystem(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                          const std::vector<BoundConstraint>& bounds, const NaturalMap& map,
                          NewtonSystem& system) {
  const Eigen::Index n = problem.size();
  system.M.resize(n, n);
  system.r.resize(n);
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    const PointBlock& block = problem.points[i];
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    if (map.modes[i] == ContactMode::kOpen) {
      for (int k = 0; k < 3; ++k) system.SetValue(block.row + k, 0);
      for (const int row : block.moment_row)
        if (row >= 0) system.SetValue(row, 0);
      continue;
    }
    for (int k = 0; k < 3; ++k) system.SetFree(problem, block.row + k);
    if (map.modes[i] == ContactMode::kSliding)
      system.SetSliding(
          problem, block.row,
          ProjectOntoFrictionCone(map.y.segment<3>(block.row), p.LargestFriction(), p.FrictionShares())
              .derivative);
    for (int k = 0; k < 3; ++k) {
      const int row = block.moment_row[static_cast<std::size_t>(k)];
      if (row < 0) continue;
      const MomentProjection moment = ProjectMoment(map.y[row], p.Radius(k), map.y[block.row]);
      if (moment.by_y > 0) {
        system.SetFree(problem, row);
      } else {
        system.SetValue(row, 0);
        system.M(row, block.row) = -moment.by_normal;
      }
    }
  }
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(problem.first_bound + static_cast<int>(i));
    const BoundProjection bound = ProjectOntoBounds(map.y[row], bounds[i].lower, bounds[i].upper);
    if (bound.derivative > 0)
      system.SetFree(problem, row);
    else
      system.SetValue(row, bound.impulse);
  }
}

// x⁺ from rows and columns scaled by the inverse masses, in which impulses are of one unit.
VectorX SolveNewtonSystem(const ContactProblem& problem, const NewtonSystem& system, LuFactor& lu) {
  const VectorX scale = problem.rho.cwiseSqrt();
  MatrixX M = system.M;
  for (Eigen::Index i = 0; i < M.rows(); ++i) M.row(i) /= scale[i];
  for (Eigen::Index i = 0; i < M.cols(); ++i) M.col(i) *= scale[i];
  lu.Compute(M);
  VectorX x = system.r.cwiseQuotient(scale);
  lu.SolveInPlace(x);
  return x.cwiseProduct(scale);
}

}  // namespace

int IterateNewton(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                  const std::vector<BoundConstraint>& bounds, double target, int max_iterations, VectorX& x) {
  NaturalMap map, trial_map;
  NewtonSystem system;
  LuFactor lu;
  VectorX best = x, current = x;
  EvaluateNaturalMap(problem, points, bounds, current, map);
  double best_relative = map.Relative(), mark = best_relative;
  int iterations = 0;
  for (int since_mark = 0; best_relative > target && iterations < max_iterations && since_mark < kPatience;
       ++since_mark) {
    ++iterations;
    AssembleNewtonSystem(problem, points, bounds, map, system);
    const VectorX step = SolveNewtonSystem(problem, system, lu) - current;
    if (!step.allFinite()) break;
    // The first length that decreases the residual; where none does, the one with the smallest residual.
    double length = 1, chosen = 1, smallest = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= kMaxHalvings; ++k, length *= 0.5) {
      EvaluateNaturalMap(problem, points, bounds, current + length * step, trial_map);
      if (trial_map.residual < smallest) {
        smallest = trial_map.residual;
        chosen = length;
      }
      if (trial_map.residual <= (1 - 0.1 * length) * map.residual) break;
    }
    current += chosen * step;
    EvaluateNaturalMap(problem, points, bounds, current, map);
    const double relative = map.Relative();
    if (relative < best_relative) {
      best_relative = relative;
      best = current;
    }
    if (relative < 0.5 * mark) {
      mark = relative;
      since_mark = -1;
    }
  }
  x = best;
  return iterations;
}

}  // namespace fork1s::reference
