// Bodies of an imported mechanism against MuJoCo's kinematics at random poses.
#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

constexpr const char* kTree = R"(<mujoco model="tree">
  <compiler angle="radian"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="base" pos=".1 .2 .3" quat=".5 .5 -.5 .5">
      <geom type="box" size=".1 .1 .1"/>
      <body name="arm" pos=".2 0 .1" quat=".9 .1 .2 -.3">
        <joint name="pan" type="hinge" axis="0 1 1" pos=".01 .02 .03" ref=".4"/>
        <joint name="tilt" type="hinge" axis="1 0 .2" pos="-.02 .01 0"/>
        <geom type="capsule" size=".02 .1"/>
        <body name="rod" pos="0 .1 .2" euler=".3 -.2 .5">
          <joint name="push" type="slide" axis=".3 .2 1" ref=".05"/>
          <geom type="sphere" size=".03"/>
          <body name="socket" pos=".1 0 0" euler="1 2 3">
            <joint name="ball" type="ball" pos=".02 -.03 .01"/>
            <geom type="sphere" size=".05" pos=".05 0 0"/>
            <body name="tip" pos=".1 .1 0"><geom type="sphere" size=".01"/></body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <keyframe>
    <key name="bent" qpos="1.1 -.7 .2 .8 .3 -.4 .2" qvel=".1 .2 .3 .4 .5 .6"/>
  </keyframe>
</mujoco>)";

double WorstPose(const Peer& peer, const Mechanism& mechanism, const KeyframeDef::MechanismState& state) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, state.q, kinematics);
  double worst = 0;
  for (std::size_t b = 0; b < mechanism.bodies().size(); ++b) {
    const std::string& name = mechanism.bodies()[b].name;
    worst = std::max(worst, PoseDifference(state.X_WR * kinematics.X_RB[b], peer.Pose(name)));
  }
  return worst;
}

// World velocity of every body's origin and rotation, from the keyframe's rates against MuJoCo's.
double WorstVelocity(const Peer& peer, const Mechanism& mechanism, const KeyframeDef::MechanismState& state) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, state.q, kinematics);
  double worst = 0;
  for (std::size_t b = 1; b < mechanism.bodies().size(); ++b) {
    const Vector6 V = state.V_R + BodyJacobian(mechanism, kinematics, BodyIndex(b)) * state.q_dot;
    const Vector3 p = kinematics.X_RB[b].translation();
    Vector6 expected;
    const int id = mj_name2id(peer.m.get(), mjOBJ_BODY, mechanism.bodies()[b].name.c_str());
    mj_objectVelocity(peer.m.get(), peer.d.get(), mjOBJ_BODY, id, expected.data(), 0);
    const Matrix3& R = state.X_WR.rotation();
    Vector6 ours;
    ours << R * V.head<3>(), R * (V.tail<3>() + V.head<3>().cross(p));
    // mj_objectVelocity speaks of the body's centre of mass frame origin: xipos.
    const mjtNum *c = peer.d->xipos + 3 * id, *o = peer.d->xpos + 3 * id;
    const Vector3 to_center(c[0] - o[0], c[1] - o[1], c[2] - o[2]);
    ours.tail<3>() += ours.head<3>().cross(to_center);
    worst = std::max(worst, (ours - expected).cwiseAbs().maxCoeff());
  }
  return worst;
}

void SetKey(Peer& peer, int key) {
  mj_resetDataKeyframe(peer.m.get(), peer.d.get(), key);
  mj_forward(peer.m.get(), peer.d.get());
}

TEST(ImportPoses, KeyframeOfATreeWithEveryJointKind) {
  const ImportedScene scene = MustLoad(kTree);
  ASSERT_EQ(scene.scene.mechanisms.size(), 1u);
  ASSERT_EQ(scene.scene.world.size(), 1u);
  const Mechanism mechanism = MustBuild(scene.scene.mechanisms[0]);
  EXPECT_EQ(mechanism.num_coordinates(), 6);
  EXPECT_EQ(mechanism.bodies()[0].name, "base");
  Peer peer(kTree);
  SetKey(peer, 0);
  EXPECT_LT(WorstPose(peer, mechanism, scene.scene.keyframes[0].mechanisms[0]), 1e-12);
  EXPECT_LT(WorstVelocity(peer, mechanism, scene.scene.keyframes[0].mechanisms[0]), 1e-12);
}

TEST(ImportPoses, ReferenceIsThePoseOfTheFile) {
  const ImportedScene scene = MustLoad(kTree);
  const Mechanism mechanism = MustBuild(scene.scene.mechanisms[0]);
  Peer peer(kTree);
  mj_kinematics(peer.m.get(), peer.d.get());
  KeyframeDef::MechanismState state;
  state.q = VectorX::Zero(6);
  state.X_WR = scene.scene.mechanisms[0].X_WR;
  EXPECT_LT(WorstPose(peer, mechanism, state), 1e-12);
}

