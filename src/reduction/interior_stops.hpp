// Joints that the reduction would leave to statics although a stop, a servo's bound or dry friction acts on them.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>

#include "elastic_basis.hpp"

namespace fork1s::internal {

/// Indices of what acts on condensed DOFs of `model`, which has its complement: length limits first, then force
/// limits, then dry frictions of the mechanism. Static corrections are those under weight in any direction and the
/// largest actuator forces.
std::vector<int> FindInteriorStops(const ReducedModel& model, const Kinematics& kinematics);
/// Parts of the basis that move the lengths of those.
std::vector<char> PartsOfStops(const Mechanism& mechanism, const Kinematics& kinematics,
                               const ElasticBasis& basis, const std::vector<int>& stops);
/// "joint 'elbow'", "actuator 'servo'", "dry friction 'pin'"
std::string NameOfStop(const Mechanism& mechanism, int stop);

}  // namespace fork1s::internal
