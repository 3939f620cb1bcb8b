#include "scenes.hpp"

namespace fork1s {
namespace {

using namespace testing;

CollisionBodyDef BallOn(double x, int contype = 1, int conaffinity = 1) {
  CollisionBodyDef ball = Moving(Sphere{0.1}, At(x, 0, 0.0995));
  ball.geometries[0].contype = contype;
  ball.geometries[0].conaffinity = conaffinity;
  return ball;
}

TEST(CollisionFilters, ContypeAndConaffinity) {
  // Balls overlap by 1 mm and none touches the absent ground.
  const auto count = [](int ct_a, int ca_a, int ct_b, int ca_b) {
    return Contacts({BallOn(0, ct_a, ca_a), BallOn(0.199, ct_b, ca_b)}).size();
  };
  EXPECT_EQ(count(1, 1, 1, 1), 1u);
  EXPECT_EQ(count(1, 0, 1, 0), 0u);
  EXPECT_EQ(count(1, 0, 0, 1), 1u);
  EXPECT_EQ(count(2, 0, 1, 2), 1u);
  EXPECT_EQ(count(2, 4, 1, 8), 0u);
  EXPECT_EQ(count(0, 0, 1, 1), 0u);
}

TEST(CollisionFilters, ExcludedPairs) {
  const std::vector<CollisionBodyDef> bodies = {Still(Plane{}), BallOn(0), BallOn(0.199),
                                                Still(Box{Vector3(0.1, 0.1, 0.1)}, At(-0.1995, 0, 0.1))};
  EXPECT_EQ(Contacts(bodies).size(), 4u);
  EXPECT_EQ(Contacts(bodies, {{2, 1}}).size(), 3u);  // moving, moving
  const auto without_ground = Contacts(bodies, {{0, 1}, {1, 2}});
  ASSERT_EQ(without_ground.size(), 2u);  // still, moving: the other still body is not affected
  for (const ContactPoint& c : without_ground) EXPECT_FALSE(c.body_a == 0 && c.body_b == 1);
}

TEST(CollisionFilters, StillBodiesNeverTouch) {
  std::vector<CollisionBodyDef> bodies;
  for (int k = 0; k < 5; ++k) bodies.push_back(Still(Plane{}, At(0, 0, -0.01 * k)));
  bodies.push_back(Still(Box{Vector3(1, 1, 1)}));
  EXPECT_TRUE(Contacts(bodies).empty());
  bodies.push_back(BallOn(3));
  EXPECT_EQ(Contacts(bodies).size(), 1u);
}

TEST(CollisionFilters, ShapesOfOneBodyNeverTouch) {
  EXPECT_TRUE(Contacts({Moving({Geometry(Sphere{0.1}), Geometry(Sphere{0.1}, At(0.1, 0, 0))})}).empty());
}

TEST(CollisionFilters, GeometryIndicesSkipWhatDoesNotCollide) {
  GeometryDef drawn = Geometry(Sphere{0.1}, At(5, 0, 0));
  drawn.contype = drawn.conaffinity = 0;
  const auto contacts =
      Contacts({Moving({drawn, Geometry(Sphere{0.1}, At(9, 0, 0)), Geometry(Sphere{0.1})}, At(0, 0, 0.0995)),
                Still(Plane{})});
  ASSERT_EQ(contacts.size(), 2u);
  EXPECT_EQ(contacts[0].geometry_b + contacts[1].geometry_b, 3);
  EXPECT_EQ(contacts[0].geometry_a, 0);
}

TEST(CollisionFilters, FrictionOfAPair) {
  const auto friction = [](double f1, int p1, bool less1, double f2, int p2, bool less2) {
    CollisionBodyDef a = Still(Plane{}), b = BallOn(0);
    a.geometries[0].friction = f1;
    a.geometries[0].priority = p1;
    a.geometries[0].frictionless = less1;
    b.geometries[0].friction = f2;
    b.geometries[0].priority = p2;
    b.geometries[0].frictionless = less2;
    const auto contacts = Contacts({a, b});
    EXPECT_EQ(contacts.size(), 1u);
    return contacts.empty() ? -1 : contacts[0].friction;
  };
  EXPECT_EQ(friction(0.3, 0, false, 0.8, 0, false), 0.8);
  EXPECT_EQ(friction(0.3, 1, false, 0.8, 0, false), 0.3);
  EXPECT_EQ(friction(0.3, 0, false, 0.8, 1, true), 0);
  EXPECT_EQ(friction(0.3, 0, true, 0.8, 0, true), 0);
  EXPECT_EQ(friction(0.3, 0, true, 0.8, 0, false), 0.8);  // as in MJCF: the larger condim wins
  EXPECT_EQ(friction(0, 0, false, 0, 0, false), 0);
}

TEST(CollisionFilters, RestitutionOfAPair) {
  const auto restitution = [](double e1, int p1, double e2, int p2) {
    CollisionBodyDef a = Still(Plane{}), b = BallOn(0);
    a.geometries[0].restitution = e1;
    a.geometries[0].priority = p1;
    b.geometries[0].restitution = e2;
    b.geometries[0].priority = p2;
    const auto contacts = Contacts({a, b});
    EXPECT_EQ(contacts.size(), 1u);
    return contacts.empty() ? -1 : contacts[0].restitution;
  };
  EXPECT_EQ(restitution(0, 0, 0, 0), 0);
  EXPECT_NEAR(restitution(0.7, 0, 0.7, 0), 0.7, 1e-15);
  EXPECT_NEAR(restitution(0.9, 1, 0.2, 0), 0.9, 1e-15);
  EXPECT_EQ(restitution(0.9, 0, 0, 1), 0);
  // One that does not bounce damps critically: the mean ratio of 1 and 0 is that of exp(-π/√3).
  EXPECT_NEAR(restitution(1, 0, 0, 0), std::exp(-M_PI / std::sqrt(3)), 1e-15);
}

// Balls of 0.1 m on a plane, side by side; more than 32 pairs are sought by a sweep.
std::vector<CollisionBodyDef> RowOfBalls(int balls, double height) {
  std::vector<CollisionBodyDef> bodies = {Still(Plane{})};
  for (int k = 0; k < balls; ++k) bodies.push_back(Moving(Sphere{0.1}, At(0.5 * k, 0, height)));
  return bodies;
}

TEST(ContactPairs, TouchWhateverFiltersSay) {
  ContactPairDef law{"foot", 0.3};
  law.torsion = 0.01;
  law.rolling = 0.002;
  law.restitution = 0.4;
  for (const int balls : {2, 12}) {
    std::vector<CollisionBodyDef> bodies = RowOfBalls(balls, 0.0995);
    bodies[0].geometries[0].contype = bodies[0].geometries[0].conaffinity = 0;
    bodies[0].geometries[0].pairs = bodies[2].geometries[0].pairs = {0};
    bodies[2].geometries[0].contype = bodies[2].geometries[0].conaffinity = 0;
    const auto contacts = Contacts(bodies, {{0, 2}}, {}, {law});
    ASSERT_EQ(contacts.size(), 1u) << balls;
    EXPECT_EQ(std::minmax(contacts[0].body_a, contacts[0].body_b), std::minmax(0, 2));
    EXPECT_EQ(contacts[0].friction, 0.3);
    EXPECT_EQ(contacts[0].torsion, 0.01);
    EXPECT_EQ(contacts[0].rolling, 0.002);
    EXPECT_EQ(contacts[0].restitution, 0.4);
    const auto world = CollisionWorld::Create(bodies, {{0, 2}}, {}, {law});
    const auto pairs = world->PairsThatMayTouch();
    EXPECT_EQ(std::count(pairs.begin(), pairs.end(), std::pair(0, 2)), 1);
  }
}

TEST(ContactPairs, GeometryNamesOneThatExists) {
  std::vector<CollisionBodyDef> bodies = RowOfBalls(1, 0.1);
  bodies[1].geometries[0].pairs = {0};
  EXPECT_FALSE(CollisionWorld::Create(bodies, {}).has_value());
  EXPECT_FALSE(CollisionWorld::Create(bodies, {}, {}, {ContactPairDef{"p", -1}}).has_value());
}

TEST(ContactLaw, NumbersThatCannotBe_AreRefusedByName) {
  const auto problem = [](const auto& change) {
    std::vector<CollisionBodyDef> bodies = RowOfBalls(1, 0.1);
    ContactPairDef law{"p", 1};
    change(bodies[1].geometries[0], law);
    const auto world = CollisionWorld::Create(bodies, {}, {}, {law});
    return world.has_value() ? std::string() : world.error().Text();
  };
  EXPECT_EQ(problem([](GeometryDef&, ContactPairDef&) {}), "");
  EXPECT_NE(problem([](GeometryDef& g, ContactPairDef&) { g.adhesion = -1; }).find("adhesion must be"),
            std::string::npos);
  EXPECT_NE(problem([](GeometryDef& g, ContactPairDef&) {
              g.surface_velocity[2] = std::numeric_limits<double>::quiet_NaN();
            }).find("surface velocity must be"),
            std::string::npos);
  EXPECT_NE(problem([](GeometryDef&, ContactPairDef& p) {
              p.friction_scale[1] = -0.1;
            }).find("by direction must be"),
            std::string::npos);
  EXPECT_NE(problem([](GeometryDef&, ContactPairDef& p) { p.adhesion = -1; }).find("adhesion must be"),
            std::string::npos);
}

TEST(ContactMargin, MovesTheSurfaceOutwards) {
  for (const int balls : {2, 12}) {
    std::vector<CollisionBodyDef> bodies = RowOfBalls(balls, 0.1295);
    bodies[0].geometries[0].margin = 0.01;
    bodies[1].geometries[0].margin = 0.02;
    auto contacts = Contacts(bodies);
    ASSERT_EQ(contacts.size(), 1u) << balls;
    EXPECT_NEAR(contacts[0].gap, -0.0005, 1e-12);
    bodies[0].geometries[0].pairs = bodies[2].geometries[0].pairs = {0};
    ContactPairDef law;
    law.margin = 0.0293;
    contacts = Contacts(bodies, {}, {}, {law});
    ASSERT_EQ(contacts.size(), 2u) << balls;
    EXPECT_NEAR(contacts[1].gap, 0.0002, 1e-12);
  }
}

TEST(CollisionErrors, NameTheGeometry) {
  const auto error = [](Shape shape) {
    CollisionBodyDef body = Moving(std::move(shape));
    body.name = "hand";
    body.geometries[0].name = "palm";
    const auto world = CollisionWorld::Create({Still(Plane{}), body}, {});
    EXPECT_FALSE(world.has_value());
    return world.has_value() ? Error{} : world.error();
  };
  auto flat = std::make_shared<TriangleMesh>();
  flat->vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5f, 0.5f, 0}};
  flat->triangles = {{0, 1, 2}, {1, 3, 2}};
  auto few = std::make_shared<TriangleMesh>();
  few->vertices = {{0, 0, 0}, {1, 0, 0}};
  auto wrong = std::make_shared<TriangleMesh>(*BoxMesh(Vector3::Ones(), Vector3::Zero()).mesh);
  wrong->triangles.emplace_back(0, 1, 99);
  const std::vector<Shape> shapes = {Sphere{0},      Sphere{-1},       Box{Vector3(1, 0, 1)},
                                     Plane{},        Capsule{0.1, -1}, MeshShape{flat},
                                     MeshShape{few}, MeshShape{wrong}, MeshShape{},
                                     HeightField{},  Cylinder{NAN, 1}};
  for (const Shape& shape : shapes) {
    const Error e = error(shape);
    EXPECT_EQ(e.code, ErrorCode::kModel) << ShapeName(shape);
    EXPECT_EQ(e.where, "body hand, geometry palm") << ShapeName(shape) << ": " << e.message;
    EXPECT_FALSE(e.message.empty());
  }
  EXPECT_FALSE(CollisionWorld::Create({Still(Plane{})}, {{0, 7}}).has_value());
  CollisionOptions options;
  options.margin = -1;
  EXPECT_FALSE(CollisionWorld::Create({}, {}, options).has_value());
}

