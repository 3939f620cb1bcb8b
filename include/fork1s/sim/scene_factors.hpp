// Scaled variants of a scene, for randomisation in training and for sweeps in design.
#pragma once

#include <fork1s/mechanism/scene.hpp>

namespace fork1s {

struct SceneFactors {
  double stiffness = 1;  // of springs and servo gains; dampers go with its square root
  double friction = 1;   // sliding coefficients of all shapes
  double mass = 1;       // and inertia, of all bodies; the armature of joints stays
  bool operator==(const SceneFactors&) const = default;
};

/// The scene with factors worked in. They must be finite and 0 or more, the mass's above 0.
Scene Vary(Scene scene, const SceneFactors& factors);

}  // namespace fork1s
