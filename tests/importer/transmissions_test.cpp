// Actuators on sites and slider-cranks: lengths and lever arms against MuJoCo, at any pose.
#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

// Sites in the world, on one tree and on another, turned in their bodies; some on the same branch.
const char* const kPushers = R"(<mujoco><worldbody><site name="w" pos=".1 -.2 .3" euler="20 -40 70"/>
  <body name="a" pos="0 0 .05"><joint name="ja" axis="0 1 .2"/><joint name="sa" type="slide" axis="1 0 0"/>
    <geom size=".02" contype="0" conaffinity="0"/><site name="a1" pos=".05 .03 .02" euler="-30 10 50"/>
    <body name="b" pos=".2 0 0"><joint name="jb" axis="0 1 0"/><joint name="kb" axis="0 .3 1"/>
      <geom size=".02" contype="0" conaffinity="0"/><site name="b1" pos=".06 .01 .04" euler="80 20 10"/>
      <body name="c" pos=".15 0 0"><joint name="jc" axis="1 1 0"/>
        <geom size=".02" contype="0" conaffinity="0"/><site name="c1" pos=".08 .02 .03" euler="10 -60 30"/></body></body>
    <body name="e" pos="0 .2 0"><joint name="je" axis="0 0 1"/><geom size=".02" contype="0" conaffinity="0"/>
      <site name="e1" pos=".04 0 .05" euler="0 70 20"/></body></body>
  <body name="d" pos="0 .3 .05"><joint name="jd" axis="1 0 .1"/>
    <geom size=".02" contype="0" conaffinity="0"/><site name="d1" pos=".03 0 .15" euler="15 25 -35"/></body></worldbody>
  <actuator>
    <general name="jet" site="c1" gear="1 2 -.5 .3 -.2 .7"/>
    <general name="from_world" site="b1" refsite="w" gear=".4 -1 2 0 0 0"/>
    <general name="from_above" site="c1" refsite="a1" gear="1 .5 -2 0 0 0"/>
    <general name="from_below" site="a1" refsite="c1" gear="1 .5 -2 0 0 0"/>
    <general name="from_aside" site="c1" refsite="e1" gear=".3 0 1 .5 -.4 1"/>
    <general name="turn" site="b1" refsite="w" gear="0 0 0 .5 -.4 1"/>
    <general name="over_there" site="d1" refsite="b1" gear="1 0 2 0 .4 1"/>
    <general name="crank" cranksite="c1" slidersite="a1" cranklength=".35" gear="-2"/>
    <general name="crank_in_world" cranksite="b1" slidersite="w" cranklength=".5"/>
    <general name="crank_over_there" cranksite="d1" slidersite="c1" cranklength=".6" gear=".7"/>
    <general name="short_crank" cranksite="b1" slidersite="w" cranklength=".3"/>
  </actuator></mujoco>)";

