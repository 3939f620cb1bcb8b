// States of a scene as the positions and velocities of the joints of its file, and back.
#include <fork1s/mechanism/kinematics.hpp>
#include <limits>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

constexpr const char* kModel = R"(<mujoco><compiler angle="radian"/><worldbody>
  <body name="arm" pos="0 0 1" quat="0.8 0.6 0 0"><joint name="swing" axis="0 1 1" ref="0.4" stiffness="3"/>
    <geom size="0.1" mass="1"/>
    <body name="wrist" pos="0.3 0 0" quat="0.6 0 0.8 0"><joint name="wrist" type="ball" stiffness="2"/>
      <geom size="0.1" mass="1"/></body></body>
  <body name="cube" pos="3 0 1"><freejoint name="cube"/><geom size="0.1" mass="1"/></body>
  <body name="trunk" pos="0 4 1"><freejoint name="root"/><geom size="0.1" mass="1"/>
    <body name="leg"><joint name="hip" axis="0 1 0" ref="0.2" stiffness="5"/><geom size="0.1" mass="1"/></body></body>
</worldbody></mujoco>)";

KeyframeDef ReferenceState(const Scene& scene) {
  KeyframeDef state;
  for (const MechanismDef& mechanism : scene.mechanisms) {
    auto& m = state.mechanisms.emplace_back();
    const auto n = BuildMechanism(mechanism)->num_coordinates();
    m.q = m.q_dot = VectorX::Zero(n);
    m.X_WR = mechanism.X_WR;
  }
  for (const FreeBodyDef& body : scene.free_bodies) state.free_bodies.push_back({body.X_WB});
  return state;
}

TEST(FileState, HasTheJointsOfTheFileInItsOrder) {
  const ImportedScene imported = MustLoad(kModel);
  const auto& joints = imported.joints;
  ASSERT_EQ(joints.size(), 5u);
  const std::vector<std::string> names = {"swing", "wrist", "cube", "root", "hip"};
  for (std::size_t i = 0; i < names.size(); ++i) EXPECT_EQ(joints[i].name, names[i]);
  EXPECT_EQ(joints[0].reference, std::vector<double>{0.4});
  EXPECT_EQ(joints[2].free_body, 0);
  EXPECT_EQ(joints[3].coordinate, -1);
  const FileState state = ComputeFileState(joints, imported.scene, ReferenceState(imported.scene));
  VectorX expected(20);
  expected << 0.4, 1, 0, 0, 0, 3, 0, 1, 1, 0, 0, 0, 0, 4, 1, 1, 0, 0, 0, 0.2;
  EXPECT_LT((state.positions - expected).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_TRUE(state.velocities.isZero(0));
}

TEST(FileState, ComesBackFromTheScene) {
  const ImportedScene imported = MustLoad(kModel);
  KeyframeDef state = ReferenceState(imported.scene);
  FileState given{VectorX(20), VectorX(17)};
  given.positions << 0.7, 0.5, -0.5, 0.5, 0.5, 1, 2, 3, 0, 0.6, 0, 0.8, -1, 0, 2, 0.8, 0, 0, -0.6, 1;
  given.velocities << 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17;
  ASSERT_TRUE(ApplyFileState(imported.joints, imported.scene, given, state));
  const FileState back = ComputeFileState(imported.joints, imported.scene, state);
  EXPECT_LT((back.positions - given.positions).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((back.velocities - given.velocities).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_NEAR(state.mechanisms[0].q(0), 0.3, 1e-15);
  EXPECT_LT((state.free_bodies[0].velocity_W - Vector3(5, 6, 7)).norm(), 1e-15);
  // Half a turn about (0.6, 0, 0.8) takes (8, 9, 10) to 2 (a·v) a - v.
  const Vector3 a(0.6, 0, 0.8), v(8, 9, 10);
  const Vector3 turned = 2 * a.dot(v) * a - v;
  EXPECT_LT((state.free_bodies[0].omega_W - turned).norm(), 1e-13);
}

TEST(FileState, RefusesNumbersThatCannotBe) {
  const ImportedScene imported = MustLoad(kModel);
  KeyframeDef state = ReferenceState(imported.scene);
  const FileState good = ComputeFileState(imported.joints, imported.scene, state);
  FileState bad = good;
  bad.positions.conservativeResize(19);
  EXPECT_NE(ApplyFileState(imported.joints, imported.scene, bad, state).error().message.find("have 20"),
            std::string::npos);
  bad = good;
  bad.positions.segment<4>(1).setZero();
  EXPECT_EQ(ApplyFileState(imported.joints, imported.scene, bad, state).error().where,
            "qpos of joint 'wrist'");
  bad = good;
  bad.velocities(0) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(ApplyFileState(imported.joints, imported.scene, bad, state).error().where, "qvel");
}

TEST(FileState, JointsOfAFixedBaseDoNotMove) {
  ImportOptions options;
  options.base = BaseKind::kFixed;
  const ImportedScene imported = MustLoad(kModel, options);
  std::vector<std::string> names;
  for (const FileJoint& joint : MovingJoints(imported.joints, imported.scene)) names.push_back(joint.name);
  EXPECT_EQ(names, (std::vector<std::string>{"swing", "wrist", "cube", "hip"}));
}

}  // namespace
}  // namespace fork1s::testing_importer
