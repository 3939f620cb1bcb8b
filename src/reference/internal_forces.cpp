// Internal (self-equilibrated) friction forces.
//
// Memory preserves tangential impulses of the time of touch, among them two fingertips that pull at one object
// in opposite directions. Of all tangential impulses λ with the same effect on the bodies, the one with the
// smallest Σ |λ|²/(µ λ_n) replaces them. With M = diag(µ λ_n) of the step before and W_t the tangential rows
// of W, whose null space contains the impulses without effect,
//     λ = M^½ P M^-½ λ₀,   P the projection on the range of M^½ W_t M^½.
// The way from λ₀ to λ ends where a point leaves 0.95 of its friction cone. Where coefficients differ, tangents are
// λ_k/a_k and rows of W_t those times a_k.
#include <algorithm>
#include <cmath>

#include "contact_problem.hpp"
#include "linalg/spectrum.hpp"

namespace fork1s::reference {
namespace {

constexpr double kConeShare = 0.95;
// Of the mean eigenvalue: below it an eigenvector is a null vector.
constexpr double kNullEigenvalue = 1e-12;

// Largest share of the way from a to b within the disc of the radius `bound`, or of |a| if that is larger.
double ComputeShareWithinDisc(const Vector2& a, const Vector2& b, double bound) {
  const double radius = std::max(bound, a.norm());
  if (b.norm() <= radius) return 1;
  double low = 0, high = 1;
  for (int k = 0; k < 60; ++k) {
    const double share = 0.5 * (low + high);
    ((a + share * (b - a)).norm() <= radius ? low : high) = share;
  }
  return low;
}

}  // namespace

void RelaxInternalForces(const std::vector<PointConstraint>& points, ContactProblem& problem) {
  struct Tangents {
    int row;
    double bound;    // µ λ_n of the step before
    Vector2 shares;  // a
  };
  std::vector<Tangents> sticking;
  for (const PointBlock& block : problem.points) {
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    const double bound = p.LargestFriction() * p.previous_impulse[0];
    if (bound > 0 && p.previous_utilization < 1 / kConeShare)
      sticking.push_back({block.row + 1, bound, p.FrictionShares()});
  }
  if (sticking.size() < 2) return;
  const auto n = static_cast<Eigen::Index>(2 * sticking.size());
  MatrixX S(n, n);
  VectorX scaled(n);
  for (std::size_t i = 0; i < sticking.size(); ++i) {
    const Tangents& a = sticking[i];
    const auto at = static_cast<Eigen::Index>(2 * i);
    scaled.segment<2>(at) = problem.previous.segment<2>(a.row).cwiseQuotient(a.shares) / std::sqrt(a.bound);
    for (std::size_t j = 0; j < sticking.size(); ++j)
      S.block<2, 2>(at, static_cast<Eigen::Index>(2 * j)) =
          std::sqrt(a.bound * sticking[j].bound) * a.shares.asDiagonal() *
          problem.W.block<2, 2>(a.row, sticking[j].row) * sticking[j].shares.asDiagonal();
  }
  const SymmetricSpectrum spectrum = SpectrumOf(S);
  const double threshold = kNullEigenvalue * spectrum.values.cwiseMax(0).mean();
  VectorX relaxed = VectorX::Zero(n);
  for (Eigen::Index k = 0; k < n; ++k)
    if (spectrum.values[k] > threshold)
      relaxed += spectrum.vectors.col(k).dot(scaled) * spectrum.vectors.col(k);
  double share = 1;
  for (std::size_t i = 0; i < sticking.size(); ++i) {
    const Tangents& a = sticking[i];
    const Vector2 from = problem.previous.segment<2>(a.row).cwiseQuotient(a.shares),
                  to = std::sqrt(a.bound) * relaxed.segment<2>(static_cast<Eigen::Index>(2 * i));
    share = std::min(share, ComputeShareWithinDisc(from, to, kConeShare * a.bound));
  }
  for (std::size_t i = 0; i < sticking.size(); ++i) {
    const Tangents& a = sticking[i];
    const Vector2 to =
        std::sqrt(a.bound) * a.shares.cwiseProduct(relaxed.segment<2>(static_cast<Eigen::Index>(2 * i)));
    problem.previous.segment<2>(a.row) += share * (to - problem.previous.segment<2>(a.row));
  }
}

}  // namespace fork1s::reference
