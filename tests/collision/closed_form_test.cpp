#include <algorithm>
#include <cmath>

#include "scenes.hpp"

namespace fork1s {
namespace {

using namespace testing;

constexpr double kPi = 3.14159265358979323846;

Vector3 Normal(const ContactPoint& c) { return c.frame.row(0); }

TEST(Collision, SphereOnPlane) {
  const auto contacts = Contacts({Still(Plane{}), Moving(Sphere{0.1}, At(1, 2, 0.099))});
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].body_a, 0);
  EXPECT_EQ(contacts[0].body_b, 1);
  EXPECT_NEAR(contacts[0].gap, -0.001, 1e-14);
  EXPECT_LT((contacts[0].point - Vector3(1, 2, -0.0005)).norm(), 1e-14);
  EXPECT_LT((Normal(contacts[0]) - Vector3::UnitZ()).norm(), 1e-14);
}

TEST(Collision, TiltedPlaneAndShapeOffset) {
  const RigidTransform X(ExpRotation(Vector3(0.3, -0.5, 0.2)), Vector3(0.1, 0.2, 0.3));
  const Vector3 n = X.rotation().col(2);
  const RigidTransform X_BG(Vector3(0.02, -0.01, 0.05));
  const RigidTransform X_WB(ExpRotation(Vector3(1, 2, -0.4)), Vector3::Zero());
  const Vector3 centre = X * Vector3(0.4, -0.2, 0.0495);
  CollisionBodyDef ball = Moving({Geometry(Sphere{0.05}, X_BG)});
  ball.X_WB = RigidTransform(X_WB.rotation(), centre - X_WB.rotation() * X_BG.translation());
  const auto contacts = Contacts({ball, Still(Plane{}, X)});
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].body_a, 1);  // the plane comes first whatever the order of bodies
  EXPECT_NEAR(contacts[0].gap, -0.0005, 1e-12);
  EXPECT_LT((Normal(contacts[0]) - n).norm(), 1e-12);
  EXPECT_LT((contacts[0].point - (centre - 0.04975 * n)).norm(), 1e-12);
}

TEST(Collision, WideMarginsDoNotMisleadGeneralShapes) {
  // A detector that inflates shapes by the margin puts this ellipsoid half a metre into the box at 0.2 m.
  const CollisionOptions wide{.margin = 0.2};
  const CollisionBodyDef floor = Still(Box{Vector3(2.5, 2.5, 0.5)}, At(0, 0, -0.5));
  std::vector<CollisionBodyDef> bodies = {floor,
                                          Moving(Ellipsoid{Vector3(0.14, 0.1, 0.1)}, At(0.2, 0.1, 0.105))};
  const auto few = Contacts(bodies, {}, wide);
  ASSERT_EQ(few.size(), 1u);
  // The search ends at 1e-10.
  EXPECT_NEAR(few[0].gap, 0.005, 1e-9);
  EXPECT_GT(std::abs(Normal(few[0]).z()), 0.999);
  // The same among so many that pairs are not named one by one.
  for (int i = 0; i < 30; ++i) bodies.push_back(Moving(Sphere{0.1}, At(i, 20, 5)));
  const auto many = Contacts(bodies, {}, wide);
  ASSERT_EQ(many.size(), 1u);
  EXPECT_NEAR(many[0].gap, 0.005, 1e-9);
}

TEST(Collision, SphereOnSphere) {
  const Vector3 d = Vector3(1, 2, 2) / 3;
  const auto contacts =
      Contacts({Moving(Sphere{0.1}), Moving(Sphere{0.2}, RigidTransform(Vector3(0.3005 * d)))});
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_NEAR(contacts[0].gap, 0.0005, 1e-14);
  const double sign = contacts[0].body_a == 0 ? 1 : -1;
  EXPECT_LT((Normal(contacts[0]) - sign * d).norm(), 1e-14);
  EXPECT_LT((contacts[0].point - 0.10025 * d).norm(), 1e-14);
}

TEST(Collision, MarginDecides) {
  CollisionOptions options;
  options.margin = 0.01;
  EXPECT_EQ(Contacts({Still(Plane{}), Moving(Sphere{0.1}, At(0, 0, 0.109))}, {}, options).size(), 1u);
  EXPECT_EQ(Contacts({Still(Plane{}), Moving(Sphere{0.1}, At(0, 0, 0.111))}, {}, options).size(), 0u);
  options.margin = 0;
  EXPECT_EQ(Contacts({Still(Plane{}), Moving(Sphere{0.1}, At(0, 0, 0.1001))}, {}, options).size(), 0u);
}

TEST(Collision, LyingCapsuleTouchesTwice) {
  const RigidTransform X(ExpRotation(Vector3(0, kPi / 2, 0)), Vector3(0, 0, 0.0495));
  const auto contacts = Contacts({Still(Plane{}), Moving(Capsule{0.05, 0.2}, X)});
  ASSERT_EQ(contacts.size(), 2u);
  for (const ContactPoint& c : contacts) {
    EXPECT_NEAR(c.gap, -0.0005, 1e-12);
    EXPECT_NEAR(std::abs(c.point.x()), 0.2, 1e-12);
  }
  EXPECT_LT(contacts[0].point.x() * contacts[1].point.x(), 0);
}

TEST(Collision, CapsuleWithoutLengthIsASphere) {
  EXPECT_EQ(Contacts({Still(Plane{}), Moving(Capsule{0.05, 0}, At(0, 0, 0.0495))}).size(), 1u);
}

