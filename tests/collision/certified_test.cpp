// Every pair of convex shapes against a proof of its gap that shares nothing with the detector
// (benchmarks/certified_gap.hpp; benchmarks/detector_accuracy.cpp does it 10,000 times a pair).
#include <algorithm>
#include <certified_gap.hpp>
#include <cmath>
#include <draws.hpp>
#include <random>

#include "collision/cylinder_box.hpp"
#include "scenes.hpp"

namespace fork1s {
namespace {

using namespace testing;

// The proof is to 1e-10 m, and so is the detector's search; vertices of meshes are floats, 6e-8 of 0.06 m on either side. A
// corner of a flat face stands for the deepest point if it is as deep to 1 um.
constexpr double kProof = 1e-10, kGapOff = 2e-8, kAsDeep = 1e-6;

std::vector<Shape> ConvexShapes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  auto mesh = std::make_shared<TriangleMesh>();
  for (int k = 0; k < 20; ++k)
    mesh->vertices.push_back(Vector3(normal(random), normal(random), normal(random))
                                 .normalized()
                                 .cwiseProduct(Vector3(0.06, 0.05, 0.04))
                                 .cast<float>());
  return {Sphere{0.05},
          Capsule{0.03, 0.04},
          Ellipsoid{Vector3(0.05, 0.04, 0.03)},
          Cylinder{0.04, 0.03},
          Box{Vector3(0.05, 0.04, 0.03)},
          MeshShape{mesh}};
}

// The nearest contact of two shapes is where it is certified to be.
template <class Truth>
void ExpectNearest(const Shape& shape_a, const benchmarks::ConvexBody& a, const Shape& shape_b,
                   const benchmarks::ConvexBody& b, const Truth& truth) {
  auto world = CollisionWorld::Create({Moving(shape_a), Moving(shape_b)}, {}, {.margin = 0.03});
  ASSERT_TRUE(world.has_value()) << world.error().Text();
  world->SetPose(0, a.X);
  world->SetPose(1, b.X);
  std::vector<ContactPoint> contacts;
  ASSERT_TRUE(world->Detect(contacts));
  ASSERT_FALSE(contacts.empty());
  const auto least = std::min_element(contacts.begin(), contacts.end(),
                                      [](const auto& c, const auto& d) { return c.gap < d.gap; });
  EXPECT_GT(least->gap, truth.gap - kGapOff);
  EXPECT_LT(least->gap, truth.gap + kAsDeep);
  // Ends of lines are as deep along normals of their own.
  EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(), [&](const ContactPoint& c) {
    const Vector3 n = (c.body_a == 0 ? 1 : -1) * c.frame.row(0).transpose();
    return c.gap <= least->gap + kAsDeep && benchmarks::GapAlong(a, b, n) > truth.gap - kGapOff;
  }));
}

TEST(CollisionCertified, GapsAndNormalsOfConvexPairs) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto direction = [&] { return Vector3(normal(random), normal(random), normal(random)).normalized(); };
  const std::vector<Shape> shapes = ConvexShapes(random);
  constexpr double kMargin = 0.03;
  int proven = 0;
  for (std::size_t i = 0; i < shapes.size(); ++i)
    for (std::size_t k = i; k < shapes.size(); ++k) {
      const bool boxes = std::holds_alternative<Box>(shapes[i]) && std::holds_alternative<Box>(shapes[k]);
      auto a = benchmarks::MakeConvexBody(shapes[i]), b = benchmarks::MakeConvexBody(shapes[k]);
      auto world = CollisionWorld::Create({Moving(shapes[i]), Moving(shapes[k])}, {}, {.margin = kMargin});
      ASSERT_TRUE(world.has_value()) << world.error().Text();
      std::vector<ContactPoint> contacts;
      for (int trial = 0; trial < testing::Draws(60); ++trial) {
        // At a gap of -4 to 30 mm; every second one turned as the first is, but for a little.
        a.X = RigidTransform(ExpRotation(3 * uniform(random) * direction()), direction());
        const double tilt = trial % 2 == 0 ? 3 * uniform(random) : std::pow(10, -2 - 8 * uniform(random));
        b.X = RigidTransform(a.X.rotation() * ExpRotation(tilt * direction()),
                             a.X.translation() + 0.2 * direction());
        auto truth = benchmarks::Certify(a, b);
        const double wanted = -0.004 + 0.0339 * uniform(random);
        b.X = RigidTransform(b.X.rotation(), b.X.translation() + (wanted - truth.gap) * truth.normal);
        truth = benchmarks::Certify(a, b);
        if (truth.open > kProof || truth.gap > kMargin - 1e-6) continue;  // faces parallel, in penetration
        ++proven;
        world->SetPose(0, a.X);
        world->SetPose(1, b.X);
        ASSERT_TRUE(world->Detect(contacts));
        ASSERT_FALSE(contacts.empty()) << i << ' ' << k << ' ' << trial << ' ' << truth.gap;
        ASSERT_LE(contacts.size(), 17u);
        const auto least = std::min_element(contacts.begin(), contacts.end(),
                                            [](const auto& c, const auto& d) { return c.gap < d.gap; });
        EXPECT_GT(least->gap, truth.gap - (boxes ? 2 * kProof : kGapOff)) << i << ' ' << k << ' ' << trial;
        EXPECT_LT(least->gap, truth.gap + kAsDeep) << i << ' ' << k << ' ' << trial;
        // What the normal proves of the gap; a normal that is off by x leaves some 0.1 x^2 of it, at corners
        // 0.1 x.
        const Vector3 n = (least->body_a == 0 ? 1 : -1) * least->frame.row(0).transpose();
        EXPECT_GT(benchmarks::GapAlong(a, b, n), truth.gap - 1e-6) << i << ' ' << k << ' ' << trial;
      }
    }
  EXPECT_GT(proven, testing::Draws(1150));  // of 1260
}

