// The reduced model at another pose, for who has one of the same mechanism.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>

namespace fork1s {

/// The bits of Reduce at q_ref [n], of which `kinematics` is; what hangs on no pose is taken from `last`.
/// `reactions` [n], empty: none: joint forces of stops, dry frictions and bounds of forces, which have a load
/// column of their own. Errors: as of Reduce.
Expected<ReducedModel> ReduceAgain(const ReducedModel& last, const VectorX& q_ref,
                                   const Kinematics& kinematics, const ReductionOptions& options,
                                   const ReductionLoads* loads = nullptr, const VectorX& reactions = {});

}  // namespace fork1s
