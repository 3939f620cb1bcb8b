// Inertia of solids: known formulas, meshes beside the shapes that they approximate, and calls that make no
// sense.
#include <fork1s/geometry/inertia.hpp>

#include <gtest/gtest.h>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string>

#include "geometry/surface.hpp"

namespace fork1s::testing {
namespace {

using std::numbers::pi;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void ExpectDiagonal(const SpatialInertia& I, const Vector3& expected) {
  EXPECT_TRUE(I.center.isZero(0));
  EXPECT_LT((I.rotational - Matrix3(expected.asDiagonal())).norm(), 1e-14 * expected.norm()) << I.rotational;
}

std::shared_ptr<TriangleMesh> MeshOf(const Shape& shape, const RigidTransform& X, int sides = 256) {
  const Surface surface = MakeSurface(shape, {.sides = sides});
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->name = "part";
  for (const auto& v : surface.vertices)
    mesh->vertices.push_back((X * Vector3(v.cast<double>())).cast<float>());
  mesh->triangles = surface.triangles;
  return mesh;
}

TEST(ComputeInertia, FollowsTheFormulasOfTextbooks) {
  const double m = 3, r = 0.2, h = 0.5;
  ExpectDiagonal(ComputeInertia(Sphere{r}, m), Vector3::Constant(0.4 * m * r * r));
  ExpectDiagonal(ComputeInertia(Box{Vector3(0.5, 1, 1.5)}, m), Vector3(4 + 9, 1 + 9, 1 + 4) * (m / 12));
  ExpectDiagonal(ComputeInertia(Ellipsoid{Vector3(1, 2, 3)}, m), Vector3(13, 10, 5) * (m / 5));
  const double across = m * (3 * r * r + 4 * h * h) / 12;
  ExpectDiagonal(ComputeInertia(Cylinder{r, h}, m), Vector3(across, across, m * r * r / 2));
  EXPECT_DOUBLE_EQ(ComputeVolume(Cylinder{r, h}), 2 * pi * r * r * h);
  EXPECT_DOUBLE_EQ(ComputeVolume(Capsule{r, h}), 2 * pi * r * r * h + 4 * pi / 3 * r * r * r);
}

// A capsule has its formula from two halves of a sphere; its surface knows nothing of that.
TEST(ComputeInertia, OfAMeshIsThatOfItsShape) {
  const RigidTransform X(Matrix3(ExpRotation(Vector3(0.3, -0.5, 0.9))), Vector3(3, -2, 1));
  const Shape shapes[] = {Sphere{0.2}, Capsule{0.2, 0.5}, Cylinder{0.2, 0.5}, Box{Vector3(0.1, 0.2, 0.3)},
                          Ellipsoid{Vector3(0.1, 0.2, 0.3)}};
  for (const Shape& shape : shapes) {
    const SpatialInertia expected = Transform(X, ComputeInertia(shape, 2));
    const auto mesh = MeshOf(shape, X);
    const SpatialInertia I = ComputeInertia(MeshShape{mesh}, 2);
    const double size = BoundingRadius(shape);
    EXPECT_LT((I.center - expected.center).norm(), 1e-5 * size) << ShapeName(shape);
    EXPECT_LT((I.rotational - expected.rotational).norm(), 3e-4 * expected.rotational.norm())
        << ShapeName(shape);
    EXPECT_NEAR(ComputeVolume(MeshShape{mesh}) / ComputeVolume(shape), 1, 5e-4) << ShapeName(shape);
    // Inside out, it is the same solid.
    for (Eigen::Vector3i& t : mesh->triangles) std::swap(t(0), t(1));
    EXPECT_LT((ComputeInertia(MeshShape{mesh}, 2).rotational - I.rotational).norm(),
              1e-9 * I.rotational.norm());
  }
}

void ExpectThrown(const std::string& function, const std::string& says, const Shape& shape, double mass = 1) {
  try {
    function == "ComputeVolume" ? void(ComputeVolume(shape)) : void(ComputeInertia(shape, mass));
    ADD_FAILURE() << says;
  } catch (const std::invalid_argument& e) {
    const std::string text = e.what();
    EXPECT_EQ(text.rfind(function + ": " + says, 0), 0u) << text;
  }
}

TEST(ComputeInertia, OfWhatIsNoSolidThrows) {
  for (const double mass : {0.0, -1.0, kNaN, std::numeric_limits<double>::infinity()})
    ExpectThrown("ComputeInertia", "a mass of ", Sphere{1}, mass);
  const std::string nothing = " without a finite volume; give a solid with sizes above 0";
  ExpectThrown("ComputeInertia", "a plane" + nothing, Plane{});
  ExpectThrown("ComputeInertia", "a heightfield" + nothing, HeightField{});
  ExpectThrown("ComputeInertia", "a mesh" + nothing, MeshShape{});
  ExpectThrown("ComputeVolume", "a sphere" + nothing, Sphere{0});
  ExpectThrown("ComputeVolume", "a sphere" + nothing, Sphere{-1});
  ExpectThrown("ComputeVolume", "a box" + nothing, Box{Vector3(-1, -1, 1)});
  ExpectThrown("ComputeVolume", "a cylinder" + nothing, Cylinder{1, kNaN});
  ExpectThrown("ComputeVolume", "a capsule" + nothing, Capsule{-1, 1});
  auto open = MeshOf(Box{Vector3(1, 1, 1)}, {});
  open->triangles.pop_back();
  ExpectThrown("ComputeInertia", "mesh 'part' is not closed", MeshShape{open});
  open->triangles.back()(0) = 999;
  ExpectThrown("ComputeInertia", "vertex 999 of ", MeshShape{open});
}

}  // namespace
}  // namespace fork1s::testing
