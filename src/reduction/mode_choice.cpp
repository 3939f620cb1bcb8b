#include "mode_choice.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "linalg/products.hpp"
#include "linalg/solve.hpp"
#include "modes.hpp"

namespace fork1s::internal {
namespace {

using Complex = std::complex<double>;

constexpr double kStep = 1.0 / 60;    // s, the default step
constexpr double kLowest = 0.05;      // Hz; slower motion is static to every mode that could be left out
constexpr int kFrequencies = 48;      // 14 % apart: peaks of a step this damped are wider
const double kHighest = 0.5 / kStep;  // Hz, what the step can show

// s of the implicit Euler step at a frequency [Hz].
Complex Laplace(double frequency) {
  const double angle = 2 * M_PI * frequency * kStep;
  return (1.0 - std::polar(1.0, -angle)) / kStep;
}

}  // namespace

VectorX ModeContributions(const ReducedModel& all, const MatrixX& J, double length) {
  const Mechanism& mechanism = *all.mechanism;
  const int candidates = all.num_modes;
  const int base = mechanism.base() == BaseKind::kFloating ? 6 : 0;
  const int seen = all.num_free + all.num_elastic, b = base + seen;
  MatrixX M_B = MatrixX::Zero(b, b), D_B = MatrixX::Zero(b, b), m = MatrixX::Zero(b, candidates),
          c = MatrixX::Zero(b, candidates), J_B = MatrixX::Zero(J.rows(), b);
  M_B.bottomRightCorner(seen, seen) = all.M.topLeftCorner(seen, seen);
  D_B.bottomRightCorner(seen, seen) = all.D.topLeftCorner(seen, seen);
  m.bottomRows(seen) = all.M.topRightCorner(seen, candidates);
  c.bottomRows(seen) = all.D.topRightCorner(seen, candidates);
  J_B.rightCols(seen).noalias() = J * all.Q.leftCols(seen);
  if (base > 0) {
    M_B.topLeftCorner<6, 6>() = all.M_00;
    M_B.topRightCorner(6, seen) = all.M_0z.leftCols(seen);
    M_B.bottomLeftCorner(seen, 6) = all.M_0z.leftCols(seen).transpose();
    m.topRows<6>() = all.M_0z.rightCols(candidates);
    for (std::size_t e = 0; e < all.interfaces.size(); ++e) {
      const Vector3 p = all.X_RB_ref[all.interfaces[e].u()].translation();
      auto rows = J_B.middleRows(6 * static_cast<Eigen::Index>(e), 6);
      rows.topLeftCorner<3, 3>() = length * Matrix3::Identity();
      rows.block<3, 3>(3, 0) = -Skew(p);
      rows.block<3, 3>(3, 3) = Matrix3::Identity();
    }
  }
  VectorX K_B = VectorX::Zero(b);
  K_B.tail(all.num_elastic).setOnes();
  const VectorX mu = all.M.diagonal().tail(candidates), d = all.D.diagonal().tail(candidates);

  std::vector<double> frequencies;
  for (int i = 0; i < kFrequencies; ++i)
    frequencies.push_back(kLowest * std::pow(kHighest / kLowest, i / double(kFrequencies - 1)));
  for (int i = 0; i < candidates; ++i)
    if (const double f = 1 / (2 * M_PI * std::sqrt(mu(i))); f > kLowest && f < kHighest)
      frequencies.push_back(f);

  // Loads: the weight of the whole on the interface, and gravity on all bodies (or, the same, an acceleration
  // of the base), in every direction. A floating base falls with its bodies.
  MatrixX f_B(b, J.rows() + 3), f(candidates, J.rows() + 3);
  f_B << all.M_00(5, 5) * J_B.transpose(), MatrixX::Zero(b, 3);
  f.setZero();
  if (base == 0) {
    f_B.rightCols(3) = all.M_0z.block(3, 0, 3, seen).transpose();
    f.rightCols(3) = all.M_0z.block(3, seen, 3, candidates).transpose();
  }

  VectorX score = VectorX::Zero(candidates);
  for (const double frequency : frequencies) {
    const Complex s = Laplace(frequency), s2 = s * s;
    ComplexMatrix A{s.real() * D_B + s2.real() * M_B, s.imag() * D_B + s2.imag() * M_B};
    A.re.diagonal() += K_B;
    const ComplexMatrix w{s2.real() * m + s.real() * c, s2.imag() * m + s.imag() * c};
    const ComplexMatrix carried = SolveComplex(A, w);
    const MatrixX moved_re = Times(J_B, carried.re), moved_im = Times(J_B, carried.im);
    const MatrixX driven_re = f - TransposedTimes(carried.re, f_B);
    const MatrixX driven_im = TransposedTimes(carried.im, f_B);
    for (int i = 0; i < candidates; ++i) {
      const double moved = std::hypot(moved_re.col(i).norm(), moved_im.col(i).norm());
      const double driven = std::hypot(driven_re.row(i).norm(), driven_im.row(i).norm());
      const double now = moved * driven / std::abs(1.0 + s * d(i) + s2 * mu(i));
      if (std::isfinite(now)) score(i) = std::max(score(i), now);
    }
  }
  return score;
}

std::vector<int> ContributingModes(const ReducedModel& all, const MatrixX& J, double length, int count) {
  std::vector<int> order(static_cast<std::size_t>(all.num_modes));
  std::iota(order.begin(), order.end(), 0);
  if (count >= all.num_modes) return order;
  const VectorX score = ModeContributions(all, J, length);
  // Among equals, as in a mechanism without damping or coupling, the lower frequency comes first.
  std::stable_sort(order.begin(), order.end(),
                   [&](int i, int k) { return score(i) > (1 + 1e-9) * score(k); });
  order.resize(static_cast<std::size_t>(count));
  std::sort(order.begin(), order.end());
  return order;
}

ModeSelection SelectModesByStep(const Mechanism& mechanism, const Kinematics& kinematics,
                                const ElasticBasis& basis, const MatrixX& Y_r, double step) {
  const MechanismDef& def = mechanism.definition();
  const int num_unobserved = basis.num_elastic() - static_cast<int>(Y_r.cols());
  const int attached = basis.num_free() + static_cast<int>(Y_r.cols());
  const int most = std::max({kMostCoordinatesByStep - attached, attached, def.modes});
  ModeSelection selection{def.modes, def.mode_choice, 1 / (6 * step)};
  const double largest_mu = std::pow(2 * M_PI * selection.below_hz, -2);
  const VectorX mu =
      LowestModes(mechanism, kinematics, basis, Y_r, MatrixX(basis.num_elastic(), 0), MatrixX(0, 0), most + 1)
          .mu;
  const int resolved = static_cast<int>((mu.array() > largest_mu).count());
  if (resolved > most) {
    selection.count = most;
    selection.choice = ModeChoice::kContribution;
  } else {
    // All: later references have all too.
    selection.count = std::max(resolved == num_unobserved ? basis.num_elastic() : resolved, def.modes);
  }
  return selection;
}

}  // namespace fork1s::internal
