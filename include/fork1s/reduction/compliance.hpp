// The compliance that interface bodies feel, by two roads.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>

namespace fork1s {

/// Compliance of the bodies E (6e x 6e): displacement = C load, per body [rotation; translation] and [moment;
/// force] in world axes about the body's origin, at joint displacements q with the base held.
///
/// By walking the body graph (docs/method.md, equation 3.1): every joint on the paths of two bodies adds
/// S k⁻¹ Sᵀ, loops and unsprung joints then condition the result. Errors: kUnderdetermined where a
/// spring-free motion moves one of the bodies, so that no compliance exists.
Expected<MatrixX> WalkCompliance(const Mechanism& mechanism, const VectorX& q,
                                 const std::vector<BodyIndex>& bodies);

/// The same from the dense elastic basis: C = J V Vᵀ Jᵀ.
Expected<MatrixX> DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                  const std::vector<BodyIndex>& bodies);

/// Inverse of a compliance where it exists: nullopt-like empty matrix if C is singular, which means that the
/// mechanism cannot be pushed in every way at these bodies. `length` makes rotations and translations
/// comparable.
MatrixX StiffnessFromCompliance(const MatrixX& C, double length);

/// Rank of C with the same scaling.
int ComplianceRank(const MatrixX& C, double length);

}  // namespace fork1s
