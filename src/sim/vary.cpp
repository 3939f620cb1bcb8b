#include <fork1s/sim/vary.hpp>

#include <cmath>
#include <fork1s/mechanism/mechanism.hpp>

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
  for (const double f : {factors.stiffness, factors.friction, factors.mass})
    FORK1S_REQUIRE(std::isfinite(f) && f >= 0, f);
  FORK1S_REQUIRE(factors.mass > 0, factors.mass);
  if (factors.stiffness != 1)
    for (MechanismDef& def : scene.mechanisms) def = ScaleStiffness(std::move(def), factors.stiffness);
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
