// Spheres on height fields: one contact where a smooth slope has one, exact, whatever cells it is cut into.
#include <algorithm>
#include <cmath>
#include <draws.hpp>
#include <functional>
#include <random>

#include "scenes.hpp"

namespace fork1s {
namespace {

using testing::At;
using testing::Contacts;
using testing::Moving;
using testing::Still;

// 0.6 x 0.4 m in cells of 20 x 10 mm, heights of up to 0.1 m by a function of x and y.
HeightField Field(const std::function<double(double, double)>& height) {
  auto grid = std::make_shared<HeightGrid>();
  grid->name = "field";
  grid->columns = 31;
  grid->rows = 41;
  grid->half_x = 0.3;
  grid->half_y = 0.2;
  grid->max_height = 0.1;
  grid->base_depth = 0.1;
  for (int i = 0; i < grid->rows; ++i)
    for (int k = 0; k < grid->columns; ++k)
      grid->values.push_back(static_cast<float>(height(-0.3 + 0.02 * k, -0.2 + 0.01 * i) / 0.1));
  return HeightField{grid};
}

Vector3 GroundNormal(const ContactPoint& c) { return c.frame.row(0).transpose(); }

// MuJoCo holds heights as floats of 24 bits.
constexpr double kFloat = 1e-8;  // m, of 0.1

std::vector<ContactPoint> Under(const HeightField& field, double radius, const Vector3& center,
                                double margin = 0.001) {
  CollisionOptions options;
  options.margin = margin;
  return Contacts({Still(field), Moving(Sphere{radius}, RigidTransform(center))}, {}, options);
}

TEST(SphereOnGrid, AFlatFieldIsAPlane) {
  const HeightField field = Field([](double, double) { return 0.05; });
  // Inside of cells, on edges, on diagonals, on vertices; small beside the cells and large.
  for (const double radius : {0.004, 0.05, 0.15})
    for (const double x : {0.003, 0.02, 0.025, -0.2})
      for (const double y : {0.004, 0.01, 0.0125, 0.0})
        for (const double gap : {-0.002, 0.0, 0.0009}) {
          const auto contacts = Under(field, radius, Vector3(x, y, 0.05 + radius + gap));
          ASSERT_EQ(contacts.size(), 1u) << radius << ' ' << x << ' ' << y << ' ' << gap;
          EXPECT_NEAR(contacts[0].gap, gap, kFloat);
          EXPECT_LT((GroundNormal(contacts[0]) - Vector3::UnitZ()).norm(), 1e-6);
          EXPECT_LT((contacts[0].point - Vector3(x, y, 0.05 + gap / 2)).norm(), 1e-6);
        }
}

TEST(SphereOnGrid, ATiltedFieldIsATiltedPlane) {
  const HeightField field = Field([](double x, double y) { return 0.05 + 0.12 * x - 0.05 * y; });
  const Vector3 n = Vector3(-0.12, 0.05, 1).normalized();
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const double x = 0.2 * u(random), y = 0.1 * u(random), radius = 0.03 + 0.02 * u(random);
    const Vector3 on(x, y, 0.05 + 0.12 * x - 0.05 * y);
    const auto contacts = Under(field, radius, on + (radius - 0.0005) * n);
    ASSERT_EQ(contacts.size(), 1u) << i;
    EXPECT_NEAR(contacts[0].gap, -0.0005, kFloat);
    EXPECT_LT((GroundNormal(contacts[0]) - n).norm(), 2e-6);  // heights rounded to 1e-8 m over cells of 10 mm
  }
}

TEST(SphereOnGrid, AValleyHasTwoContactsAndARidgeOne) {
  for (const double side : {1.0, -1.0}) {
    const double level = side > 0 ? 0 : 0.09;
    // Rounding may put the ends of the ridge below the lowest height there is.
    const HeightField field =
        Field([&](double x, double) { return std::max(0.0, level + side * 0.3 * std::abs(x)); });
    const double slope = std::atan(0.3), radius = 0.02, gap = -0.0003;
    // Over the middle: the distance from either slope, or from the edge between them.
    const double above = side > 0 ? (radius + gap) / std::cos(slope) : radius + gap;
    const auto contacts = Under(field, radius, Vector3(0, 0.003, level + above));
    ASSERT_EQ(contacts.size(), side > 0 ? 2u : 1u);
    for (const ContactPoint& c : contacts) {
      EXPECT_NEAR(c.gap, gap, 2 * kFloat);
      EXPECT_NEAR(GroundNormal(c).z(), side > 0 ? std::cos(slope) : 1, 1e-6);
    }
  }
}

TEST(SphereOnGrid, WhatIsUnderTheSurfaceIsPushedUp) {
  const HeightField field = Field([](double x, double) { return 0.05 + 0.1 * x; });
  const Vector3 n = Vector3(-0.1, 0, 1).normalized();
  const double radius = 0.01;
  for (const double depth : {0.001, 0.01, 0.03}) {  // of the centre
    const auto contacts = Under(field, radius, Vector3(0.051, 0.002, 0.0551) - depth * n);
    ASSERT_EQ(contacts.size(), 1u) << depth;
    EXPECT_NEAR(contacts[0].gap, -depth - radius, kFloat);
    EXPECT_LT((GroundNormal(contacts[0]) - n).norm(), 2e-6);
  }
}

// On rough ground: the nearest of many sampled points of the surface, and no contact that has a nearer point
// beside it.
TEST(SphereOnGrid, RoughGroundAgreesWithSamples) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<std::vector<double>> heights(41, std::vector<double>(31));
  for (auto& row : heights)
    for (double& z : row) z = 0.03 * static_cast<float>(u(random));
  const HeightField field = Field([&](double x, double y) {
    return heights[static_cast<std::size_t>(std::lround((y + 0.2) / 0.01))]
                  [static_cast<std::size_t>(std::lround((x + 0.3) / 0.02))];
  });
  // The height anywhere, by the two triangles of a cell.
  const auto height = [&](double x, double y) {
    const double c = (x + 0.3) / 0.02, r = (y + 0.2) / 0.01;
    const auto j = static_cast<std::size_t>(c), i = static_cast<std::size_t>(r);
    const double s = c - static_cast<double>(j), t = r - static_cast<double>(i);
    const double z00 = heights[i][j], z01 = heights[i][j + 1], z10 = heights[i + 1][j],
                 z11 = heights[i + 1][j + 1];
    return s > t ? z00 + s * (z01 - z00) + t * (z11 - z01) : z00 + t * (z10 - z00) + s * (z11 - z10);
  };
  int several = 0;
  for (int k = 0; k < 100; ++k) {
    const double x = 0.2 * (2 * u(random) - 1), y = 0.1 * (2 * u(random) - 1),
                 radius = 0.01 + 0.02 * u(random);
    // Lowered until it touches.
    constexpr double kGrain = 2.5e-4;
    double z = 0;
    for (double dx = -radius; dx < radius; dx += kGrain)
      for (double dy = -radius; dy < radius; dy += kGrain)
        if (const double inside = radius * radius - dx * dx - dy * dy; inside > 0)
          z = std::max(z, height(x + dx, y + dy) + std::sqrt(inside));
    const auto contacts = Under(field, radius, Vector3(x, y, z), 0.002);
    ASSERT_GE(contacts.size(), 1u) << k;
    several += contacts.size() > 1 ? 1 : 0;
    double least = 1;
    for (const ContactPoint& c : contacts) {
      least = std::min(least, c.gap);
      const Vector3 p = c.point - 0.5 * c.gap * GroundNormal(c);  // on the ground
      EXPECT_NEAR(p.z(), height(p.x(), p.y()), 1e-6) << k;
      EXPECT_NEAR((Vector3(x, y, z) - p).norm() - radius, c.gap, 1e-9) << k;
    }
    // Between samples the ground rises by its slope, up to 3 along y and 1.5 along x, and the sphere's rim as
    // much.
    EXPECT_LT(std::abs(least), 6 * kGrain) << k;
    EXPECT_LT(least, kFloat) << k;
  }
  EXPECT_GT(several, 10);
}

