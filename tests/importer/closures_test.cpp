#include <fmt/format.h>
#include <fork1s/sim/simulation.hpp>

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

// One equality of MuJoCo: residual, and derivative by the displacements of hinges and slides in the order of `mechanism`.
std::pair<double, VectorX> EqualityOfPeer(Peer& peer, const Mechanism& mechanism, const VectorX& q,
                                          const std::string& name) {
  for (const auto& joint : mechanism.joints()) {
    const int dof = peer.Dof(joint.name);
    peer.d->qpos[dof] = peer.m->qpos0[dof] + q[joint.offset];
  }
  mj_forward(peer.m.get(), peer.d.get());
  const int id = mj_name2id(peer.m.get(), mjOBJ_EQUALITY, name.c_str());
  int row = -1;
  for (int i = 0; i < peer.d->nefc; ++i)
    if (peer.d->efc_type[i] == mjCNSTR_EQUALITY && peer.d->efc_id[i] == id) row = i;
  if (row < 0) throw std::runtime_error("MuJoCo has no row of equality " + name);
  VectorX slope(mechanism.num_coordinates());
  for (const auto& joint : mechanism.joints()) {
    VectorX unit = VectorX::Zero(peer.m->nv), out(peer.d->nefc);
    unit[peer.Dof(joint.name)] = 1;
    mj_mulJacVec(peer.m.get(), peer.d.get(), out.data(), unit.data());
    slope[joint.offset] = out[row];
  }
  return {peer.d->efc_pos[row], slope};
}

// Rows of our couplings are MuJoCo's, but for a factor.
void ExpectEqualitiesOfPeer(const std::string& text, const Mechanism& mechanism, const VectorX& q) {
  Peer peer(text);
  Kinematics kinematics(mechanism);
  VectorX c;
  MatrixX A;
  ComputeKinematics(mechanism, q, kinematics);
  ClosureResidual(mechanism, kinematics, q, c);
  ClosureJacobian(mechanism, kinematics, q, A);
  int row = 0;
  for (const Mechanism::Coupling& coupling : mechanism.couplings()) {
    const auto [residual, slope] = EqualityOfPeer(peer, mechanism, q, coupling.name);
    Eigen::Index largest = 0;
    slope.cwiseAbs().maxCoeff(&largest);
    ASSERT_NE(A(row, largest), 0) << coupling.name;
    const double factor = slope[largest] / A(row, largest);
    EXPECT_NEAR(factor * c[row], residual, 1e-12) << coupling.name;
    EXPECT_LT((factor * A.row(row).transpose() - slope).cwiseAbs().maxCoeff(), 1e-12) << coupling.name;
    ++row;
  }
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
  ASSERT_EQ(loaded.scene.mechanisms[0].couplings.size(), 3u);
  EXPECT_NEAR(loaded.scene.mechanisms[1].couplings[0].polynomial[0], .05, 1e-15);
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
  ExpectEqualitiesOfPeer(text, mechanism, q);
}

// Two rotors drive pitch and roll: q_pitch = (m1 + m2)/2, q_roll = 0.7 m1 - 0.4 m2. Four trees of the file are one
// mechanism.
TEST(ImportClosures, TendonEquality_OverThreeJointsOfSeveralTrees_IsACoupling) {
  const std::string text = R"(<mujoco><compiler angle="radian"/><worldbody>
    <body name="a"><joint name="m1" ref=".2"/><geom size=".1"/></body>
    <body name="b"><joint name="m2" ref="-.1"/><geom size=".1"/></body>
    <body name="p"><joint name="pitch" axis="0 1 0"/><geom size=".1"/>
      <body name="r"><joint name="roll" axis="1 0 0"/><geom size=".1"/></body></body>
    <body name="s"><joint name="slide" type="slide" axis="1 0 0"/><geom size=".1"/></body></worldbody>
    <tendon><fixed name="tp"><joint joint="m1" coef=".5"/><joint joint="m2" coef=".5"/><joint joint="pitch" coef="-1"/></fixed>
      <fixed name="tr"><joint joint="m1" coef=".7"/><joint joint="m2" coef="-.4"/><joint joint="roll" coef="-1"/></fixed>
      <fixed name="sum"><joint joint="pitch" coef=".3"/><joint joint="roll" coef=".6"/><joint joint="slide" coef="2"/></fixed>
      <fixed name="tm"><joint joint="m1" coef="2"/></fixed></tendon>
    <equality><tendon name="e1" tendon1="tp" polycoef=".01 0 0 0 0"/><tendon name="e2" tendon1="tr" tendon2="tm" polycoef="0 .1 0 0 0"/>
      <tendon name="e3" tendon1="sum" tendon2="tm" polycoef=".1 .7 .2 -.05 .01"/></equality></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  ASSERT_EQ(loaded.scene.mechanisms[0].couplings.size(), 3u);
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  ASSERT_EQ(mechanism.num_coordinates(), 5);
  VectorX q(5);
  q << .7, .25, -.4, .3, .6;
  ExpectEqualitiesOfPeer(text, mechanism, q);
}