TEST(ImportPoses, FloatingBaseAndSecondTree) {
  const std::string text = R"(<mujoco><worldbody>
    <body name="chassis" pos="0 0 1" euler="10 20 30"><freejoint name="float"/>
      <geom type="box" size=".2 .1 .05" pos=".1 .02 0"/>
      <body name="leg" pos=".1 0 -.1"><joint name="hip" axis="0 1 0" pos="0 0 .05"/><geom size=".03" pos="0 0 .1"/></body>
    </body>
    <body name="load" pos=".5 .1 1" euler="40 0 10"><freejoint name="load_free"/><geom size=".04" pos=".01 0 0"/></body>
  </worldbody>
  <equality><connect body1="leg" body2="load" anchor="0 0 -.1"/></equality>
  <keyframe><key name="k" qpos=".3 .2 .9 .8 .1 -.5 .2  .6  .7 -.1 1.2 .5 .5 -.2 .3"
    qvel="1 2 3 .4 .5 .6  .7  -1 -2 -3 .3 .2 .1"/></keyframe></mujoco>)";
  const ImportedScene scene = MustLoad(text);
  ASSERT_EQ(scene.scene.mechanisms.size(), 1u);
  EXPECT_EQ(scene.scene.mechanisms[0].base, BaseKind::kFloating);
  const Mechanism mechanism = MustBuild(scene.scene.mechanisms[0]);
  ASSERT_EQ(mechanism.num_coordinates(), 7);
  Peer peer(text);
  SetKey(peer, 0);
  EXPECT_LT(WorstPose(peer, mechanism, scene.scene.keyframes[0].mechanisms[0]), 1e-12);
  EXPECT_LT(WorstVelocity(peer, mechanism, scene.scene.keyframes[0].mechanisms[0]), 1e-12);
}

TEST(ImportPoses, FreeBodyWithAWeldedChild) {
  const std::string text = R"(<mujoco><worldbody>
    <body name="arm"><joint name="j"/><geom size=".1"/></body>
    <body name="hammer" pos="1 2 3" euler="0 90 0"><freejoint/><geom type="box" size=".1 .2 .3" mass="2"/>
      <body name="handle" pos="0 0 .5" euler="30 0 0"><geom type="capsule" size=".02 .3" mass="1"/></body></body>
    <body name="post" pos="4 0 0" euler="0 0 90"><geom name="pole" type="cylinder" size=".1 1" pos="1 0 0"/></body>
  </worldbody>
  <contact><exclude body1="handle" body2="post"/></contact>
  <keyframe><key qpos=".1 1 1 1 0 1 0 0" qvel="0 1 2 3 .1 .2 .3"/></keyframe></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  const Scene& scene = loaded.scene;
  ASSERT_EQ(scene.free_bodies.size(), 1u);
  const FreeBodyDef& body = scene.free_bodies[0];
  EXPECT_EQ(body.geometries.size(), 2u);
  EXPECT_NEAR(body.inertia.mass, 3, 1e-12);
  Peer peer(text);
  mj_forward(peer.m.get(), peer.d.get());
  const int id = mj_name2id(peer.m.get(), mjOBJ_BODY, "hammer");
  const mjtNum* c = peer.d->subtree_com + 3 * id;
  EXPECT_LT((body.X_WB * body.inertia.center - Vector3(c[0], c[1], c[2])).norm(), 1e-12);
  // The 6x6 joint-space inertia of the free joint holds the rotational inertia about the body's origin.
  std::vector<mjtNum> M(static_cast<std::size_t>(peer.m->nv) * peer.m->nv);
  mj_fullM(peer.m.get(), peer.d.get(), M.data());
  const Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> full(M.data(), 7,
                                                                                                7);
  EXPECT_LT((full.block<3, 3>(4, 4) - body.inertia.Matrix().topLeftCorner<3, 3>()).norm(), 1e-10);
  ASSERT_EQ(scene.excluded_pairs.size(), 1u);
  EXPECT_EQ(scene.excluded_pairs[0], std::make_pair(std::string("hammer"), std::string("world")));
  ASSERT_EQ(scene.world.size(), 1u);
  EXPECT_LT((scene.world[0].X_BG.translation() - Vector3(4, 1, 0)).norm(), 1e-12);
  const auto& state = scene.keyframes[0].free_bodies[0];
  EXPECT_EQ(state.velocity_W, Vector3(1, 2, 3));
  EXPECT_LT((state.omega_W - Vector3(.1, -.2, -.3)).norm(), 1e-12);
}

TEST(ImportPoses, MassMatrixAgrees) {
  const ImportedScene scene = MustLoad(kTree);
  const Mechanism mechanism = MustBuild(scene.scene.mechanisms[0]);
  Peer peer(kTree);
  SetKey(peer, 0);
  Kinematics kinematics(mechanism);
  // Hinges and the slide: their rates are the same in both; compare that block.
  ComputeKinematics(mechanism, scene.scene.keyframes[0].mechanisms[0].q, kinematics);
  MatrixX M;
  MassMatrix(mechanism, kinematics, M);
  std::vector<mjtNum> raw(36);
  mj_fullM(peer.m.get(), peer.d.get(), raw.data());
  const Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> full(raw.data());
  EXPECT_LT((full.topLeftCorner<3, 3>() - M.topLeftCorner<3, 3>()).norm(), 1e-10 * full.norm());
}

}  // namespace
}  // namespace fork1s::testing_importer
