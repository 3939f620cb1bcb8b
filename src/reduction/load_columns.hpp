// Static answers of condensed motions to loads, as coordinates.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <string>
#include <vector>

#include "elastic_basis.hpp"

namespace fork1s::internal {

/// Load-dependent Ritz vectors (Wilson, Yuan & Dickens 1982) in the elastic coordinates y of `basis`, where
/// the static answer to joint forces g is Vᵀ g: orthonormal, also to `kept` (e x k, orthonormal), each of one
/// part. `reactions` [n], empty: none: joint forces of stops, dry frictions and bounds of forces.
struct LoadColumns {
  MatrixX vectors;                 // e x loads
  std::vector<std::string> names;  // "weight z (joint that moves most)"
};

LoadColumns ComputeLoadColumns(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q_ref,
                               const ElasticBasis& basis, const MatrixX& kept, const ReductionLoads& loads,
                               const VectorX& reactions);

}  // namespace fork1s::internal
