#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

// Equality constraints' positions in MuJoCo and closure residuals of ours vanish together; for a connect
// they are the same distance.
TEST(ImportClosures, ConnectAndWeldMeasureWhatMujocoMeasures) {
  const std::string text = R"(<mujoco><compiler angle="radian"/><worldbody>
    <body name="a" pos="0 0 .1" euler=".1 .2 .3"><joint name="ja" axis="0 1 0"/><geom size=".1"/>
      <body name="b" pos=".3 0 0" euler=".4 0 0"><joint name="jb" axis="0 1 .2"/><geom size=".1"/></body></body>
    <body name="c" pos=".5 0 .2" euler="0 0 1"><joint name="jc" axis="1 1 0"/><geom size=".1"/></body>
    <body name="post" pos="1 0 0" euler="0 .5 0"><geom size=".1"/></body></worldbody>
    <equality><connect name="pin" body1="b" body2="c" anchor=".1 .02 .03"/>
      <weld name="glue" body1="c" body2="b" anchor=".02 .01 .05" relpose="-.2 .1 .05 .9 .1 .3 -.2"/>
      <connect name="ground" body1="c" body2="post" anchor="0 .1 0"/></equality></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  ASSERT_EQ(mechanism.num_constraints(), 12);
  EXPECT_EQ(mechanism.bodies()[0].name, "world");
  Peer peer(text);
  Kinematics kinematics(mechanism);
  VectorX q(3), c(12);
  q << .3, -.5, .2;
  for (const auto& joint : mechanism.joints()) peer.d->qpos[peer.Dof(joint.name)] = q[joint.offset];
  mj_forward(peer.m.get(), peer.d.get());
  ComputeKinematics(mechanism, q, kinematics);
  for (const ClosureDef& closure : mechanism.closures()) {
    const RigidTransform E = (kinematics.X_RB[closure.body_a.u()] * closure.X_AJ).inverse() *
                             (kinematics.X_RB[closure.body_b.u()] * closure.X_BJ);
    const int id = mj_name2id(peer.m.get(), mjOBJ_EQUALITY, closure.name.c_str());
    VectorX rows(6);
    int count = 0;
    for (int i = 0; i < peer.d->nefc; ++i) {
      if (peer.d->efc_type[i] == mjCNSTR_EQUALITY && peer.d->efc_id[i] == id)
        rows[count++] = peer.d->efc_pos[i];
    }
    EXPECT_NEAR(E.translation().norm(), rows.head<3>().norm(), 1e-12) << closure.name;
    if (count == 6) {
      // MuJoCo's rotation rows are the vector part of the error quaternion, times torquescale.
      const double half = std::asin(std::min(1.0, rows.tail<3>().norm()));
      EXPECT_NEAR(LogRotation(E.rotation()).norm(), 2 * half, 1e-9) << closure.name;
    }
  }
}

TEST(ImportClosures, WeldWithoutRelativePoseHoldsTheReference) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
    <body name="a" euler="10 20 30"><joint/><geom size=".1"/></body>
    <body name="c" pos=".5 0 .2" euler="0 40 0"><joint axis="1 1 0"/><geom size=".1"/></body></worldbody>
    <equality><weld body1="a" body2="c"/></equality></mujoco>)");
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  Kinematics kinematics(mechanism);
  const VectorX q = VectorX::Zero(2);
  ComputeKinematics(mechanism, q, kinematics);
  VectorX c;
  ClosureResidual(mechanism, kinematics, q, c);
  EXPECT_LT(c.norm(), 1e-12);
}

TEST(ImportClosures, JointEqualityIsACoupling) {
  const std::string text = R"(<mujoco><compiler angle="radian"/><worldbody>
    <body name="a"><joint name="ja" ref=".2"/><geom size=".1"/></body>
    <body name="b"><joint name="jb" ref="-.1"/><geom size=".1"/></body>
    <body name="c"><joint name="jc"/><geom size=".1"/></body></worldbody>
    <equality><joint joint1="ja" joint2="jb" polycoef=".1 2 .3 0 0"/><joint joint1="jc" polycoef=".4 0 0 0 0"/></equality>
    </mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 2u);  // a and b share one, c is alone
  const auto& coupling = loaded.scene.mechanisms[0].couplings[0];
  EXPECT_EQ(coupling.polynomial[2], .3);
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  Kinematics kinematics(mechanism);
  VectorX q(2), c;
  q << .7, .25;
  ComputeKinematics(mechanism, q, kinematics);
  ClosureResidual(mechanism, kinematics, q, c);
  Peer peer(text);
  peer.d->qpos[0] = .2 + .7;
  peer.d->qpos[1] = -.1 + .25;
  mj_forward(peer.m.get(), peer.d.get());
  EXPECT_NEAR(std::abs(c[0]), std::abs(peer.d->efc_pos[0]), 1e-12);
  EXPECT_FALSE(loaded.scene.mechanisms[1].couplings[0].b.joint.valid());
}