void ExpectFourCorners(const std::vector<ContactPoint>& contacts, double x, double y, double gap,
                       double tolerance) {
  ASSERT_EQ(contacts.size(), 4u);
  int seen = 0;
  for (const ContactPoint& c : contacts) {
    EXPECT_NEAR(c.gap, gap, tolerance);
    EXPECT_NEAR(std::abs(c.point.x()), x, tolerance);
    EXPECT_NEAR(std::abs(c.point.y()), y, tolerance);
    seen |= 1 << ((c.point.x() > 0 ? 1 : 0) + (c.point.y() > 0 ? 2 : 0));
  }
  EXPECT_EQ(seen, 15);
}

TEST(Collision, BoxOnPlane) {
  const Vector3 half(0.1, 0.2, 0.05);
  ExpectFourCorners(Contacts({Still(Plane{}), Moving(Box{half}, At(0, 0, 0.0495))}), 0.1, 0.2, -0.0005,
                    1e-12);
}

// MuJoCo moves a mesh to its centre of volume; contact must not notice. The mesh stands off its frame.
TEST(Collision, MeshBoxEqualsBoxOnPlane) {
  const Vector3 half(0.1, 0.2, 0.05), shift(0.3, -0.1, 0.7);
  const auto mesh = Contacts(
      {Still(Plane{}), Moving(BoxMesh(half, shift), RigidTransform(Vector3(Vector3(0, 0, 0.0495) - shift)))});
  ASSERT_EQ(mesh.size(), 4u);
  for (const ContactPoint& c : mesh) {
    EXPECT_NEAR(c.gap, -0.0005, 1e-7);
    EXPECT_NEAR(std::abs(c.point.x()), 0.1, 1e-7);
    EXPECT_NEAR(std::abs(c.point.y()), 0.2, 1e-7);
  }
}

TEST(Collision, BadlyOrientedMeshStillHasAHull) {
  MeshShape shape = BoxMesh(Vector3(0.1, 0.1, 0.1), Vector3::Zero());
  auto open = std::make_shared<TriangleMesh>(*shape.mesh);
  std::swap(open->triangles[0].x(), open->triangles[0].y());
  std::swap(open->triangles[5].x(), open->triangles[5].y());
  open->triangles.resize(7);
  for (MeshShape tried : {MeshShape{open}, [&] {
                            auto points = std::make_shared<TriangleMesh>(*shape.mesh);
                            points->triangles.clear();
                            return MeshShape{points};
                          }()}) {
    const auto contacts = Contacts({Still(Plane{}), Moving(tried, At(0, 0, 0.0995))});
    ASSERT_GE(contacts.size(), 3u);
    for (const ContactPoint& c : contacts) EXPECT_NEAR(c.gap, -0.0005, 1e-7);
  }
}

TEST(Collision, BoxOnBoxFace) {
  const auto contacts = Contacts({Still(Box{Vector3(0.2, 0.2, 0.1)}, At(0, 0, -0.1)),
                                  Moving(Box{Vector3(0.05, 0.05, 0.05)}, At(0, 0, 0.0495))});
  ASSERT_EQ(contacts.size(), 4u);
  for (const ContactPoint& c : contacts) {
    EXPECT_NEAR(c.gap, -0.0005, 1e-9);
    EXPECT_NEAR(std::abs(Normal(c).z()), 1, 1e-9);
    EXPECT_NEAR((c.body_a == 0 ? 1 : -1) * Normal(c).z(), 1, 1e-9);
  }
}

TEST(Collision, BoxOnBoxGapIsTheDistanceOfTheSurfaces) {
  const Box large{Vector3(0.2, 0.2, 0.1)}, small{Vector3(0.05, 0.05, 0.05)};
  const RigidTransform tilt(ExpRotation(Vector3(0.2, -0.7, 0.4)), Vector3(0.3, 0.1, 0.2));
  const Quaternion corner_down = Quaternion::FromTwoVectors(Vector3(1, 1, 1).normalized(), -Vector3::UnitZ());
  const double r2 = 0.05 * std::sqrt(2.0), r3 = 0.05 * std::sqrt(3.0);
  const Matrix3 ridge = ExpRotation(Vector3(0, std::atan2(0.2, 0.1), 0));
  for (double gap : {0.0004, -0.0004, -0.003}) {
    const auto deepest = [&](const RigidTransform& X_a, const RigidTransform& X_b) {
      double least = 1;
      for (const ContactPoint& c : Contacts({Still(large, tilt * X_a), Moving(small, tilt * X_b)})) {
        least = std::min(least, c.gap);
      }
      return least;
    };
    EXPECT_NEAR(deepest(At(0, 0, -0.1), RigidTransform(corner_down, Vector3(0.01, 0.02, r3 + gap))), gap,
                1e-9);
    EXPECT_NEAR(deepest(At(0, 0, -0.1),
                        RigidTransform(ExpRotation(Vector3(kPi / 4, 0, 0)), Vector3(0.01, 0, r2 + gap))),
                gap, 1e-9);
    EXPECT_NEAR(deepest(RigidTransform(ridge, Vector3(0, 0, -std::sqrt(0.05))),
                        RigidTransform(ExpRotation(Vector3(kPi / 4, 0, 0)), Vector3(0, 0.02, r2 + gap))),
                gap, 1e-9);
  }
}

TEST(Collision, MultiPointForHulls) {
  const std::vector<CollisionBodyDef> bodies = {
      Still(Box{Vector3(0.2, 0.2, 0.1)}, At(0, 0, -0.1)),
      Moving(BoxMesh(Vector3(0.05, 0.05, 0.05), Vector3::Zero()), At(0, 0, 0.0495))};
  CollisionOptions single;
  single.multi_point = false;
  EXPECT_EQ(Contacts(bodies, {}, single).size(), 1u);
  EXPECT_EQ(Contacts(bodies).size(), 4u);
}

}  // namespace
}  // namespace fork1s
