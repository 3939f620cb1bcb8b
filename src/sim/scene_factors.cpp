#include <fork1s/sim/scene_factors.hpp>

#include <cmath>
#include <fork1s/mechanism/mechanism.hpp>

#include "mechanism/sensor_stiffness.hpp"

namespace fork1s {
namespace {

void ScaleFriction(double factor, std::vector<GeometryDef>& geometries) {
  for (GeometryDef& g : geometries) g.friction *= factor;
}

void ScaleMass(double factor, SpatialInertia& inertia) {
  inertia.mass *= factor;
  inertia.rotational *= factor;
}

}  // namespace

Scene Vary(Scene scene, const SceneFactors& factors) {
  for (const auto& [what, factor] :
       {std::pair{"stiffness", factors.stiffness}, {"friction", factors.friction}, {"mass", factors.mass}})
    FORK1S_REQUIRE(std::isfinite(factor) && factor >= 0, what, "by", factor, "; give a factor of 0 or more");
  FORK1S_REQUIRE(factors.mass > 0, "mass by 0; give a factor above 0");
  if (factors.stiffness != 1) {
    for (MechanismDef& def : scene.mechanisms) def = ScaleStiffness(std::move(def), factors.stiffness);
    internal::ScaleSensorLaws(factors.stiffness, scene);
  }
  for (MechanismDef& def : scene.mechanisms)
    for (BodyDef& b : def.bodies) {
      ScaleFriction(factors.friction, b.geometries);
      ScaleMass(factors.mass, b.inertia);
    }
  for (FreeBodyDef& b : scene.free_bodies) {
    ScaleFriction(factors.friction, b.geometries);
    ScaleMass(factors.mass, b.inertia);
  }
  ScaleFriction(factors.friction, scene.world);
  return scene;
}

}  // namespace fork1s
