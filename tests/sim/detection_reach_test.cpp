// How far contacts are looked for: by how bodies move against each other.
#include <gtest/gtest.h>

#include <cmath>

#include "gripper.hpp"

namespace fork1s {
namespace {

// A gripper of which the jaws are 40 mm apart and have nothing between them.
Scene EmptyGripper(BaseKind base) {
  testing::Gripper gripper;
  gripper.base = base;
  gripper.k = 1;
  gripper.damping = 0.01;
  Scene scene = gripper.Make();
  scene.free_bodies.clear();
  scene.mechanisms[0].bodies[0].inertia = scene.mechanisms[0].bodies[1].inertia;
  scene.gravity.setZero();
  return scene;
}

std::size_t PointsFound(const Scene& scene, const Vector6& V_R) {
  Scene moving = scene;
  KeyframeDef key;
  key.mechanisms.resize(1);
  key.mechanisms[0].q = VectorX::Zero(6);
  key.mechanisms[0].V_R = V_R;
  moving.keyframes.push_back(key);
  SimulationOptions options;
  options.initial_keyframe = 0;
  auto simulation = Simulation::Create(moving, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  EXPECT_TRUE(simulation->Step().finite);
  return simulation->world().start_points().size();
}

// At 100 m/s a step of 1/60 s goes 1.7 m, and all of it goes along. The jaws turn with the base too.
TEST(DetectionReach, BodiesOfAMovingMechanism_AsFarAsAtRest) {
  const Scene scene = EmptyGripper(BaseKind::kFloating);
  EXPECT_EQ(PointsFound(scene, Vector6::Zero()), 0u);
  EXPECT_EQ(PointsFound(scene, Vector6::Unit(3) * 100), 0u);
  EXPECT_EQ(PointsFound(scene, Vector6::Unit(4) * 100 + Vector6::Unit(2) * 6), 0u);
}

// What stands beside the way is met all the same: the frame's jaws pass a post at 8 m/s, 30 mm from it.
TEST(DetectionReach, WorldBesideAMovingMechanism_IsSeen) {
  Scene scene = EmptyGripper(BaseKind::kFloating);
  GeometryDef post;
  post.name = "post";
  post.shape = Sphere{0.02};
  post.X_BG = RigidTransform(Vector3(0.12, 0, 0));
  scene.world.push_back(post);
  EXPECT_EQ(PointsFound(scene, Vector6::Zero()), 0u);
  EXPECT_GT(PointsFound(scene, Vector6::Unit(3) * 8), 0u);
}

// A jaw that is thrown at the other meets it, although the base rests.
TEST(DetectionReach, BodiesOfAMechanismThatClose_Meet) {
  Scene scene = EmptyGripper(BaseKind::kFixed);
  KeyframeDef key;
  key.mechanisms.resize(1);
  key.mechanisms[0].q = VectorX::Zero(6);
  key.mechanisms[0].q_dot = VectorX::Unit(6, 0) * 5;  // m/s: 83 mm in a step
  scene.keyframes.push_back(key);
  SimulationOptions options;
  options.initial_keyframe = 0;
  auto simulation = Simulation::Create(scene, options);
  ASSERT_TRUE(simulation) << simulation.error().Text();
  bool touched = false;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(simulation->Step().finite);
    for (const ContactRecord& c : simulation->world().contacts()) touched = touched || c.impulse(0) > 0;
    // They do not pass each other.
    EXPECT_LT(simulation->Pose("left").translation().x(), simulation->Pose("right").translation().x());
  }
  EXPECT_TRUE(touched);
}

}  // namespace
}  // namespace fork1s