// Joints a, b and c of one tree each, with tendons of these coefficients.
std::string ThreeJoints(const std::string& equalities) {
  return R"(<mujoco><compiler angle="radian"/><worldbody>
    <body name="a"><joint name="ja"/><geom size=".1"/></body><body name="b"><joint name="jb"/><geom size=".1"/></body>
    <body name="c"><joint name="jc"/><geom size=".1"/></body></worldbody>
    <tendon><fixed name="ab"><joint joint="ja" coef=".1"/><joint joint="jb" coef=".2"/></fixed>
      <fixed name="bc"><joint joint="jb" coef="1"/><joint joint="jc" coef="-.5"/></fixed>
      <fixed name="abc"><joint joint="ja" coef=".2"/><joint joint="jb" coef="1.4"/><joint joint="jc" coef="-.5"/></fixed>
      <fixed name="zero"><joint joint="ja" coef="0"/><joint joint="jb" coef="0"/></fixed>
      <fixed name="b3"><joint joint="jb" coef="3"/></fixed><fixed name="b1"><joint joint="jb" coef="1"/></fixed>
      <fixed name="ab10"><joint joint="ja" coef="1"/><joint joint="jb" coef="2"/></fixed></tendon><equality>)" +
         equalities + "</equality></mujoco>";
}

TEST(ImportClosures, TendonEquality_WithNoJointLeft_IsDroppedOrRefused) {
  for (const std::string tendons : {"tendon1='zero'", "tendon1='ab' tendon2='ab10'"}) {
    const ImportedScene loaded =
        MustLoad(ThreeJoints("<tendon name='e' " + tendons + " polycoef='0 .1 0 0 0'/>"));
    EXPECT_EQ(loaded.scene.mechanisms.size(), 3u);
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped,
                        "equality constraint 'e': no joint has a part in it"));
    const Error error = MustFail(ThreeJoints("<tendon name='e' " + tendons + " polycoef='.3 .1 0 0 0'/>"));
    EXPECT_EQ(error.code, ErrorCode::kModel);
    EXPECT_CONTAINS(error.Text(), "test.xml, equality 'e': asks for a length of 0.3 that no joint changes");
  }
}

TEST(ImportClosures, TendonEquality_ThatFollowsFromOthers_IsNotedOrRefused) {
  const std::string two =
      "<tendon name='e1' tendon1='ab' polycoef='.1 0 0 0 0'/><tendon name='e2' tendon1='bc'/>";
  const ImportedScene loaded =
      MustLoad(ThreeJoints(two + "<tendon name='e3' tendon1='abc' polycoef='.2 0 0 0 0'/>"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged,
                      "equality constraint 'e3': it follows from 'e1' and 'e2' and adds nothing"));
  const Error error = MustFail(ThreeJoints(two + "<tendon name='e3' tendon1='abc' polycoef='.3 0 0 0 0'/>"));
  EXPECT_EQ(error.code, ErrorCode::kModel);
  EXPECT_CONTAINS(error.Text(), "test.xml, equality 'e3': contradicts 'e1' and 'e2'");
}

TEST(ImportClosures, TendonEquality_OfHigherOrder_NeedsOneJointInItsSecondTendon) {
  const std::string square = " polycoef='0 1 .5 0 0'/>";
  for (const std::string tendons : {"tendon1='b3' tendon2='ab'", "tendon1='b3' tendon2='b1'"}) {
    const ImportedScene loaded = MustLoad(ThreeJoints("<tendon name='e' " + tendons + square));
    EXPECT_TRUE(loaded.scene.mechanisms[0].couplings.empty());
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "second or higher order"));
  }
  for (const std::string equality : {"tendon1='ab' tendon2='bc' polycoef='.1 .7 0 0 0'/>",
                                     "tendon1='abc' tendon2='b3' polycoef='.1 .7 .2 0 .1'/>"}) {
    const std::string text = ThreeJoints("<tendon name='e' " + equality);
    const Mechanism mechanism = MustBuild(MustLoad(text).scene.mechanisms[0]);
    ASSERT_EQ(mechanism.num_coordinates(), 3);
    ExpectEqualitiesOfPeer(text, mechanism, Vector3(.3, -.2, .5));
  }
}

