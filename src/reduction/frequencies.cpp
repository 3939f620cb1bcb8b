#include <fork1s/reduction/frequencies.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "linalg/cholesky.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/spectrum.hpp"
#include "modes.hpp"
#include "reduction/vibration_modes.hpp"

namespace fork1s {
namespace {

std::vector<double> ToHertz(const VectorX& mu, int count) {
  std::vector<double> hertz;
  for (Eigen::Index i = 0; i < mu.size() && i < count; ++i)
    if (mu(i) > 0) hertz.push_back(1 / (2 * std::numbers::pi * std::sqrt(mu(i))));
  return hertz;
}

}  // namespace

VibrationModes ComputeSpringModes(const Mechanism& mechanism, const VectorX& q, int count) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const auto basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  const int n = mechanism.num_coordinates(), e = basis.num_elastic(), f = basis.num_free();
  // Whatever moves without spring (free joints, a floating base) follows its inertia and is eliminated.
  const int b = mechanism.base() == BaseKind::kFloating ? 6 : 0;
  MatrixX coupling(e, b + f), mass(b + f, b + f);
  Matrix6 M_00;
  Matrix6X M_0q;
  if (b > 0) {
    BaseInertia(mechanism, kinematics, M_00, M_0q);
    coupling.leftCols(6) = basis.TimesV(M_0q).transpose();
    mass.topLeftCorner<6, 6>() = M_00;
  }
  const MatrixX N = f > 0 ? basis.DenseFree(n) : MatrixX(n, 0);
  if (f > 0) {
    for (int i = 0; i < f; ++i) {
      VectorX MN;
      ApplyMass(mechanism, kinematics, N.col(i), MN);
      coupling.col(b + i) = basis.ApplyVTransposed(MN);
      mass.block(b, b + i, f, 1) = N.transpose() * MN;
    }
    if (b > 0) {
      mass.topRightCorner(6, f) = M_0q * N;
      mass.bottomLeftCorner(f, 6) = mass.topRightCorner(6, f).transpose();
    }
  }
  const internal::Modes modes =
      internal::LowestModes(mechanism, kinematics, basis, MatrixX(e, 0), coupling, mass, count);
  VibrationModes out{ToHertz(modes.mu, count), {}};
  const auto size = static_cast<Eigen::Index>(out.hertz.size());
  out.shapes.resize(n, size);
  for (Eigen::Index i = 0; i < size; ++i) out.shapes.col(i) = basis.ApplyV(modes.vectors.col(i), n);
  if (f > 0) {
    const MatrixX follows = SolveSymmetric(mass, TransposedTimes(coupling, modes.vectors.leftCols(size)));
    out.shapes -= Times(N, follows.bottomRows(f));
  }
  return out;
}

std::vector<double> FullFrequencies(const Mechanism& mechanism, const VectorX& q, int count) {
  return ComputeSpringModes(mechanism, q, count).hertz;
}

std::vector<double> ReducedFrequencies(const ReducedModel& model, int count) {
  const std::vector<int> sprung = model.SprungColumns(), free = model.FreeColumns();
  const auto f = static_cast<Eigen::Index>(free.size()), e = static_cast<Eigen::Index>(sprung.size());
  const Eigen::Index b = model.mechanism->base() == BaseKind::kFloating ? 6 : 0;
  if (e == 0) return {};
  MatrixX M = RowsAndColumns(model.M, sprung, sprung);
  if (b + f > 0) {
    MatrixX coupling(e, b + f), mass(b + f, b + f);
    if (b > 0) {
      coupling.leftCols(6) = Columns(model.M_0z, sprung).transpose();
      mass.topLeftCorner<6, 6>() = model.M_00;
      mass.topRightCorner(6, f) = Columns(model.M_0z, free);
      mass.bottomLeftCorner(f, 6) = mass.topRightCorner(6, f).transpose();
    }
    coupling.rightCols(f) = RowsAndColumns(model.M, sprung, free);
    mass.bottomRightCorner(f, f) = RowsAndColumns(model.M, free, free);
    M -= Times(coupling, SolveSymmetric(mass, coupling.transpose()));
  }
  const VectorX mu = EigenvaluesOf(0.5 * (M + M.transpose())).reverse();
  return ToHertz(mu, count);
}

}  // namespace fork1s
