// Surfaces against what is known of their shapes: extent, volume, area, and that nothing is open or turned
// inside out.
#include "geometry/surface.hpp"

#include <gtest/gtest.h>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

namespace fork1s::testing {
namespace {

constexpr double kPi = std::numbers::pi;

Vector3 At(const Surface& s, const Eigen::Vector3i& t, int k) {
  return s.vertices[static_cast<std::size_t>(t(k))].cast<double>();
}

struct Extent {
  Vector3 low = Vector3::Constant(INFINITY), high = Vector3::Constant(-INFINITY);
  explicit Extent(const Surface& s) {
    for (const auto& v : s.vertices) {
      low = low.cwiseMin(v.cast<double>());
      high = high.cwiseMax(v.cast<double>());
    }
  }
};

double Volume(const Surface& s) {  // divergence theorem
  double volume = 0;
  for (const auto& t : s.triangles) volume += At(s, t, 0).dot(At(s, t, 1).cross(At(s, t, 2))) / 6;
  return volume;
}

double Area(const Surface& s) {
  double area = 0;
  for (const auto& t : s.triangles)
    area += (At(s, t, 1) - At(s, t, 0)).cross(At(s, t, 2) - At(s, t, 0)).norm() / 2;
  return area;
}

// Every edge, by the places of its ends, is passed once in each direction.
bool IsClosed(const Surface& s) {
  using Place = std::array<float, 3>;
  std::map<std::pair<Place, Place>, int> edges;
  auto place = [&](int v) {
    const auto& p = s.vertices[static_cast<std::size_t>(v)];
    return Place{p.x() + 0.f, p.y() + 0.f, p.z() + 0.f};
  };
  for (const auto& t : s.triangles)
    for (int k = 0; k < 3; ++k) ++edges[{place(t(k)), place(t((k + 1) % 3))}];
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (count != 1 || back == edges.end() || back->second != 1) return false;
  }
  return !edges.empty();
}

void ExpectGoodNormals(const Surface& s) {
  ASSERT_EQ(s.vertices.size(), s.normals.size());
  for (const auto& n : s.normals) EXPECT_NEAR(n.norm(), 1, 1e-6);
  for (const auto& t : s.triangles) {
    const Vector3 face = (At(s, t, 1) - At(s, t, 0)).cross(At(s, t, 2) - At(s, t, 0)).normalized();
    for (int k = 0; k < 3; ++k)
      EXPECT_GT(s.normals[static_cast<std::size_t>(t(k))].cast<double>().dot(face), 0.7) << t.transpose();
  }
}

struct Case {
  const char* name;
  Shape shape;
  Vector3 half;  // of the box around it
  double volume;
};

class Solid : public ::testing::TestWithParam<Case> {};

TEST_P(Solid, HasExtentAndVolumeOfItsShape) {
  const Case& c = GetParam();
  const Surface s = MakeSurface(c.shape);
  const Extent extent(s);
  // Vertices lie on the axes: what is left is rounding to floats.
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(extent.high(k), c.half(k), 1e-7 * c.half.maxCoeff());
    EXPECT_NEAR(extent.low(k), -c.half(k), 1e-7 * c.half.maxCoeff());
  }
  EXPECT_TRUE(IsClosed(s));
  ExpectGoodNormals(s);
  // A polygon of n sides in a circle has sin(2 pi/n)/(2 pi/n) of its area: 0.9936 for 32; a sphere of 32 x 16
  // patches, whose meridians are cut short too, loses 2.5 times as much.
  EXPECT_LE(Volume(s), c.volume * (1 + 1e-6));
  EXPECT_GE(Volume(s), c.volume * 0.98);
  // The error falls with the square of the number of sides.
  const double coarse = c.volume - Volume(s);
  const double fine = c.volume - Volume(MakeSurface(c.shape, {.sides = 64}));
  EXPECT_NEAR(fine, coarse / 4, 0.02 * coarse + 1e-6 * c.volume);
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, Solid,
    ::testing::Values(
        Case{"sphere", Sphere{0.3}, {0.3, 0.3, 0.3}, 4.0 / 3 * kPi * 0.027},
        Case{"capsule", Capsule{0.1, 0.4}, {0.1, 0.1, 0.5}, kPi * 0.01 * 0.8 + 4.0 / 3 * kPi * 1e-3},
        Case{"cylinder", Cylinder{0.2, 0.05}, {0.2, 0.2, 0.05}, kPi * 0.04 * 0.1},
        Case{"ellipsoid", Ellipsoid{{0.1, 0.2, 0.4}}, {0.1, 0.2, 0.4}, 4.0 / 3 * kPi * 0.008},
        Case{"box", Box{{0.1, 0.2, 0.3}}, {0.1, 0.2, 0.3}, 0.048}),
    [](const auto& at) { return at.param.name; });

TEST(Surface, EllipsoidNormalsAreThoseOfItsEquation) {
  const Vector3 radii(0.1, 0.2, 0.4);
  const Surface s = MakeSurface(Ellipsoid{radii});
  for (std::size_t i = 0; i < s.vertices.size(); ++i) {
    const Vector3 p = s.vertices[i].cast<double>();
    const Vector3 gradient = p.cwiseQuotient(radii).cwiseQuotient(radii);
    EXPECT_NEAR(gradient.dot(p), 1, 1e-6);
    EXPECT_LT((gradient.normalized() - s.normals[i].cast<double>()).norm(), 1e-5);
  }
}

TEST(Surface, PlanesAreRectangles) {
  const Surface s = MakeSurface(Plane{2, 0}, {.plane_half = 7});
  const Extent extent(s);
  EXPECT_EQ(extent.high, Vector3(2, 7, 0));
  EXPECT_EQ(extent.low, Vector3(-2, -7, 0));
  EXPECT_DOUBLE_EQ(Area(s), 56);
  ExpectGoodNormals(s);
}

