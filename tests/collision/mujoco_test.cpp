// The same scene written by hand as MJCF and run through mj_forward must give the same contacts, where both
// ask for one point a pair of convex shapes.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

#include "scenes.hpp"

namespace fork1s {
namespace {

using namespace testing;

constexpr char kScene[] = R"(<mujoco>
  <option ccd_tolerance="1e-10" ccd_iterations="1000"><flag multiccd="disable"/></option>
  <asset><mesh name="m" vertex="-0.02 -0.05 0  0.11 -0.03 0.01  0 0.12 0.02  0.03 0.01 0.14  0.09 0.08 0.1"/></asset>
  <default><geom margin="0.0005"/></default>
  <worldbody>
    <geom type="plane" size="0 0 1" friction="0.4"/>
    <geom type="box" size="0.3 0.1 0.05" pos="0.3 0 0.02" quat="0.98 0.1 0.1 0.2" friction="0.7"/>
    <body><freejoint/><geom type="sphere" size="0.1"/></body>
    <body><freejoint/><geom type="capsule" size="0.05 0.1" pos="0.02 0 0.01"/>
                      <geom type="ellipsoid" size="0.1 0.07 0.05" pos="0 0.1 0" priority="1" friction="0.2"/></body>
    <body><freejoint/><geom type="cylinder" size="0.08 0.06"/></body>
    <body><freejoint/><geom type="mesh" mesh="m" pos="0.01 0.02 0.03" quat="0.9 0.3 0.1 0.2"/></body>
  </worldbody>
</mujoco>)";

// MuJoCo finds a pair of convex shapes by a search that it ends at ccd_tolerance; which of the iterates it
// ends at depends on the last bit of the poses, and so on the instructions the compiler chose.
constexpr double kGap = 1e-9;  // m, some of that tolerance
// Where a curved surface meets a nearly straight one, of 0.1 m in radius to 100 m, a gap true to 1e-10 m
// leaves the place open by sqrt(2 * 100 * 1e-10) and the normal by less.
constexpr double kPlace = 2e-4;

struct Row {
  std::array<double, 14> values;  // point, gap, frame, friction
  bool operator<(const Row& other) const { return values[3] < other.values[3]; }  // by gap
};

TEST(CollisionAgainstMujoco, SameContactsAsMjForward) {
  const std::string xml = kScene;
  auto vfs = std::make_unique<mjVFS>();
  mj_defaultVFS(vfs.get());
  ASSERT_EQ(mj_addBufferVFS(vfs.get(), "scene.xml", xml.data(), static_cast<int>(xml.size())), 0);
  char error[1000] = "";
  mjModel* m = mj_loadXML("scene.xml", vfs.get(), error, sizeof error);
  mj_deleteVFS(vfs.get());
  ASSERT_NE(m, nullptr) << error;
  mjData* d = mj_makeData(m);

  auto mesh = std::make_shared<TriangleMesh>();
  mesh->vertices = {{-0.02f, -0.05f, 0},
                    {0.11f, -0.03f, 0.01f},
                    {0, 0.12f, 0.02f},
                    {0.03f, 0.01f, 0.14f},
                    {0.09f, 0.08f, 0.1f}};
  std::vector<CollisionBodyDef> bodies = {
      Still(Plane{}),
      Still(Box{Vector3(0.3, 0.1, 0.05)},
            RigidTransform(Quaternion(0.98, 0.1, 0.1, 0.2), Vector3(0.3, 0, 0.02))),
      Moving(Sphere{0.1}),
      Moving({Geometry(Capsule{0.05, 0.1}, At(0.02, 0, 0.01)),
              Geometry(Ellipsoid{Vector3(0.1, 0.07, 0.05)}, At(0, 0.1, 0))}),
      Moving(Cylinder{0.08, 0.06}),
      Moving({Geometry(MeshShape{mesh},
                       RigidTransform(Quaternion(0.9, 0.3, 0.1, 0.2), Vector3(0.01, 0.02, 0.03)))})};
  bodies[0].geometries[0].friction = 0.4;
  bodies[1].geometries[0].friction = 0.7;
  bodies[3].geometries[1].friction = 0.2;
  bodies[3].geometries[1].priority = 1;
  auto world = CollisionWorld::Create(bodies, {}, {.multi_point = false});
  ASSERT_TRUE(world.has_value()) << world.error().Text();

  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<ContactPoint> contacts;
  int seen = 0;
  for (int trial = 0; trial < 200; ++trial) {
    for (int b = 0; b < 4; ++b) {
      const Quaternion q =
          Quaternion(uniform(random), uniform(random), uniform(random), uniform(random)).normalized();
      const Vector3 p(0.2 + 0.2 * uniform(random), 0.15 * uniform(random), 0.1 + 0.08 * uniform(random));
      Eigen::Map<Vector3>(d->qpos + 7 * b) = p;
      Eigen::Map<Vector4>(d->qpos + 7 * b + 3) << q.w(), q.x(), q.y(), q.z();
    }
    mj_forward(m, d);
    // Poses to the last bit: MuJoCo's search for convex pairs turns rounding into 1e-6 here and there.
    for (int b = 0; b < 4; ++b) {
      const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(d->xmat + 9 * (b + 1));
      world->SetPose(b + 2, RigidTransform(Matrix3(R), Eigen::Map<const Vector3>(d->xpos + 3 * (b + 1))));
    }
    ASSERT_TRUE(world->Detect(contacts));
    std::vector<Row> ours, theirs;
    for (const ContactPoint& c : contacts) {
      Row r{};
      Eigen::Map<Vector3>(r.values.data()) = c.point;
      r.values[3] = c.gap;
      Eigen::Map<Matrix3>(r.values.data() + 4) = c.frame.transpose();
      r.values[13] = c.friction;
      ours.push_back(r);
    }
    for (int k = 0; k < d->ncon; ++k) {
      const mjContact& c = d->contact[k];
      if (c.exclude != 0) continue;
      Row r{};
      std::copy_n(c.pos, 3, r.values.begin());
      r.values[3] = c.dist;
      std::copy_n(c.frame, 9, r.values.begin() + 4);
      r.values[13] = c.friction[0];
      theirs.push_back(r);
    }
    ASSERT_EQ(ours.size(), theirs.size()) << trial;
    std::sort(ours.begin(), ours.end());
    std::sort(theirs.begin(), theirs.end());
    for (std::size_t k = 0; k < ours.size(); ++k) {
      for (std::size_t i = 0; i < 14; ++i)
        ASSERT_NEAR(ours[k].values[i], theirs[k].values[i], i == 3 ? kGap : kPlace) << trial;
    }
    seen += static_cast<int>(ours.size());
  }
  EXPECT_GT(seen, 500);
  mj_deleteData(d);
  mj_deleteModel(m);
}

}  // namespace
}  // namespace fork1s
