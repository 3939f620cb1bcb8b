// Bodies written in one line each, and their contacts.
#pragma once

#include <gtest/gtest.h>

#include <fork1s/collision/collision_world.hpp>
#include <meshes.hpp>

namespace fork1s::testing {

inline GeometryDef Geometry(Shape shape, const RigidTransform& X_BG = {}) {
  GeometryDef g;
  g.shape = std::move(shape);
  g.X_BG = X_BG;
  return g;
}

inline CollisionBodyDef Moving(std::vector<GeometryDef> geometries, const RigidTransform& X_WB = {}) {
  CollisionBodyDef body;
  body.name = "moving";
  body.geometries = std::move(geometries);
  body.X_WB = X_WB;
  return body;
}
inline CollisionBodyDef Moving(Shape shape, const RigidTransform& X_WB = {}) {
  return Moving(std::vector<GeometryDef>{Geometry(std::move(shape))}, X_WB);
}
inline CollisionBodyDef Still(Shape shape, const RigidTransform& X_WB = {}) {
  CollisionBodyDef body = Moving(std::move(shape), X_WB);
  body.name = "still";
  body.moves = false;
  return body;
}
inline RigidTransform At(double x, double y, double z) { return RigidTransform(Vector3(x, y, z)); }

inline std::vector<ContactPoint> Contacts(const std::vector<CollisionBodyDef>& bodies,
                                          const std::vector<std::pair<int, int>>& excluded = {},
                                          const CollisionOptions& options = {},
                                          const std::vector<ContactPairDef>& pairs = {}) {
  std::vector<ContactPoint> contacts;
  Expected<CollisionWorld> world = CollisionWorld::Create(bodies, excluded, options, pairs);
  EXPECT_TRUE(world.has_value()) << (world.has_value() ? "" : world.error().Text());
  if (world.has_value()) {
    EXPECT_TRUE(world->Detect(contacts));
  }
  for (const ContactPoint& c : contacts) {
    EXPECT_LT((c.frame * c.frame.transpose() - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_NEAR(c.frame.determinant(), 1, 1e-12);
    EXPECT_LT(c.gap, options.margin);
  }
  return contacts;
}

}  // namespace fork1s::testing