// What is told apart among the cells within a wide margin is what a narrow one finds among few.
TEST(SphereOnGrid, WiderMargin_SameNearContacts) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(0, 1);
  const HeightField field = Field([&](double, double) { return 0.02 * u(random); });
  constexpr double kNarrow = 0.002;
  std::size_t compared = 0;
  for (int k = 0; k < 500; ++k) {
    const double radius = 0.004 + 0.01 * u(random);
    const Vector3 center(0.25 * (2 * u(random) - 1), 0.15 * (2 * u(random) - 1),
                         0.0201 + 0.012 * u(random));  // above all
    const auto narrow = Under(field, radius, center, kNarrow);
    for (const double margin : {0.01, 0.02, 0.05}) {
      auto wide = Under(field, radius, center, margin);
      std::erase_if(wide, [](const ContactPoint& c) { return !(c.gap < kNarrow); });
      ASSERT_EQ(wide.size(), narrow.size()) << k << ", " << margin;
      for (std::size_t i = 0; i < narrow.size(); ++i) {
        EXPECT_EQ(wide[i].gap, narrow[i].gap) << k << ", " << margin;
        EXPECT_EQ(wide[i].point, narrow[i].point) << k << ", " << margin;
      }
      compared += narrow.size();
    }
  }
  EXPECT_GT(compared, 300u);
}