std::shared_ptr<TriangleMesh> Cube() {
  auto mesh = std::make_shared<TriangleMesh>();
  for (int i = 0; i < 8; ++i)
    mesh->vertices.emplace_back(i & 1 ? 1.f : -1.f, i & 2 ? 1.f : -1.f, i & 4 ? 1.f : -1.f);
  mesh->triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                     {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TEST(Surface, MeshEdgesAreSharpWhereTheyBendMore) {
  const auto cube = Cube();
  const Surface sharp = MakeSurface(MeshShape{cube});
  EXPECT_EQ(sharp.triangles.size(), 12u);
  EXPECT_EQ(sharp.vertices.size(), 24u);  // three normals at a corner
  EXPECT_TRUE(IsClosed(sharp));
  EXPECT_NEAR(Volume(sharp), 8, 1e-6);
  for (const auto& n : sharp.normals) EXPECT_EQ(n.cwiseAbs().maxCoeff(), 1.f);

  const Surface smooth = MakeSurface(MeshShape{cube}, {.crease = 2});
  EXPECT_EQ(smooth.vertices.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_GT(smooth.normals[i].dot(smooth.vertices[i]), 1.4);
}

TEST(Surface, MeshesWithAVertexPerTriangleAreWeldedAndEmptyTrianglesLeftOut) {
  auto loose = std::make_shared<TriangleMesh>();
  const auto cube = Cube();
  for (const auto& t : cube->triangles) {
    const int a = static_cast<int>(loose->vertices.size());
    for (int v : t) loose->vertices.push_back(cube->vertices[static_cast<std::size_t>(v)]);
    loose->triangles.emplace_back(a, a + 1, a + 2);
  }
  loose->triangles.emplace_back(0, 0, 1);
  const Surface s = MakeSurface(MeshShape{loose});
  EXPECT_EQ(s.vertices.size(), 24u);
  EXPECT_EQ(s.triangles.size(), 12u);
}

TEST(Surface, HeightfieldsStandWhereTheirValuesSay) {
  auto grid = std::make_shared<HeightGrid>();
  *grid = {"slope", 3, 5, 2.0, 1.0, 0.5, 0.1, {}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 5; ++j) grid->values.push_back(static_cast<float>(j) / 4);
  const Surface s = MakeSurface(HeightField{grid});
  const Extent extent(s);
  EXPECT_LT((extent.low - Vector3(-2, -1, 0)).norm(), 1e-7);
  EXPECT_LT((extent.high - Vector3(2, 1, 0.5)).norm(), 1e-7);
  EXPECT_EQ(s.vertices.size(), 15u);  // an even slope has one normal a point
  EXPECT_NEAR(Area(s), 2 * std::hypot(4, 0.5), 1e-6);
  for (const auto& n : s.normals)
    EXPECT_LT((n.cast<double>() - Vector3(-0.5, 0, 4).normalized()).norm(), 1e-6);
}

// A vertex that two triangles see in different places of a picture is written twice, else once.
TEST(Surface, PlacesInAPictureFollowTheirCorners) {
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh->triangles = {{0, 1, 2}, {2, 2, 2}, {0, 2, 3}};  // the second is none, its corners go with it
  EXPECT_TRUE(MakeSurface(MeshShape{mesh}).uv.empty());
  const Eigen::Vector2f nowhere(9, 9);
  mesh->corner_uv = {{0, 0}, {1, 0}, {1, 1}, nowhere, nowhere, nowhere, {0, 0}, {0.5, 0.5}, {0, 1}};
  const Surface s = MakeSurface(MeshShape{mesh});
  ASSERT_EQ(s.uv.size(), s.vertices.size());
  EXPECT_EQ(s.vertices.size(), 5u);
  for (std::size_t t = 0; t < 2; ++t)
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(s.uv[static_cast<std::size_t>(s.triangles[t](k))],
                mesh->corner_uv[6 * t + static_cast<std::size_t>(k)]);
  mesh->corner_uv.pop_back();
  EXPECT_THROW(MakeSurface(MeshShape{mesh}), std::invalid_argument);
}

#ifdef NDEBUG
TEST(Requirements, NameNoPlaceInOurSources) {
  try {
    MakeSurface(Sphere{1}, {.sides = 3});
    FAIL() << "three sides were taken";
  } catch (const std::invalid_argument& e) {
    const std::string text = e.what();
    EXPECT_NE(text.find("options.sides"), std::string::npos) << text;
    EXPECT_EQ(text.find(".cpp"), std::string::npos) << text;
  }
}
#endif

TEST(Surface, BrokenMeshesAreRefusedAndMissingOnesEmpty) {
  EXPECT_TRUE(MakeSurface(MeshShape{}).vertices.empty());
  auto mesh = Cube();
  mesh->triangles.emplace_back(0, 1, 8);
  EXPECT_THROW(MakeSurface(MeshShape{mesh}), std::invalid_argument);
  mesh->triangles.back() = {0, 1, -1};
  EXPECT_THROW(MakeSurface(MeshShape{mesh}), std::invalid_argument);
  mesh->triangles.pop_back();
  mesh->vertices[3].x() = std::nanf("");
  EXPECT_THROW(MakeSurface(MeshShape{mesh}), std::invalid_argument);
  auto grid = std::make_shared<HeightGrid>();
  *grid = {"short", 3, 3, 1, 1, 1, 0, {0, 0, 0, 0}};
  EXPECT_THROW(MakeSurface(HeightField{grid}), std::invalid_argument);
}

}  // namespace
}  // namespace fork1s::testing
