// Projected block Gauss-Seidel with an exact solve per point.
//
// With all other impulses fixed a point has g = A x + c, A positive definite (3x3). It is open if c_n >= 0.
// Otherwise it sticks if x = -A⁻¹c lies within the cone. Otherwise it slides: the slip is opposite to friction,
// g_t = -s x_t with s > 0 and g_n = 0, so
//     x(s) = -(A + diag(0, s/a_1², s/a_2²))⁻¹ c,   |(x_1/a_1, x_2/a_2)| = µ x_n(s)
// is one equation for s. It has a solution: |x_t| - µ x_n is positive at s = 0, where the point does not
// stick, and negative for s -> ∞, where x_t -> 0 and x_n -> -c_n/A_nn > 0.
#include <algorithm>
#include <cmath>

#include "bound_laws.hpp"
#include "contact_problem.hpp"

namespace fork1s::reference {
namespace {

constexpr int kMaxBisections = 60;  // to the last digit of s

// A⁻¹ b by Cramer's rule.
Vector3 SolveThree(const Matrix3& A, const Vector3& b) {
  const Vector3 c0 = A.col(0), c1 = A.col(1), c2 = A.col(2), n = c1.cross(c2);
  return Vector3(b.dot(n), b.dot(c2.cross(c0)), b.dot(c0.cross(c1))) / c0.dot(n);
}

Vector3 SolveSlip(const Matrix3& A, const Vector3& c, double slip_ratio, const Vector2& shares) {
  Matrix3 shifted = A;
  for (int k = 0; k < 2; ++k) shifted(k + 1, k + 1) += slip_ratio / (shares[k] * shares[k]);
  return -SolveThree(shifted, c);
}

// Sets x at `row` and adds the change to g = A x + c.
void SetImpulse(const ContactProblem& problem, Eigen::Index row, double value, VectorX& x, VectorX& g) {
  const double change = value - x[row];
  if (change == 0) return;
  x[row] = value;
  g += change * problem.A.col(row);
}

void SolvePoint(const ContactProblem& problem, const PointBlock& block, const PointConstraint& p, VectorX& x,
                VectorX& g) {
  const Matrix3 A = problem.A.block<3, 3>(block.row, block.row);
  const Vector3 c = g.segment<3>(block.row) - A * x.segment<3>(block.row);
  const Vector3 impulse = SolvePointBlock(A, c, p.LargestFriction(), p.FrictionShares());
  for (int k = 0; k < 3; ++k) SetImpulse(problem, block.row + k, impulse[k], x, g);
  for (int k = 0; k < 3; ++k) {
    const int row = block.moment_row[static_cast<std::size_t>(k)];
    if (row < 0) continue;
    const double y = x[row] - g[row] / problem.A(row, row);
    SetImpulse(problem, row, ProjectMoment(y, p.Radius(k), impulse[0]).moment, x, g);
  }
}

}  // namespace

Vector3 SolvePointBlock(const Matrix3& A, const Vector3& c, double friction, const Vector2& shares) {
  if (c[0] >= 0) return Vector3::Zero();
  if (!(friction > 0)) return Vector3(-c[0] / A(0, 0), 0, 0);
  const auto size_of = [&](const Vector3& x) { return x.tail<2>().cwiseQuotient(shares).norm(); };
  const auto excess = [&](const Vector3& x) { return size_of(x) - friction * x[0]; };
  Vector3 x = SolveSlip(A, c, 0, shares);
  if (excess(x) <= 0) return x;
  // s = a t/(1 - t) for t in (0, 1), a the tangential stiffness.
  const double a = A(1, 1) + A(2, 2);
  double low = 0, high = 1;
  for (int k = 0; k < kMaxBisections; ++k) {
    const double t = 0.5 * (low + high);
    if (t >= 1) break;
    x = SolveSlip(A, c, a * t / (1 - t), shares);
    (excess(x) > 0 ? low : high) = t;
  }
  if (const double size = size_of(x); size > 0) x.tail<2>() *= friction * x[0] / size;
  return x;
}

void SweepGaussSeidel(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                      const std::vector<BoundConstraint>& bounds, int sweeps, VectorX& x) {
  VectorX g;
  const std::size_t num_points = problem.points.size(), count = num_points + bounds.size();
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    if (sweep % 16 == 0) g = problem.A * x + problem.c;  // without the rounding of the updates
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = sweep % 2 == 0 ? k : count - 1 - k;
      if (i < num_points) {
        const PointBlock& block = problem.points[i];
        SolvePoint(problem, block, points[static_cast<std::size_t>(block.constraint)], x, g);
        continue;
      }
      const BoundConstraint& bound = bounds[i - num_points];
      const auto row =
          static_cast<Eigen::Index>(problem.first_bound) + static_cast<Eigen::Index>(i - num_points);
      const double y = x[row] - g[row] / problem.A(row, row);
      SetImpulse(problem, row, ProjectOntoBounds(y, bound.lower, bound.upper).impulse, x, g);
    }
  }
}

}  // namespace fork1s::reference
