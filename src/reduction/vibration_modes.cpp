#include "reduction/vibration_modes.hpp"

#include <algorithm>

#include "linalg/products.hpp"

namespace fork1s {

std::vector<ModePair> PairModesByShape(const Mechanism& mechanism, const VectorX& q,
                                       const VibrationModes& first, const VibrationModes& second) {
  const Eigen::Index m = first.shapes.cols(), n = second.shapes.cols();
  std::vector<ModePair> pairs(static_cast<std::size_t>(m));
  if (m == 0 || n == 0) return pairs;
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  MatrixX M;
  MassMatrix(mechanism, kinematics, M);
  const MatrixX M_second = Times(M, second.shapes);
  const VectorX first_size = Congruence(M, first.shapes).diagonal(),
                second_size = second.shapes.cwiseProduct(M_second).colwise().sum().transpose();
  MatrixX agreement = TransposedTimes(first.shapes, M_second).cwiseAbs2();
  agreement.array().colwise() /= first_size.array();
  agreement.array().rowwise() /= second_size.transpose().array();
  // Modes at one frequency span their shapes and have none of their own: a shape agrees with their span.
  constexpr double kEqual = 1e-6;  // relative; the stiffness is resolved to 1e-9
  for (Eigen::Index j = 0, end = 0; j < n; j = end) {
    const auto hertz = [&](Eigen::Index i) { return second.hertz[static_cast<std::size_t>(i)]; };
    for (end = j + 1; end < n && hertz(end) <= (1 + kEqual) * hertz(j);) ++end;
    const VectorX sum = agreement.middleCols(j, end - j).rowwise().sum();
    for (Eigen::Index i = j; i < end; ++i) agreement.col(i) = sum;
  }
  // Two modes at one frequency, which a load may part, have their two shapes in any ratio: the better of both pairings has half.
  constexpr double kLeast = 0.5 - 1e-6;
  while (true) {
    Eigen::Index i, j;
    const double most = agreement.maxCoeff(&i, &j);
    if (!(most >= kLeast)) return pairs;
    pairs[static_cast<std::size_t>(i)] = {static_cast<int>(j), most};
    agreement.row(i).setZero();
    agreement.col(j).setZero();
  }
}

}  // namespace fork1s
