#include "reduction/tangent_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "elastic_basis.hpp"
#include "free_motions.hpp"
#include "linalg/cholesky.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/spectrum.hpp"
#include "loaded_mechanism.hpp"
#include "locked_basis.hpp"
#include "world_axes.hpp"

namespace fork1s {
namespace {

std::vector<int> Singular(const TangentStiffness& t) {
  std::vector<int> at;
  for (Eigen::Index i = 0; i < t.eigenvalues.size(); ++i)
    if (std::abs(t.eigenvalues(i)) <= t.zero) at.push_back(static_cast<int>(i));
  return at;
}

std::vector<int> Regular(const TangentStiffness& t) {
  std::vector<int> at;
  for (Eigen::Index i = 0; i < t.eigenvalues.size(); ++i)
    if (std::abs(t.eigenvalues(i)) > t.zero) at.push_back(static_cast<int>(i));
  return at;
}

}  // namespace

MatrixX TangentStiffness::SingularMotions() const { return Columns(eigenvectors, Singular(*this)); }

VectorX TangentStiffness::Solve(const VectorX& g) const {
  const std::vector<int> regular = Regular(*this);
  const MatrixX V = Columns(eigenvectors, regular);
  return Times(V, VectorX(TransposedTimes(V, g)).cwiseQuotient(Entries(eigenvalues, regular)));
}

TangentStiffness ComputeTangentStiffness(const Mechanism& mechanism, const VectorX& q,
                                         const std::vector<DeadLoad>& loads, const StaticsOptions& options) {
  internal::LoadedMechanism loaded(mechanism, q, loads, options);
  const MatrixX K = -loaded.Tangent(q, loaded.Reactions(q, 1), 1);
  const VectorX& unit = loaded.unit().coordinate;
  // Orthonormal in one unit.
  MatrixX Z = ScaledRows(unit.cwiseInverse(), internal::ClosedMotions(mechanism, loaded.kinematics(), q));
  Z = internal::WithLocked(Z, VectorX::Ones(q.size()), options.locked);
  const MatrixX K_z = Congruence(ScaledColumns(ScaledRows(unit, K), unit), Z);
  const SymmetricSpectrum spectrum = SpectrumOf(0.5 * (K_z + K_z.transpose()));
  TangentStiffness out;
  out.eigenvalues = spectrum.values;
  out.eigenvectors = ScaledRows(unit, Times(Z, spectrum.vectors));
  if (out.eigenvalues.size() > 0) out.zero = internal::SingularStiffness(out.eigenvalues, loaded.Scale(q, 1));
  return out;
}

VibrationModes ComputeTangentModes(const Mechanism& mechanism, const VectorX& q,
                                   const TangentStiffness& tangent, int count) {
  VibrationModes out;
  out.shapes.resize(q.size(), 0);
  if (!tangent.IsStable()) return out;
  const std::vector<int> singular = Singular(tangent), sprung = Regular(tangent);
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  MatrixX M;
  MassMatrix(mechanism, kinematics, M);
  MatrixX V = ScaledColumns(Columns(tangent.eigenvectors, sprung),
                            Entries(tangent.eigenvalues, sprung).cwiseSqrt().cwiseInverse());
  const MatrixX N = Columns(tangent.eigenvectors, singular);
  MatrixX M_v = Congruence(M, V);
  if (N.cols() > 0) {  // they follow their inertia
    const MatrixX coupling = TransposedTimes(V, Times(M, N));
    const MatrixX follows = SolveSymmetric(Congruence(M, N), coupling.transpose());
    M_v -= Times(coupling, follows);
    V -= Times(N, follows);
  }
  const SymmetricSpectrum spectrum = SpectrumOf(0.5 * (M_v + M_v.transpose()));
  std::vector<int> kept;
  for (auto i = static_cast<int>(spectrum.values.size()) - 1; i >= 0 && static_cast<int>(kept.size()) < count;
       --i)
    if (spectrum.values(i) > 0) {
      kept.push_back(i);
      out.hertz.push_back(1 / (2 * std::numbers::pi * std::sqrt(spectrum.values(i))));
    }
  out.shapes = Times(V, Columns(spectrum.vectors, kept));
  return out;
}

std::vector<double> TangentFrequencies(const Mechanism& mechanism, const VectorX& q,
                                       const TangentStiffness& tangent, int count) {
  return ComputeTangentModes(mechanism, q, tangent, count).hertz;
}

InterfaceCompliance TangentCompliance(const Mechanism& mechanism, const VectorX& q,
                                      const TangentStiffness& tangent, const std::vector<BodyPoint>& points) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  std::vector<BodyIndex> bodies;
  for (const BodyPoint& point : points) bodies.push_back(point.body);
  MatrixX J = internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto row = 6 * static_cast<Eigen::Index>(i);
    const Vector3 arm = kinematics.X_RB[points[i].body.u()].rotation() * points[i].p_B;
    J.middleRows(row + 3, 3) -= Skew(arm) * J.middleRows(row, 3);
  }
  const double L = mechanism.length_scale();
  const std::vector<int> regular = Regular(tangent);
  const internal::FreeMotions free =
      internal::FreeMotionsOf(internal::InLengths(Times(J, tangent.SingularMotions()), L));
  const MatrixX V = Times(J, Columns(tangent.eigenvectors, regular));
  InterfaceCompliance out;
  out.C = internal::WithoutFree(
      mechanism, DiagonalCongruence(Entries(tangent.eigenvalues, regular).cwiseInverse(), V.transpose()),
      free);
  out.free = Times(internal::WorldAxes(mechanism, points.size()), internal::FromLengths(free.basis, L));
  out.rank = ComputeNullSpace(free.Without(internal::InLengths(V, L))).rank.value;
  return out;
}

}  // namespace fork1s
