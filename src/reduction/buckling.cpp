#include "reduction/buckling.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/solve.hpp"
#include "linalg/spectrum.hpp"
#include "loaded_mechanism.hpp"

namespace fork1s {
namespace {

// Joint motions without what opens the loops at the pose of `loaded`.
MatrixX ProjectOntoClosedMotions(const Mechanism& mechanism, const internal::LoadedMechanism& loaded,
                                 const VectorX& q, const MatrixX& motions) {
  if (mechanism.num_constraints() == 0) return motions;
  const VectorX& unit = loaded.unit().coordinate;
  const MatrixX A = ScaledClosureRows(mechanism, loaded.kinematics(), q, loaded.unit());
  const MatrixX seen = ComputeNullSpace(A).seen, x = ScaledRows(unit.cwiseInverse(), motions);
  return ScaledRows(unit, x - Times(seen, TransposedTimes(seen, x)));
}

// Zᵀ K_t Z under a share of the dead loads at q, Z the motions that keep loops closed there.
MatrixX StiffnessAt(const Mechanism& mechanism, const VectorX& q, const std::vector<DeadLoad>& loads,
                    double share, const StaticsOptions& options, const MatrixX& motions) {
  std::vector<DeadLoad> scaled = loads;
  for (DeadLoad& load : scaled) {
    load.force_R *= share;
    load.moment_R *= share;
  }
  internal::LoadedMechanism loaded(mechanism, q, scaled, options);
  const MatrixX K = -loaded.Tangent(q, loaded.Reactions(q, 1), 1);
  return Congruence(K, ProjectOntoClosedMotions(mechanism, loaded, q, motions));
}

}  // namespace

Expected<std::vector<BucklingMode>> ComputeBucklingModes(const Mechanism& mechanism, const VectorX& q0,
                                                         const std::vector<DeadLoad>& loads,
                                                         const StaticsOptions& options, int count) {
  const std::string where = fmt::format("mechanism '{}'", mechanism.name());
  const StaticsResult rest = SolveStatics(mechanism, q0, {}, options);
  if (!rest.converged || !rest.tangent.IsStable())
    return Fail(
        ErrorCode::kNumerics, where,
        "has no stable equilibrium without the load, from which it could buckle; stiffen the joints, or "
        "take another gravity");
  const TangentStiffness& tangent = rest.tangent;
  if (tangent.SingularMotions().cols() > 0)
    return Fail(ErrorCode::kUnderdetermined, where,
                "has motions that nothing resists before the load is there, so that "
                "it has no buckling load; give their joints a stiffness, or lock them");
  // V with Vᵀ K_0 V = 1.
  const MatrixX V = ScaledColumns(tangent.eigenvectors, tangent.eigenvalues.cwiseSqrt().cwiseInverse());
  StaticsOptions none = options;
  none.gravity_R.setZero();
  internal::LoadedMechanism loaded(mechanism, rest.q, loads, none);
  const VectorX rate = tangent.Solve(loaded.LoadForce(1));
  // Central differences over motions of a thousandth, in one unit, or over the whole load.
  constexpr double kMotion = 1e-3;
  const double share = kMotion / std::max(kMotion, rate.cwiseQuotient(loaded.unit().coordinate).norm());
  const auto at = [&](double s) { return StiffnessAt(mechanism, rest.q + s * rate, loads, s, options, V); };
  const MatrixX softening = (at(-share) - at(share)) / (2 * share);
  const SymmetricSpectrum spectrum = SpectrumOf(0.5 * (softening + softening.transpose()));
  std::vector<BucklingMode> modes;
  constexpr double kNone = 1e-7;  // what differences leave of loads that soften nothing
  for (Eigen::Index i = spectrum.values.size() - 1; i >= 0 && static_cast<int>(modes.size()) < count; --i) {
    if (spectrum.values(i) * share <= kNone) break;
    BucklingMode mode{1 / spectrum.values(i), Times(V, spectrum.vectors.col(i))};
    Eigen::Index largest;
    mode.q.cwiseAbs().maxCoeff(&largest);
    mode.q /= mode.q(largest);
    modes.push_back(std::move(mode));
  }
  return modes;
}

}  // namespace fork1s