// Equalities of fixed tendons: over two joints, of two tendons of a joint each, and of one alone.
TEST(ImportClosures, TendonEquality_OverTwoJoints_IsACoupling) {
  const std::string text = R"(<mujoco><compiler angle="radian"/><worldbody>
    <body name="a"><joint name="ja" ref=".2"/><geom size=".1"/></body>
    <body name="b"><joint name="jb" ref="-.1"/><geom size=".1"/>
      <body name="c"><joint name="jc"/><geom size=".1"/></body></body>
    <body name="d"><joint name="jd"/><geom size=".1"/></body></worldbody>
    <tendon><fixed name="sum"><joint joint="ja" coef="2"/><joint joint="jb" coef="-.5"/></fixed>
      <fixed name="tb"><joint joint="jb" coef="3"/></fixed><fixed name="tc"><joint joint="jc" coef="-2"/></fixed>
      <fixed name="td"><joint joint="jd" coef="4"/></fixed>
      <fixed name="three"><joint joint="ja" coef="1"/><joint joint="jb" coef="1"/><joint joint="jc" coef="1"/></fixed>
    </tendon>
    <equality><tendon name="e1" tendon1="sum" polycoef=".3 0 0 0 0"/>
      <tendon name="e2" tendon1="tc" tendon2="tb" polycoef=".1 .7 .2 -.05 .01"/>
      <tendon name="e3" tendon1="td" polycoef=".2 0 0 0 0"/><tendon name="e4" tendon1="three"/></equality></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 2u);  // d is alone
  ASSERT_EQ(loaded.scene.mechanisms[0].couplings.size(), 2u);
  EXPECT_NEAR(loaded.scene.mechanisms[1].couplings[0].polynomial[0], .05, 1e-15);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "'e4'"));
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  Kinematics kinematics(mechanism);
  VectorX q(3), c;
  q << .7, .25, -.4;  // a, b, c
  ComputeKinematics(mechanism, q, kinematics);
  ClosureResidual(mechanism, kinematics, q, c);
  Peer peer(text);
  for (int i = 0; i < 3; ++i) peer.d->qpos[i] = peer.m->qpos0[i] + q[i];
  mj_forward(peer.m.get(), peer.d.get());
  EXPECT_NEAR(std::abs(c[0]), std::abs(peer.d->efc_pos[0]) / 2, 1e-12);
  EXPECT_NEAR(std::abs(c[1]), std::abs(peer.d->efc_pos[1]) / 2, 1e-12);
}

TEST(ImportClosures, FloatingTreePinnedToTheWorld) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
    <body name="kite" pos="0 0 1"><freejoint/><geom size=".1"/>
      <body name="tail" pos=".2 0 0"><joint/><geom size=".05"/></body></body></worldbody>
    <equality><connect body1="kite" anchor="0 0 .5"/></equality></mujoco>)");
  const MechanismDef& mechanism = loaded.scene.mechanisms[0];
  EXPECT_EQ(mechanism.base, BaseKind::kFixed);
  EXPECT_EQ(mechanism.bodies[0].name, "world");
  EXPECT_EQ(mechanism.joints[0].kind, JointKind::kFree);
  EXPECT_EQ(mechanism.closures.size(), 1u);
  MustBuild(mechanism);
}

TEST(ImportClosures, MocapBodyDrivesAMechanism) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
    <body name="hand" mocap="true" pos="0 0 1"><geom size=".01" contype="0" conaffinity="0"/></body>
    <body name="palm" pos="0 0 1"><freejoint/><geom size=".1"/>
      <body name="finger" pos=".2 0 0"><joint stiffness="1"/><geom size=".05"/></body></body></worldbody>
    <equality><weld body1="hand" body2="palm"/></equality>
    <keyframe><key mpos="1 2 3" mquat="0 1 0 0"/></keyframe></mujoco>)");
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  const MechanismDef& mechanism = loaded.scene.mechanisms[0];
  EXPECT_EQ(mechanism.base, BaseKind::kDriven);
  EXPECT_EQ(mechanism.bodies[0].name, "hand");
  EXPECT_EQ(mechanism.joints.size(), 1u);
  EXPECT_TRUE(mechanism.closures.empty());
  EXPECT_EQ(loaded.scene.keyframes[0].mechanisms[0].X_WR.translation(), Vector3(1, 2, 3));
}

}  // namespace
}  // namespace fork1s::testing_importer