TEST(ImportTransmissions, LengthsAndArmsAreMujocosAtAnyPose) {
  const ImportedScene loaded = MustLoad(kPushers);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);  // an actuator between them ties the two trees
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kChanged, "lever arms"));
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  const int n = m.num_coordinates();
  ASSERT_EQ(m.controls().size(), 11u);
  Peer peer(kPushers);
  mjData& d = *peer.d;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  VectorX q(n), at_reference(11);
  mj_forward(peer.m.get(), &d);
  for (int i = 0; i < 11; ++i) at_reference(i) = d.actuator_length[i];
  for (int pose = 0; pose < 300; ++pose) {
    for (const auto& joint : m.joints()) {
      q(joint.offset) = (joint.kind == JointKind::kSlide ? 0.05 : 1.4) * uniform(random);
      d.qpos[peer.Dof(joint.name)] = q(joint.offset);  // one coordinate a joint
    }
    mj_forward(peer.m.get(), &d);
    Kinematics k(m);
    ComputeKinematics(m, q, k);
    for (const Mechanism::Control& control : m.controls()) {
      const int i = mj_name2id(peer.m.get(), mjOBJ_ACTUATOR, control.name.c_str());
      SCOPED_TRACE(control.name + ", pose " + std::to_string(pose));
      // Turns come to MuJoCo by quaternions.
      EXPECT_NEAR(LengthOf(m, control.length, k, q), d.actuator_length[i] - at_reference(i), 1e-13);
      VectorX arms = VectorX::Zero(n), theirs = arms;
      ForEachArm(control.length, k.paths, [&](int j, double arm) { arms(j) += arm; });
      for (const auto& joint : m.joints())
        for (int z = d.moment_rowadr[i]; z < d.moment_rowadr[i] + d.moment_rownnz[i]; ++z)
          if (d.moment_colind[z] == peer.Dof(joint.name)) theirs(joint.offset) = d.actuator_moment[z];
      EXPECT_LT((arms - theirs).norm(), 1e-12 * (1 + theirs.norm()));
      if (!m.HasPotential(control.length)) continue;
      // Where forces have a potential the arms are the slopes of the length.
      constexpr double kStep = 1e-6;
      for (int j = 0; j < n; ++j) {
        double ends[2];
        for (const int side : {0, 1}) {
          Kinematics moved(m);
          const VectorX there = q + (side ? kStep : -kStep) * VectorX::Unit(n, j);
          ComputeKinematics(m, there, moved);
          ends[side] = LengthOf(m, control.length, moved, there);
        }
        // Where a rod just reaches its axis the slope has no end, and differences have no digits.
        if (arms.norm() < 3) {
          EXPECT_NEAR(arms(j), (ends[1] - ends[0]) / (2 * kStep), 1e-7);
        }
      }
    }
  }
  std::vector<std::string> without;
  for (const Mechanism::Path& path : m.paths())
    if (!path.has_potential) without.push_back(path.name);
  EXPECT_EQ(without, (std::vector<std::string>{"jet", "from_below", "from_aside", "turn", "over_there"}));
}

// A force between two parts of a robot that floats does not depend on where the robot is.
TEST(ImportTransmissions, ForceWithinAFloatingRobot_DependsOnItsJointsAlone) {
  const std::string text = R"(<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint/><geom size=".1"/>
    <site name="hip" pos=".1 0 .05" euler="10 20 0"/><body name="leg" pos=".1 0 0"><joint name="knee" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site name="toe" pos=".2 .1 .02"/></body></body></worldbody>
    <actuator><position name="reach" site="toe" refsite="hip" gear="1 0 2 0 0 0" kp="5"/>
    <motor name="back" site="hip" refsite="toe" gear="1 0 2 0 .3 0"/></actuator></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  EXPECT_EQ(loaded.scene.mechanisms[0].base, BaseKind::kFloating);
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  ASSERT_EQ(m.controls().size(), 2u);
  Peer peer(text);
  mjData& d = *peer.d;
  const double turn[4] = {0.5, -0.1, 0.7, 0.4};
  for (int i = 0; i < 4; ++i) d.qpos[3 + i] = turn[i];
  const VectorX q = VectorX::Constant(1, 0.8);
  d.qpos[7] = q(0);
  mj_forward(peer.m.get(), &d);
  Kinematics k(m);
  ComputeKinematics(m, q, k);
  for (int i = 0; i < 2; ++i) {
    double arm = 0, theirs[7] = {};
    ForEachArm(m.controls()[static_cast<std::size_t>(i)].length, k.paths, [&](int, double a) { arm += a; });
    for (int z = d.moment_rowadr[i]; z < d.moment_rowadr[i] + d.moment_rownnz[i]; ++z)
      theirs[d.moment_colind[z]] = d.actuator_moment[z];
    EXPECT_NEAR(arm, theirs[6], 1e-14);
    for (int dof = 0; dof < 6; ++dof) EXPECT_NEAR(theirs[dof], 0, 1e-14) << dof;
  }
}

}  // namespace
}  // namespace fork1s::testing_importer
