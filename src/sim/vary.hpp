// Factors worked into a scene whose names are known.
#pragma once

#include <algorithm>
#include <array>
#include <fork1s/sim/scene_factors.hpp>
#include <string_view>

namespace fork1s::internal {

/// What a factor of one element may be of, "mass:BODY"; each alone is of all.
inline constexpr std::array<std::string_view, 5> kQuantitiesOfOne = {"stiffness", "friction", "mass",
                                                                     "damping", "frictionloss"};
/// Keys of factors, in messages.
inline constexpr const char* kFactorKeys =
    "stiffness, friction, mass, damping, frictionloss, gravity, mass:BODY, friction:BODY, stiffness:NAME, "
    "damping:NAME, frictionloss:NAME of a joint or tendon";

/// Whether a key is of a quantity that factors have, whatever it names.
inline bool IsOfQuantity(std::string_view key) {
  return key == "gravity" || std::find(kQuantitiesOfOne.begin(), kQuantitiesOfOne.end(),
                                       key.substr(0, key.find(':'))) != kQuantitiesOfOne.end();
}

/// As Vary, for factors that have passed CheckFactors.
Scene VaryChecked(Scene scene, const SceneFactors& factors);

}  // namespace fork1s::internal
