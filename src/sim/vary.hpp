// Factors worked into a scene whose names are known.
#pragma once

#include <fork1s/sim/scene_factors.hpp>

namespace fork1s::internal {

/// As Vary, for factors that have passed CheckFactors.
Scene VaryChecked(Scene scene, const SceneFactors& factors);

}  // namespace fork1s::internal
