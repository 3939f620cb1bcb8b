// Where flat shapes rest on each other: points that are on both surfaces, and that hold what lies there.
#include <algorithm>
#include <cmath>
#include <random>

#include "scenes.hpp"

namespace fork1s {
namespace {

using namespace testing;

// Vertices of meshes are floats: 6e-8 of 0.1 m.
constexpr double kSingle = 1e-8;

struct FlatPair {
  Shape a, b;
  double height_a, height_b;  // of the face that touches over the origin, along z
  std::size_t points;
};

MeshShape Block(const Vector3& half) { return BoxMesh(half, Vector3::Zero()); }

// Every kind that has a flat face on every other, turned about the normal and moved aside.
TEST(Patch, FlatFaces_Overlap_RestOnItsCorners) {
  const Vector3 large(0.2, 0.2, 0.1), small(0.05, 0.03, 0.04);
  const std::vector<FlatPair> pairs = {{Box{large}, Box{small}, 0.1, 0.04, 4},
                                       {Box{large}, Block(small), 0.1, 0.04, 4},
                                       {Block(large), Block(small), 0.1, 0.04, 4},
                                       {Box{large}, Cylinder{0.05, 0.04}, 0.1, 0.04, 8},
                                       {Block(large), Cylinder{0.05, 0.04}, 0.1, 0.04, 8},
                                       {Cylinder{0.3, 0.1}, Cylinder{0.05, 0.04}, 0.1, 0.04, 8}};
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(-1, 1);
  for (std::size_t k = 0; k < pairs.size(); ++k)
    for (const double gap : {-0.002, -1e-6, 1e-6, 0.0009}) {
      const FlatPair& pair = pairs[k];
      const RigidTransform X(ExpRotation(Vector3(u(random), u(random), u(random))),
                             Vector3(u(random), u(random), u(random)));
      const Vector3 aside(0.05 * u(random), 0.05 * u(random), pair.height_a + pair.height_b + gap);
      const RigidTransform X_AB(ExpRotation(Vector3(0, 0, 3 * u(random))), aside);
      const auto contacts = Contacts({Moving(pair.a, X), Moving(pair.b, X * X_AB)});
      ASSERT_EQ(contacts.size(), pair.points) << k << ' ' << gap;
      const Vector3 normal = X.rotation().col(2);
      Vector3 low = Vector3::Constant(1), high = -low;  // of the points, in the frame of b
      for (const ContactPoint& c : contacts) {
        EXPECT_NEAR(c.gap, gap, 2 * kSingle) << k;
        const double side = c.body_a == 0 ? 1 : -1;
        EXPECT_LT((side * c.frame.row(0).transpose() - normal).norm(), 1e-6) << k;  // 2 floats over 0.05 m
        const Vector3 p = (X * X_AB).inverse() * c.point;
        EXPECT_NEAR(p.z(), -pair.height_b - gap / 2, 2 * kSingle) << k;
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
      // They hold its weight wherever that is: as far out as the face, or the square in its round one.
      const double half_x = std::holds_alternative<Cylinder>(pair.b) ? 0.05 / std::sqrt(2.0) : small.x();
      const double half_y = std::holds_alternative<Cylinder>(pair.b) ? 0.05 / std::sqrt(2.0) : small.y();
      EXPECT_LT(low.x(), -half_x + 2 * kSingle) << k;
      EXPECT_GT(high.x(), half_x - 2 * kSingle) << k;
      EXPECT_LT(low.y(), -half_y + 2 * kSingle) << k;
      EXPECT_GT(high.y(), half_y - 2 * kSingle) << k;
    }
}

// What rests presses in by 10 um and sways by less. Points that then change from step to step keep it swaying: a stack
// of turned boxes rested on the four of eight corners that were deeper, and shook by 0.2 % of its weight for ever.
TEST(Patch, FlatFaces_TiltedAsAtRest_KeepTheirPoints) {
  const double half = 0.05;
  const std::vector<Shape> shapes = {Box{Vector3::Constant(half)},          Cylinder{half, half},
                                     Shape(Block(Vector3::Constant(half))), Shape(PrismMesh(5, half, half)),
                                     Shape(PrismMesh(12, half, half)),      Shape(PrismMesh(16, half, half)),
                                     Shape(PrismMesh(17, half, half)),      Shape(PrismMesh(32, half, half))};
  std::vector<CollisionBodyDef> under = {Still(Plane{}, At(0, 0, -half))};
  for (const Shape& shape : shapes) under.push_back(Moving(shape));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(-1, 1);
  for (std::size_t k = 0; k < under.size(); ++k)
    for (std::size_t l = 0; l < shapes.size(); ++l) {
      if (k > l + 1) continue;  // each pair once
      SCOPED_TRACE(std::to_string(k) + " under " + std::to_string(l));
      if (k > 0) under[k].X_WB = At(0, 0, -2 * half);
      auto world = CollisionWorld::Create({under[k], Moving(shapes[l])}, {});
      ASSERT_TRUE(world.has_value());
      const Matrix3 turned = ExpRotation(Vector3(0, 0, 0.1));
      const auto points = [&](double tilt) {
        world->SetPose(1, RigidTransform(ExpRotation(tilt * Vector3(u(random), u(random), 0)) * turned,
                                         Vector3(0, 0, -5e-6)));
        std::vector<ContactPoint> contacts;
        EXPECT_TRUE(world->Detect(contacts));
        return contacts;
      };
      const auto level = points(0);
      EXPECT_LE(level.size(), 17u);
      for (int trial = 0; trial < 30; ++trial) {
        const auto swaying = points(5e-5);
        ASSERT_EQ(swaying.size(), level.size());
        for (const ContactPoint& c : swaying)
          EXPECT_TRUE(std::any_of(level.begin(), level.end(), [&](const ContactPoint& d) {
            // Corners are 6 mm apart or more, but where two round faces overlap: there a neighbour serves as well.
            return (d.point - c.point).norm() < 5e-3;
          })) << c.point.transpose();
      }
    }
}

TEST(Patch, AFaceThatOverhangsRestsOnWhatIsUnderIt) {
  // The upper box lies over the corner of the lower one by 30 x 20 mm.
  const auto contacts = Contacts(
      {Moving(Box{Vector3(0.1, 0.1, 0.1)}), Moving(Box{Vector3(0.05, 0.05, 0.05)}, At(0.12, 0.13, 0.1495))});
  ASSERT_EQ(contacts.size(), 4u);
  for (const ContactPoint& c : contacts) {
    EXPECT_NEAR(c.gap, -0.0005, 1e-12);
    EXPECT_NEAR(std::abs(c.point.x() - 0.085), 0.015, 1e-12);
    EXPECT_NEAR(std::abs(c.point.y() - 0.09), 0.01, 1e-12);
  }
}

TEST(Patch, ATiltedFaceLooksAhead) {
  // A box that will come down flat: its other corners are contacts before they touch.
  const double tilt = 0.02, half = 0.05;
  const RigidTransform X(ExpRotation(Vector3(0, tilt, 0)), Vector3(0, 0, 0.1));
  const double lowest = 0.1 - half * (std::sin(tilt) + std::cos(tilt));
  for (const Shape& shape :
       {Shape(Box{Vector3(half, half, half)}), Shape(Block(Vector3(half, half, half)))}) {
    const auto contacts =
        Contacts({Moving(Box{Vector3(0.2, 0.2, 0.1)}, At(0, 0, -0.1 + lowest - 0.0002)), Moving(shape, X)},
                 {}, {.margin = 0.01});
    ASSERT_EQ(contacts.size(), 4u);
    std::vector<double> gaps;
    for (const ContactPoint& c : contacts) gaps.push_back(c.gap);
    std::sort(gaps.begin(), gaps.end());
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_NEAR(gaps[i], i < 2 ? 0.0002 : 0.0002 + 2 * half * std::sin(tilt), kSingle);
  }
}

TEST(Patch, LinesRestOnTwoPoints) {
  const RigidTransform lying(ExpRotation(Vector3(0, 3.14159265358979323846 / 2, 0)), Vector3(0, 0, 0.0499));
  for (const Shape& shape : {Shape(Capsule{0.05, 0.1}), Shape(Cylinder{0.05, 0.1})})
    for (const Shape& ground : {Shape(Box{Vector3(0.2, 0.2, 0.1)}), Shape(Block(Vector3(0.2, 0.2, 0.1)))}) {
      const auto contacts = Contacts({Moving(ground, At(0, 0, -0.1)), Moving(shape, lying)});
      ASSERT_EQ(contacts.size(), 2u);
      for (const ContactPoint& c : contacts) {
        EXPECT_NEAR(c.gap, -0.0001, 2 * kSingle);
        EXPECT_NEAR(std::abs(c.point.x()), 0.1,
                    1e-6);  // the search ends at 1e-10 m of the gap, some of the place
      }
    }
  // Across each other: one.
  const RigidTransform across(ExpRotation(Vector3(0, 0, 1)) * lying.rotation(), Vector3(0, 0, 0.1499));
  EXPECT_EQ(Contacts({Moving(Cylinder{0.05, 0.1}, lying), Moving(Cylinder{0.05, 0.1}, across)}, {},
                     {.margin = 1e-6})
                .size(),
            1u);
}

// A cylinder that stands on a plane, on either end, turned about its axis and tilted by down to nothing: what is nearest
// is the rim, |sin tilt| of the radius below the middle of the end.
TEST(Patch, CylindersStandOnPlanesHoweverLevel) {
  const double radius = 0.04, half = 0.01, depth = 1e-4;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> turn(-3.1, 3.1);
  for (const double tilt : {0.0, 1e-17, 1e-16, 1e-15, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4})
    for (const bool upside_down : {false, true})
      for (int trial = 0; trial < 60; ++trial) {
        const double direction = turn(random);
        const Matrix3 R =
            ExpRotation(tilt * Vector3(std::cos(direction), std::sin(direction), 0)) *
            ExpRotation(upside_down ? Vector3(3.14159265358979323846, 0, 0) : Vector3(0, 0, 0)) *
            ExpRotation(Vector3(0, 0, turn(random)));
        const auto contacts =
            Contacts({Still(Plane{}, At(0, 0, 0)),
                      Moving(Cylinder{radius, half}, RigidTransform(R, Vector3(0.3, -0.2, half - depth)))},
                     {}, {.margin = 1e-3});
        ASSERT_EQ(contacts.size(), 8u) << tilt << " " << trial;
        double deepest = 0;
        for (const ContactPoint& c : contacts) {
          deepest = std::min(deepest, c.gap);
          EXPECT_NEAR((c.point - Vector3(0.3, -0.2, 0)).head<2>().norm(), radius, 1e-9 + 1.1 * half * tilt);
        }
        // Where the tilt is not told from rounding, one of eight points of the rim is within 22.5 degrees.
        EXPECT_NEAR(deepest, -depth - radius * std::sin(tilt), 1e-12 + 0.08 * radius * tilt)
            << tilt << " " << trial;
      }
}

// The distance of two surfaces where a plane across the first, at `station` along its axis z, cuts them: of a round side of
// radius r about z and another about the line p + t v, or an edge, radius 0.
double DistanceAt(double station, double r, const Vector3& p, const Vector3& v, double radius) {
  const Vector3 on_axis = p + (station - p.z()) / v.z() * v;
  return on_axis.head<2>().norm() - r - radius;
}

// Round sides that lie nearly along an edge or along each other. The one point that touches runs from one end to the other
// where they tilt by some 1e-4 rad: a wheel on the edge of a stone rocked between the two in every iteration of a step.
TEST(Patch, LinesNearlyParallel_ApartByMicrometres_BearAtBothEnds) {
  constexpr double kHalf = 0.1, kRadius = 0.3, kOther = 0.02, kApart = 2e-4;
  constexpr double kSearched = 1e-6;  // m: what the search for the nearest point of a mesh leaves
  struct Case {
    Shape shape, other;
    double radius;          // of the other
    RigidTransform X_line;  // its pose in a frame with its line along z and the shape at y < 0
  };
  // The edge of a box at its corner (x, y) = (-0.05, -0.05), seen along the diagonal.
  const double turn = 3.14159265358979323846 / 4, corner = 0.05;
  const RigidTransform turned(ExpRotation(Vector3(0, 0, turn)), Vector3::Zero());
  const RigidTransform from_edge = turned * RigidTransform(Vector3(corner, corner, 0));
  const std::vector<Case> cases = {
      {Cylinder{kRadius, kHalf}, Box{Vector3(corner, corner, 0.4)}, 0, from_edge},
      {Cylinder{kRadius, kHalf}, Shape(Block(Vector3(corner, corner, 0.4))), 0, from_edge},
      {Capsule{kRadius, kHalf}, Box{Vector3(corner, corner, 0.4)}, 0, from_edge},
      {Cylinder{kRadius, kHalf}, Cylinder{kOther, 0.4}, kOther, {}},
      {Cylinder{kRadius, kHalf}, Capsule{kOther, 0.4}, kOther, {}},
      {Capsule{kRadius, kHalf}, Capsule{kOther, 0.4}, kOther, {}}};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (std::size_t k = 0; k < cases.size(); ++k)
    for (const double angle : {0.0, 1e-9, 1e-7, 1e-5, 1e-4, 1e-3, 5e-3, 9.9e-3, 0.0101, 0.02, 0.05, 0.09})
      for (const double tilt : {0.0, -1e-6, 1e-5}) {
        SCOPED_TRACE(::testing::Message() << k << " crossed by " << angle << " tilted by " << tilt);
        // The line runs beside the shape at the distance kRadius + radius + kApart along the diagonal y.
        const Case& c = cases[k];
        const Matrix3 crossed = ExpRotation(Vector3(0, angle, 0)) * ExpRotation(Vector3(tilt, 0, 0));
        const Vector3 middle(0, kRadius + c.radius + kApart, 0);
        const RigidTransform X_line(crossed, middle), X(ExpRotation(Vector3(u(random), u(random), u(random))),
                                                        Vector3(u(random), u(random), u(random)));
        const RigidTransform X_other = X_line * c.X_line;
        for (const bool reversed : {false, true}) {
          std::vector<CollisionBodyDef> bodies = {Moving(c.shape, X), Moving(c.other, X * X_other)};
          if (reversed) std::swap(bodies[0], bodies[1]);
          const auto contacts = Contacts(bodies, {}, {.margin = 5e-3});
          bool lower = false, upper = false;
          for (const ContactPoint& contact : contacts) {
            const Vector3 p = X.inverse() * contact.point;
            if (std::abs(std::abs(p.z()) - kHalf) > 1e-3 * kHalf) continue;
            const double truth =
                DistanceAt(std::copysign(kHalf, p.z()), kRadius, middle, crossed.col(2), c.radius);
            // The plane lies across the one, not the other, whose section is an ellipse.
            if (std::abs(contact.gap - truth) < kSearched + c.radius * angle * angle)
              (p.z() > 0 ? upper : lower) = true;
          }
          EXPECT_TRUE(lower && upper) << contacts.size();
        }
      }
}

// By the normal of the rim alone; one across the axis beside it asked for another motion of the same place.
TEST(Patch, LinesNearlyParallel_DeepestAtAnEnd_HaveOnePointThere) {
  constexpr double kHalf = 0.1, kRadius = 0.3, kCorner = 0.05;
  const RigidTransform edge =
      RigidTransform(ExpRotation(Vector3(0, 0, 3.14159265358979323846 / 4)), Vector3::Zero()) *
      RigidTransform(Vector3(kCorner, kCorner, 0));
  for (const Shape& shape : {Shape(Cylinder{kRadius, kHalf}), Shape(Capsule{kRadius, kHalf})})
    for (const double angle : {0.0, 1e-3, 0.02, 0.05})
      for (const double tilt : {1e-4, 1e-3, 5e-3}) {
        SCOPED_TRACE(::testing::Message() << "crossed by " << angle << " tilted by " << tilt);
        const Matrix3 crossed = ExpRotation(Vector3(0, angle, 0)) * ExpRotation(Vector3(tilt, 0, 0));
        const RigidTransform X_line(crossed, Vector3(0, kRadius + 1e-3, 0));
        const auto contacts =
            Contacts({Moving(shape), Moving(Box{Vector3(kCorner, kCorner, 0.4)}, X_line * edge)}, {},
                     {.margin = 5e-3});
        ASSERT_FALSE(contacts.empty());
        const auto deepest = std::min_element(contacts.begin(), contacts.end(),
                                              [](const auto& c, const auto& d) { return c.gap < d.gap; });
        if (std::abs(std::abs(deepest->point.z()) - kHalf) > 1e-3 * kHalf) continue;  // between the ends
        EXPECT_EQ(std::count_if(contacts.begin(), contacts.end(),
                                [&](const ContactPoint& c) {
                                  return (c.point - deepest->point).norm() < 1e-3 * kHalf;
                                }),
                  1);
      }
}

TEST(Patch, LinesThatCross_TouchInOnePoint) {
  const auto count = [](double angle, double half) {
    const RigidTransform across(ExpRotation(Vector3(angle, 0, 0)), Vector3(0.1001, 0, 0));
    return Contacts({Moving(Cylinder{0.05, half}), Moving(Cylinder{0.05, half}, across)}, {},
                    {.margin = 0.02})
        .size();
  };
  // Ends pass each other where they lie aside by a third of the distance of the axes: 0.09 rad at 0.365 m.
  EXPECT_EQ(count(0.09, 0.35), 3u);
  EXPECT_EQ(count(0.09, 0.38), 1u);
  EXPECT_EQ(count(0.0999, 0.1), 3u);
  EXPECT_EQ(count(0.1003, 0.1), 1u);  // its sine is above 0.1
}

// A beam that lies across two bars. MuJoCo's routine for capsule and box named one edge of it, or none, by
// the last digit of the pose, and the beam tipped over the other.
TEST(Patch, ACapsuleThatStandsOutOfAFaceBearsAtItsEdges) {
  const Vector3 half(0.45, 0.028, 0.016);
  const RigidTransform along_y(ExpRotation(Vector3(-3.14159265358979323846 / 2, 0, 0)), Vector3::Zero());
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 200; ++i) {
    SCOPED_TRACE(i);
    const bool level = i < 100;  // exactly, and nearly so
    const RigidTransform X(
        level ? Matrix3(Matrix3::Identity()) : ExpRotation(Vector3(u(random), u(random), u(random))),
        Vector3(u(random), u(random), u(random)));
    const double gap = 1e-4 * u(random);
    const Matrix3 turned = ExpRotation(Vector3(0, 0, 0.2 * u(random)));
    const RigidTransform beam(turned, turned * Vector3(0.3 * u(random), 0, 0.012 + half.z() + gap));
    const auto contacts = Contacts({Moving(Capsule{0.012, 0.04}, X * along_y), Moving(Box{half}, X * beam)});
    ASSERT_EQ(contacts.size(), 2u);
    double sides = 1;
    for (const ContactPoint& c : contacts) {
      EXPECT_NEAR(c.gap, gap, 1e-9);
      const Vector3 p = (X * beam).inverse() * c.point;
      EXPECT_NEAR(std::abs(p.y()), half.y(), 1e-6);
      sides *= p.y();
    }
    EXPECT_LT(sides, 0);
  }
}

// No direction parts them sooner than the normal: along n they are apart by |n . p| - h |n . u| - |Rn| . half - r.
TEST(Patch, ACapsuleThatPiercesABoxIsAsDeepAsTheShortestWayOut) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> u(-1, 1);
  const Capsule capsule{0.004, 0.08};
  for (int i = 0; i < 200; ++i) {
    SCOPED_TRACE(i);
    const Vector3 half(0.5, 0.4, i % 2 == 0 ? 0.002 : 0.05);
    const bool upright = i < 20;
    const RigidTransform X =
        upright ? At(0.3 * u(random), 0.3 * u(random), 0.07 * u(random))
                : RigidTransform(ExpRotation(2 * Vector3(u(random), u(random), u(random))),
                                 Vector3(0.3 * u(random), 0.3 * u(random), half.z() * u(random)));
    const auto contacts = Contacts({Moving(capsule, X), Moving(Box{half})});
    ASSERT_FALSE(contacts.empty());
    const ContactPoint& deepest = *std::min_element(
        contacts.begin(), contacts.end(), [](const auto& a, const auto& b) { return a.gap < b.gap; });
    const auto apart = [&](const Vector3& n) {
      return std::abs(n.dot(X.translation())) - capsule.half_length * std::abs(n.dot(X.rotation().col(2))) -
             n.cwiseAbs().dot(half) - capsule.radius;
    };
    const Vector3 n = deepest.frame.row(0), p = deepest.point;
    EXPECT_NEAR(deepest.gap, apart(n), 1e-12);
    for (int k = 0; k < 500; ++k)
      EXPECT_LE(apart(Vector3(u(random), u(random), u(random)).normalized()), deepest.gap + 1e-12);
    // Where both surfaces are: half of the gap off the box, and off the capsule.
    const Vector3 on_box = p + (deepest.body_a == 0 ? 0.5 : -0.5) * deepest.gap * n;
    EXPECT_LT((on_box.cwiseAbs() - half).maxCoeff(), 1e-9);
    const Vector3 on_rod = X.inverse() * Vector3(p - (deepest.body_a == 0 ? 0.5 : -0.5) * deepest.gap * n);
    const Vector3 on_axis(0, 0, std::clamp(on_rod.z(), -capsule.half_length, capsule.half_length));
    EXPECT_NEAR((on_rod - on_axis).norm(), capsule.radius, 1e-9);
  }
}

TEST(Patch, OnePointWhereOneIsAskedFor) {
  EXPECT_EQ(Contacts({Moving(Box{Vector3(0.2, 0.2, 0.1)}, At(0, 0, -0.1)),
                      Moving(Box{Vector3(0.05, 0.05, 0.05)}, At(0, 0, 0.0495))},
                     {}, {.multi_point = false})
                .size(),
            1u);
}

TEST(Patch, TheSameBitsEveryTime) {
  auto world =
      CollisionWorld::Create({Moving(Cylinder{0.1, 0.1}), Moving(Cylinder{0.07, 0.1}, At(0.03, 0.02, 0.199)),
                              Moving(Block(Vector3(0.1, 0.05, 0.1)), At(0.01, 0.02, 0.398))},
                             {});
  ASSERT_TRUE(world.has_value());
  std::vector<ContactPoint> first, again;
  ASSERT_TRUE(world->Detect(first));
  ASSERT_TRUE(world->Detect(again));
  ASSERT_GT(first.size(), 8u);
  ASSERT_EQ(again.size(), first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].gap, again[i].gap);
    EXPECT_EQ(first[i].point, again[i].point);
  }
}

}  // namespace
}  // namespace fork1s
