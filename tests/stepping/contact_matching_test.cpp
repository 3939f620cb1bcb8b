// Which contact of the last step a contact is.
#include "world/contact_matching.hpp"

#include <gtest/gtest.h>

namespace fork1s {
namespace {

// A ball of radius 1 m, collision body 1, on the world, collision body 0, which has a ball of radius 2 m.
CollisionBodyShapes TwoBalls() {
  CollisionBodyShapes shapes;
  for (const double radius : {2.0, 1.0}) {
    CollisionBodyDef body;
    body.moves = radius == 1;
    body.geometries.emplace_back();
    body.geometries.back().shape = Sphere{radius};
    shapes.Add(body);
  }
  return shapes;
}

ContactPoint At(double x) {
  ContactPoint p;
  p.body_a = p.geometry_a = p.geometry_b = 0;
  p.body_b = 1;
  p.point = Vector3(x, 0, 0);
  p.frame << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return p;
}

ContactRecord Bore(const ContactPoint& point) {
  ContactRecord c;
  c.point = point;
  c.impulse = Vector3(1, 0, 0);
  return c;
}

// With body 1 moved by `x` since the last step.
std::vector<int> Match(const std::vector<ContactPoint>& points, const std::vector<ContactRecord>& previous,
                       double x = 0) {
  std::vector<int> match;
  const RigidTransform start;
  ContactMatcher().Match(TwoBalls(), points, {start, RigidTransform(Vector3(x, 0, 0))}, previous,
                         {start, start}, match);
  return match;
}

TEST(ContactMatching, SizesAreThoseOfTheSmallerShape) {
  const CollisionBodyShapes shapes = TwoBalls();
  EXPECT_DOUBLE_EQ(shapes.PairSize(At(0)), 1);
  EXPECT_DOUBLE_EQ(shapes.InnerPairSize(At(0)), 3);
  EXPECT_DOUBLE_EQ(shapes.least_size, 1);
}

TEST(ContactMatching, IsAnotherContactFartherThanHalfOfTheSize) {
  EXPECT_EQ(Match({At(0.499)}, {Bore(At(0))}), std::vector{0});
  EXPECT_EQ(Match({At(0.501)}, {Bore(At(0))}), std::vector{-1});
}

TEST(ContactMatching, IsAnotherContactWhereTheNormalHasTurnedFar) {
  for (const double cosine : {0.79, 0.81}) {
    ContactPoint turned = At(0);
    const double sine = std::sqrt(1 - cosine * cosine);
    turned.frame << sine, 0, cosine, cosine, 0, -sine, 0, 1, 0;
    EXPECT_EQ(Match({turned}, {Bore(At(0))}), std::vector{cosine > 0.8 ? 0 : -1}) << cosine;
  }
}

// In the world the first would be the nearest to what the second was, and the second none.
TEST(ContactMatching, CornersThatSlideKeepTheirPlaceOnTheirBody) {
  const std::vector<ContactRecord> previous = {Bore(At(0)), Bore(At(0.4))};
  EXPECT_EQ(Match({At(0.25), At(0.65)}, previous, 0.25), (std::vector{0, 1}));
  EXPECT_EQ(Match({At(0.25), At(0.65)}, previous, 0), (std::vector{1, -1}));
}

// Points that have moved by less than 2e-3 of the size are told apart by their places in the world alone.
TEST(ContactMatching, SmallMotionsAreNotFollowedOnTheBodies) {
  const std::vector<ContactRecord> previous = {Bore(At(0)), Bore(At(3e-3))};
  for (const double x : {1.99e-3, 2.01e-3})
    EXPECT_EQ(Match({At(x), At(x + 3e-3)}, previous, x), x < 2e-3 ? (std::vector{1, 0}) : (std::vector{0, 1}))
        << x;
}

TEST(ContactMatching, DoesNotDependOnTheOrderOfDetection) {
  const std::vector<ContactRecord> previous = {Bore(At(0.4)), Bore(At(0)), Bore(At(0.2))};
  EXPECT_EQ(Match({At(0.01), At(0.21), At(0.41)}, previous), (std::vector{1, 2, 0}));
  EXPECT_EQ(Match({At(0.41), At(0.01), At(0.21)}, previous), (std::vector{0, 1, 2}));
}

TEST(ContactMatching, WhatBoreNothingHandsNothingOn) {
  ContactRecord near;
  near.point = At(0);
  EXPECT_EQ(Match({At(0)}, {near}), std::vector{-1});
}

TEST(ContactMatching, ShapesThatDifferAreOtherContacts) {
  ContactPoint other = At(0);
  other.geometry_b = 1;
  EXPECT_EQ(Match({At(0)}, {Bore(other)}), std::vector{-1});
}

}  // namespace
}  // namespace fork1s