// MuJoCo has room for 50 columns of a field, which are a strip under a large box.
TEST(ShapeOnGrid, ALargeBoxRestsOnItsCorners) {
  const HeightField field = Field([](double, double) { return 0.05; });
  const RigidTransform turn(ExpRotation(Vector3(0, 0, 0.3)), Vector3::Zero());
  for (const double gap : {-0.0005, 0.0003}) {
    const RigidTransform X(turn.rotation(), Vector3(0.01, 0.005, 0.1 + gap));
    const auto contacts = Contacts({Still(field), Moving(Box{Vector3(0.15, 0.1, 0.05)}, X)});
    int corners = 0;
    for (const ContactPoint& c : contacts) {
      EXPECT_NEAR(c.gap, gap, kFloat);
      EXPECT_LT((GroundNormal(c) - Vector3::UnitZ()).norm(), 1e-6);
      const Vector3 p = X.inverse() * c.point;
      corners += std::abs(std::abs(p.x()) - 0.15) < 1e-6 && std::abs(std::abs(p.y()) - 0.1) < 1e-6 ? 1 : 0;
    }
    EXPECT_GE(corners, 4);
  }
}

// Where the columns that come first are not the nearest: a box over ground that rises to the far side.
TEST(ShapeOnGrid, TheNearestColumnIsFoundHoweverManyThereAre) {
  const HeightField field = Field([](double x, double y) { return 0.05 + 0.05 * (x + y); });
  const double half = 0.1, highest = 0.05 + 0.05 * (0.1 + 0.1);  // under a corner of the box
  for (const double gap : {0.0005, 0.01, 0.03}) {
    const auto contacts =
        Contacts({Still(field), Moving(Box{Vector3(half, half, half)}, At(0, 0, highest + gap + half))}, {},
                 {.margin = 0.05});
    double least = 1;
    for (const ContactPoint& c : contacts) least = std::min(least, c.gap);
    // The corner over the slope.
    EXPECT_NEAR(least, gap / std::sqrt(1 + 2 * 0.05 * 0.05), 2 * kFloat);
  }
}

// An edge of a box along the bottom of a valley is held by both of its sides, at both ends, a little above
// the bottom as under it, where neither side is straight above.
TEST(ShapeOnGrid, AnEdgeInAValleyLeansOnBothSides) {
  constexpr double kSlope = 0.3, kHalf = 0.05;
  const HeightField field = Field([](double x, double) { return 0.01 + kSlope * std::abs(x); });
  const double steep = 1 / std::sqrt(1 + kSlope * kSlope);
  for (const double above : {1e-4, 2e-6, 0.0, -2e-6, -1e-4})
    for (const auto& [beside, turn] :  // also where rounding decides which face of the edge is the lower one
         {std::pair(0.0, 0.0), {1e-7, 0.0}, {-1e-6, 0.0}, {0.0, 1e-15}, {0.0, -1e-15}}) {
      const RigidTransform X(ExpRotation(Vector3(0, 0.25 * 3.14159265358979323846 + turn, 0)),
                             Vector3(beside, 0.003, 0.01 + above + std::sqrt(2.0) * kHalf));
      const auto contacts =
          Contacts({Still(field), Moving(Box{Vector3(kHalf, 0.06, kHalf)}, X)}, {}, {.margin = 0.001});
      for (const int side : {-1, 1}) {
        double front = -1, back = 1;
        for (const ContactPoint& c : contacts) {
          if ((GroundNormal(c) - steep * Vector3(side * kSlope, 0, 1)).norm() > 1e-6) continue;
          EXPECT_NEAR(c.gap, steep * (above + side * kSlope * beside), 2 * kFloat);
          front = std::max(front, c.point.y());
          back = std::min(back, c.point.y());
        }
        EXPECT_NEAR(front, 0.063, 1e-5) << above << ' ' << beside << ' ' << side;
        EXPECT_NEAR(back, -0.057, 1e-5) << above << ' ' << beside << ' ' << side;
      }
    }
}

