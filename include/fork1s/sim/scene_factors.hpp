// Scaled variants of a scene, for randomisation in training and for sweeps in design.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <map>
#include <string>

namespace fork1s {

struct SceneFactors {
  double stiffness = 1;  // of springs and servo gains; dampers go with its square root
  double friction = 1;   // sliding coefficients of all shapes and contact pairs
  double mass = 1;       // and inertia, of all bodies; the armature of joints stays
  /// Others, and those of one element, which multiply with those of all:
  ///   "mass:BODY", mass and inertia; "friction:BODY", sliding coefficients of its shapes and of contact pairs with
  ///   them, of the still world "friction:world"; "stiffness:NAME" of a joint, a tendon or the servo of a tendon, as
  ///   SetStiffness; "damping" and "damping:NAME", of dampers and servos together; "frictionloss" and
  ///   "frictionloss:NAME", dry friction of a joint or tendon; "gravity".
  std::map<std::string, double> named = {};
  bool operator==(const SceneFactors&) const = default;
};

/// Sets the factor of that key: "stiffness", "friction", "mass" or one of SceneFactors::named.
void SetFactor(const std::string& key, double factor, SceneFactors& factors);

/// Errors: kUsage for factors that are not finite or below 0, those of mass and of named stiffnesses also where they are
/// 0, and for keys of SceneFactors::named that name nothing in the scene, with those most like them.
Expected<void> CheckFactors(const Scene& scene, const SceneFactors& factors);

/// The scene with factors worked in, which must pass CheckFactors.
Scene Vary(Scene scene, const SceneFactors& factors);

}  // namespace fork1s