TEST(CollisionErrors, CallerMistakesThrow) {
  auto world = CollisionWorld::Create({Still(Plane{}), BallOn(0)}, {});
  ASSERT_TRUE(world.has_value());
  EXPECT_THROW(world->SetPose(0, {}), std::invalid_argument);
  EXPECT_THROW(world->SetPose(2, {}), std::invalid_argument);
}

TEST(Collision, EmptyWorldsAreFine) {
  EXPECT_TRUE(Contacts({}).empty());
  EXPECT_TRUE(Contacts({Moving(std::vector<GeometryDef>{})}).empty());
  EXPECT_TRUE(Contacts({Still(Plane{})}).empty());
}

TEST(Collision, FullBufferIsReported) {
  // Every one of n balls in one place touches every other: 79800 contacts, for which there is no room.
  constexpr int kBalls = 400;
  std::vector<CollisionBodyDef> bodies;
  for (int k = 0; k < kBalls; ++k) bodies.push_back(Moving(Sphere{0.1}, At(1e-4 * k, 0, 0)));
  auto world = CollisionWorld::Create(bodies, {});
  ASSERT_TRUE(world.has_value()) << world.error().Text();
  std::vector<ContactPoint> contacts;
  for (int repeat = 0; repeat < 2; ++repeat) {
    EXPECT_FALSE(world->Detect(contacts));
    EXPECT_GT(contacts.size(), 1000u);
  }
  for (int k = 0; k < kBalls; ++k) world->SetPose(k, At(k, 0, 0));
  EXPECT_TRUE(world->Detect(contacts));
  EXPECT_TRUE(contacts.empty());
}

}  // namespace
}  // namespace fork1s