TEST(ImportClosures, FloatingTreePinnedToTheWorld) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
    <body name="kite" pos="0 0 1"><freejoint/><geom size=".1"/>
      <body name="tail" pos=".2 0 0"><joint/><geom size=".05"/></body></body></worldbody>
    <equality><connect body1="kite" anchor="0 0 .5"/></equality></mujoco>)");
  const MechanismDef& mechanism = loaded.scene.mechanisms[0];
  EXPECT_EQ(mechanism.base, BaseKind::kFixed);
  EXPECT_EQ(mechanism.bodies[0].name, "world");
  EXPECT_EQ(mechanism.joints[0].name, "joint0.position");
  EXPECT_EQ(mechanism.joints[1].name, "joint0.rotation");
  EXPECT_EQ(mechanism.joints[1].kind, JointKind::kBall);
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

// A crane whose load lies below the hook, and equalities of every kind that are off; `order` puts them elsewhere.
std::string CraneWith(bool equalities, const std::string& flag, bool load_first, const std::string& active) {
  const std::string
      load =
          R"(<body name="load" pos="0 0 .2" euler="10 0 20"><freejoint/><geom size=".1" mass=".5"/></body>)",
      boom = R"(<body name="boom" pos="0 0 1"><joint name="lift" type="slide" axis="0 0 1" stiffness="50"/>
      <geom size=".05" mass="1" contype="0" conaffinity="0"/><body name="hook" pos="0 0 -.3">
      <joint name="sway" axis="0 1 0" stiffness="2"/><geom size=".02" mass=".1" pos=".05 0 0" contype="0" conaffinity="0"/>
      </body></body>)";
  std::string off;
  if (equalities)
    for (const char* equality :
         {R"(weld name="grab" body1="hook" body2="load")",
          R"(connect name="pin" body1="load" body2="hook" anchor="0 0 .1")",
          R"(joint name="brake" joint1="lift")", R"(tendon name="reel" tendon1="rope")"})
      off += "<" + std::string(equality) + active + "/>";
  return "<mujoco><option>" + flag + "</option><worldbody>" + (load_first ? load + boom : boom + load) +
         R"(</worldbody><tendon><fixed name="rope"><joint joint="sway" coef="2"/></fixed></tendon><equality>)" +
         off + "</equality></mujoco>";
}

TEST(ImportClosures, EqualitiesThatAreOff_ConstrainNothingAndAreNamed) {
  for (const bool load_first : {false, true})
    for (const bool by_flag : {false, true}) {
      SCOPED_TRACE(fmt::format("load first {}, by flag {}", load_first, by_flag));
      const std::string flag = by_flag ? R"(<flag equality="disable"/>)" : "";
      const ImportedScene off =
          MustLoad(CraneWith(true, flag, load_first, by_flag ? "" : R"( active="false")"));
      // Those of two bodies a control switches on (tests/switched_equalities), but for a flag.
      EXPECT_TRUE(HasNote(off.report, ImportNote::Kind::kDropped,
                          by_flag ? "'grab', 'pin', 'brake' and 'reel'" : "'brake' and 'reel'"));
      EXPECT_EQ(off.scene.mechanisms.at(0).switched_closures.size(), by_flag ? 0u : 2u);
      EXPECT_TRUE(HasNote(off.report, ImportNote::Kind::kDropped,
                          by_flag ? "remove equality or constraint from <flag>" : "active is false"));
      const auto start = [](const Scene& scene) {
        auto simulation = Simulation::Create(scene);
        if (!simulation) throw std::runtime_error(simulation.error().Text());
        return std::move(*simulation);
      };
      Simulation ours = start(off.scene),
                 without = start(MustLoad(CraneWith(false, "", load_first, "")).scene);
      for (int i = 0; i < 30; ++i) {
        ours.Step();
        without.Step();
      }
      // Their controls are inputs more.
      EXPECT_EQ(ours.HashState() == without.HashState(), by_flag);
      for (const char* body : {"hook", "load"})
        EXPECT_EQ((ours.Pose(body).translation() - without.Pose(body).translation()).norm(), 0);
      // The load falls freely: z0 - g t²/2, by a rule that is exact for constant accelerations.
      EXPECT_NEAR(ours.Pose("load").translation().z(), 0.2 - 0.5 * 9.81 * ours.time() * ours.time(), 1e-9);
      // On, they hold the load to the crane.
      const ImportedScene on = MustLoad(CraneWith(true, "", load_first, ""));
      EXPECT_TRUE(on.scene.free_bodies.empty());
      EXPECT_FALSE(HasNote(on.report, ImportNote::Kind::kDropped, "equality"));
    }
}

}  // namespace
}  // namespace fork1s::testing_importer