// Every feature of a cylinder on every feature of a box, level with it but for 1e-10 to 0.1 rad or turned at will, of sizes
// an order of magnitude apart, in shallow penetration and apart.
TEST(CollisionCertified, CylinderOnBox_LevelAndTilted_GapIsProven) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto direction = [&] { return Vector3(normal(random), normal(random), normal(random)).normalized(); };
  const auto size = [&](double typical) { return typical * std::pow(10, uniform(random) - 0.5); };
  int proven = 0, uncertain = 0;
  for (int trial = 0; trial < testing::Draws(800); ++trial) {
    const Cylinder cylinder{size(0.04), size(0.03)};
    const Box box{Vector3(size(0.05), size(0.04), 0.03)};
    auto a = benchmarks::MakeConvexBody(cylinder), b = benchmarks::MakeConvexBody(box);
    const double tilt = trial % 4 == 0 ? 3 * uniform(random) : std::pow(10, -1 - 9 * uniform(random));
    const Matrix3 quarter = ExpRotation(trial % 4 < 2 ? Vector3(Vector3::Zero())
                                                      : Vector3(0.5 * M_PI * Vector3::Unit(trial / 4 % 3)));
    a.X = RigidTransform(ExpRotation(3 * uniform(random) * direction()), direction());
    b.X = RigidTransform(a.X.rotation() * ExpRotation(tilt * direction()) * quarter,
                         a.X.translation() + 0.3 * direction());
    auto truth = benchmarks::Certify(a, b);
    const double wanted = -0.0002 + 0.01 * uniform(random);
    b.X = RigidTransform(b.X.rotation(), b.X.translation() + (wanted - truth.gap) * truth.normal);
    truth = benchmarks::Certify(a, b);
    if (truth.open > kProof) continue;  // faces parallel, in penetration
    ++proven;
    uncertain +=
        internal::CylinderBox(cylinder.radius, cylinder.half_length, a.X, box.half, b.X, 0.03) ? 0 : 1;
    SCOPED_TRACE(::testing::Message() << trial << " tilted by " << tilt);
    ExpectNearest(cylinder, a, box, b, truth);
  }
  EXPECT_GT(proven, testing::Draws(750));
  EXPECT_LE(uncertain, 4);  // which MuJoCo's search answers
}

// Likewise a cylinder and a capsule: along an end, along the side, across either, of sizes an order of magnitude apart.
TEST(CollisionCertified, CapsuleOnCylinder_LevelAndTilted_GapIsProven) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto direction = [&] { return Vector3(normal(random), normal(random), normal(random)).normalized(); };
  const auto size = [&](double typical) { return typical * std::pow(10, uniform(random) - 0.5); };
  int proven = 0, uncertain = 0;
  for (int trial = 0; trial < testing::Draws(800); ++trial) {
    const Cylinder cylinder{size(0.04), size(0.03)};
    const Capsule capsule{size(0.01), size(0.05)};
    auto a = benchmarks::MakeConvexBody(capsule), b = benchmarks::MakeConvexBody(cylinder);
    const double tilt = trial % 4 == 0 ? 3 * uniform(random) : std::pow(10, -1 - 9 * uniform(random));
    const Matrix3 quarter =
        ExpRotation(trial % 4 < 2 ? Vector3(Vector3::Zero()) : Vector3(0.5 * M_PI * Vector3::UnitX()));
    a.X = RigidTransform(ExpRotation(3 * uniform(random) * direction()), direction());
    b.X = RigidTransform(a.X.rotation() * ExpRotation(tilt * direction()) * quarter,
                         a.X.translation() + 0.3 * direction());
    auto truth = benchmarks::Certify(a, b);
    // The capsule's surface, or its segment beneath that of the cylinder.
    const double wanted = trial % 8 < 6 ? -0.0002 + 0.01 * uniform(random) : -1.05 * capsule.radius;
    b.X = RigidTransform(b.X.rotation(), b.X.translation() + (wanted - truth.gap) * truth.normal);
    truth = benchmarks::Certify(a, b);
    if (truth.open > kProof) continue;  // parallel, in penetration
    ++proven;
    uncertain += internal::CylinderCapsule(cylinder.radius, cylinder.half_length, b.X, capsule.radius,
                                           capsule.half_length, a.X, 0.03)
                     ? 0
                     : 1;
    SCOPED_TRACE(::testing::Message() << trial << " tilted by " << tilt);
    ExpectNearest(capsule, a, cylinder, b, truth);
  }
  EXPECT_GT(proven, testing::Draws(700));
  EXPECT_LE(uncertain, 4);  // which MuJoCo's search answers
}

}  // namespace
}  // namespace fork1s