// A face on a ridge that is level with it, or nearly so, is held at both ends of what lies under it.
TEST(ShapeOnGrid, AFaceOnARidgeLeansOnBothEnds) {
  constexpr double kTop = 0.05, kLong = 0.007, kFlat = 0.02;  // m; ends lie within cells
  const HeightField field = Field([&](double x, double) { return std::max(0.0, kTop - 0.3 * std::abs(x)); });
  for (const double tilt : {0.0, 1e-7, 1e-4, -5e-4})
    for (const double gap : {-2e-5, 1e-5}) {
      // Turned about the middle of its face, across the ridge.
      const Matrix3 R = ExpRotation(Vector3(tilt, 0, 0));
      const RigidTransform X(R, Vector3(0.004, 0.0013, kTop + gap) + R * Vector3(0, 0, kFlat));
      const auto contacts =
          Contacts({Still(field), Moving(Box{Vector3(0.05, kLong, kFlat)}, X)}, {}, {.margin = 0.001});
      double front = -1, back = 1;
      for (const ContactPoint& c : contacts) {
        const Vector3 p = X.inverse() * c.point;
        EXPECT_GT(GroundNormal(c).dot(R.col(2)),
                  std::cos(1.1 * tilt) - 1e-9);  // that of the face or of its edge
        EXPECT_NEAR(c.gap, gap + tilt * p.y(), 2 * kFloat) << tilt;
        front = std::max(front, p.y());
        back = std::min(back, p.y());
      }
      EXPECT_NEAR(front, kLong, 1e-5) << tilt << ' ' << gap;
      EXPECT_NEAR(back, -kLong, 1e-5) << tilt << ' ' << gap;
    }
}

// What hovers touches nothing: the planes of faces beside the one below may pass over a corner, and are not
// the ground there.
TEST(ShapeOnGrid, WhatHoversOverRoughGroundTouchesNothing) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<double> heights(41 * 31);
  for (double& z : heights) z = 0.02 * static_cast<float>(u(random));
  const auto cell = [](double x, double y) {
    return static_cast<std::size_t>(std::lround((y + 0.2) / 0.01)) * 31 +
           static_cast<std::size_t>(std::lround((x + 0.3) / 0.02));
  };
  const HeightField field = Field([&](double x, double y) { return heights[cell(x, y)]; });
  constexpr double kHalf = 1e-4, kSteepest = 2.3;  // 20 mm over 10 and 20 mm
  auto world =
      CollisionWorld::Create({Still(field), Moving(Box{Vector3::Constant(kHalf)})}, {}, {.margin = 0.02});
  ASSERT_TRUE(world);
  std::vector<ContactPoint> contacts;
  for (int k = 0; k < testing::Draws(3000); ++k) {
    const double x = -0.2 + 0.02 * std::floor(20 * u(random)), y = -0.1 + 0.01 * std::floor(20 * u(random));
    const double s = u(random), t = u(random);
    const double z00 = heights[cell(x, y)], z01 = heights[cell(x + 0.02, y)],
                 z10 = heights[cell(x, y + 0.01)], z11 = heights[cell(x + 0.02, y + 0.01)];
    const double ground =
        s > t ? z00 + s * (z01 - z00) + t * (z11 - z01) : z00 + t * (z10 - z00) + s * (z11 - z10);
    const double above = 0.001 + 0.003 * u(random);
    world->SetPose(1, At(x + 0.02 * s, y + 0.01 * t, ground + above));
    ASSERT_TRUE(world->Detect(contacts));
    ASSERT_FALSE(contacts.empty());
    for (const ContactPoint& c : contacts)
      ASSERT_GT(c.gap, above / std::hypot(1, kSteepest) - std::sqrt(3) * kHalf) << k;
  }
}

}  // namespace
}  // namespace fork1s
