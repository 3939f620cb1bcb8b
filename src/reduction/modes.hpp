// The lowest vibration modes of elastic coordinates.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>

#include "elastic_basis.hpp"

namespace fork1s::internal {

/// Eigenvectors (columns, orthonormal, within null(Yᵀ)) and eigenvalues µ = 1/ω² [s²], largest first, of
/// Vᵀ M V restricted to the complement of the orthonormal columns of Y. `extra` (e x f) and `extra_mass` (f x
/// f) are eliminated: µ of VᵀMV - extra extra_mass⁻¹ extraᵀ. At most `count`.
struct Modes {
  MatrixX vectors;
  VectorX mu;
};
Modes LowestModes(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                  const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count);

}  // namespace fork1s::internal
