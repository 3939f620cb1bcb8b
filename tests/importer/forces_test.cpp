// Springs, tendons and actuators against the generalised forces that MuJoCo computes.
#include <limits>
#include <map>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

// τ of springs, dampers and inputs of the imported mechanism, and MuJoCo's qfrc, on scalar joints.
void ExpectSameForces(const std::string& text, double tolerance = 1e-10) {
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  Peer peer(text);
  const mjModel& m = *peer.m;
  mjData& d = *peer.d;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const int n = mechanism.num_coordinates();
  for (int trial = 0; trial < 5; ++trial) {
    VectorX q(n), v(n), u(static_cast<Eigen::Index>(mechanism.controls().size()));
    for (int i = 0; i < u.size(); ++i) {
      u[i] = uniform(random);
      d.ctrl[mj_name2id(&m, mjOBJ_ACTUATOR, mechanism.controls()[i].name.c_str())] = u[i];
    }
    for (const auto& joint : mechanism.joints()) {
      const int id = mj_name2id(&m, mjOBJ_JOINT, joint.name.c_str());
      q[joint.offset] = uniform(random);
      v[joint.offset] = uniform(random);
      d.qpos[m.jnt_qposadr[id]] = m.qpos0[m.jnt_qposadr[id]] + q[joint.offset];
      d.qvel[m.jnt_dofadr[id]] = v[joint.offset];
    }
    mj_forward(&m, &d);
    Kinematics kinematics(mechanism);
    ComputeKinematics(mechanism, q, kinematics);
    VectorX tau = VectorX::Zero(n);
    SpringForce(mechanism, kinematics, q, tau);
    tau -= DampingMatrix(mechanism, kinematics, q) * v;
    AddControlForce(mechanism, kinematics, u, tau);
    for (const auto& joint : mechanism.joints()) {
      const int dof = peer.Dof(joint.name);
      EXPECT_NEAR(tau[joint.offset], d.qfrc_passive[dof] + d.qfrc_actuator[dof], tolerance) << joint.name;
    }
  }
}

std::string Model(const std::string& joint_attributes, const std::string& rest) {
  return R"(<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
    <body name="a"><joint name="ja" axis="0 1 0" )" +
         joint_attributes + R"(/><geom size=".1"/>
      <body name="b" pos="0 0 .3"><joint name="jb" axis="1 0 0" ref="-.3"/><geom size=".1"/>
        <body name="c" pos="0 0 .3"><joint name="jc" type="slide" axis="0 0 1" ref=".1"/><geom size=".1"/></body>
      </body></body></worldbody>)" +
         rest + "</mujoco>";
}

TEST(ImportForces, JointSpringAwayFromItsReference) {
  ExpectSameForces(Model(R"(stiffness="7" damping=".3" springref=".8" ref=".2")", ""));
}

TEST(ImportForces, MotorsAtAVoltageAndWithControllersOfTheirOwn) {
  ExpectSameForces(Model("", R"(<actuator>
    <dcmotor name="at_voltage" joint="ja" resistance="2" motorconst=".5 .3" gear="3"/>
    <dcmotor name="servo" joint="jb" resistance="2" motorconst=".5" input="pos" controller="3 0 .1"/>
    <pid name="pid" joint="jc" input="vel" kp="2" kv=".4"/></actuator>)"));
}

TEST(ImportForces, DampingOfTheActuatorItself) {
  ExpectSameForces(Model(
      "",
      R"(<tendon><fixed name="t"><joint joint="jb" coef=".4"/><joint joint="jc" coef="-2"/></fixed></tendon>
    <actuator><motor name="m" joint="ja" damping=".5" gear="3"/><motor name="rope" tendon="t" damping=".7"/></actuator>)"));
}

TEST(ImportForces, ServoWithGearAndBias) {
  ExpectSameForces(Model(R"(stiffness="7" springref=".8" ref=".2")", R"(<actuator>
    <position name="p" joint="ja" kp="20" gear="3"/>
    <general name="g" joint="jb" gear="-2" gainprm="5" biastype="affine" biasprm="1.5 -4 -.6"/>
    <velocity name="v" joint="jc" kv="2.5"/>
    <motor name="m" joint="jc" gear="4"/>
    <position name="p2" joint="jb" kp="3"/></actuator>)"));
}

TEST(ImportForces, TendonServoAndTendonSpring) {
  ExpectSameForces(Model(R"(ref=".2")", R"(<tendon>
    <fixed name="t" stiffness="11" damping=".7" springlength=".4"><joint joint="ja" coef=".5"/><joint joint="jb" coef="-2"/></fixed>
    <fixed name="s"><joint joint="jb" coef="1"/><joint joint="jc" coef="3"/></fixed>
    <fixed name="one" stiffness="2"><joint joint="jc" coef="-1.5"/></fixed></tendon>
    <actuator>
    <position name="p" tendon="s" kp="9" gear="1.7"/>
    <general name="g" tendon="one" gear="2" gainprm="5" biastype="affine" biasprm=".5 -4 -.6"/>
    <motor name="m" tendon="t" gear="2"/></actuator>)"));
}

TEST(ImportForces, ServosAndMotorsOnSites) {
  const std::string sites =
      R"(<mujoco><option gravity="0 0 0"/><worldbody><site name="w" pos=".1 .2 0" euler="10 20 30"/>
    <body name="a"><joint name="ja" axis="0 1 0"/><geom size=".1"/><site name="sa" pos="0 .1 .1" euler="40 0 0"/>
      <body name="b" pos="0 0 .3"><joint name="jb" axis="1 0 0" ref="-.3"/><geom size=".1"/>
        <body name="c" pos="0 0 .3"><joint name="jc" type="slide" axis="0 0 1" ref=".1"/><geom size=".1"/>
          <site name="sc" pos=".1 .1 0" euler="0 50 10"/></body>
      </body></body></worldbody>)";
  ExpectSameForces(sites + R"(<actuator>
    <motor name="jet" site="sc" gear="1 -2 .5 .1 .2 .3"/>
    <general name="no_length" site="sa" gear="0 0 3 0 1 0" gainprm="5" biastype="affine" biasprm="0 -5 -.4"/>
    <position name="p" site="sc" refsite="w" gear="1 0 2 0 0 0" kp="20" kv=".3"/>
    <position name="turn" site="sc" refsite="sa" gear="0 0 0 1 0 .5" kp="4"/>
    <velocity name="v" site="sa" refsite="sc" gear="0 1 0 0 0 0" kv="2"/>
    <general name="crank" cranksite="sc" slidersite="sa" cranklength=".8" gear="2" gainprm="5" biastype="affine" biasprm="1.5 -4 -.6"/>
    </actuator></mujoco>)");
}

// Forces and energy at poses on either side of the range and within it.
TEST(ImportForces, SlackTendons) {
  const std::string text =
      R"(<mujoco><option gravity="0 0 0"><flag energy="enable"/></option><worldbody><site name="w" pos=".1 .2 0"/>
    <body name="a"><joint name="ja" axis="0 1 0"/><geom size=".1"/>
      <body name="b" pos="0 0 .3"><joint name="jb" axis="1 0 0"/><geom size=".1"/><site name="sb" pos="0 .1 .2"/></body></body>
    </worldbody><tendon>
    <spatial name="rope" stiffness="30" springlength="0 .5" damping=".2"><site site="w"/><site site="sb"/></spatial>
    <fixed name="both" stiffness="11 3 7" springlength="-.3 .2"><joint joint="ja" coef=".5"/><joint joint="jb" coef="-1"/></fixed>
    <fixed name="one" stiffness="2" springlength=".1 .6"><joint joint="ja" coef="-1.5"/></fixed></tendon></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kChanged, "slack"));
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  ASSERT_EQ(m.springs().size(), 3u);
  Peer peer(text);
  mjData& d = *peer.d;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::map<std::pair<std::string, int>, int> seen;
  for (int pose = 0; pose < 100; ++pose) {
    const VectorX q = (VectorX(2) << uniform(random), uniform(random)).finished(),
                  v = (VectorX(2) << uniform(random), uniform(random)).finished();
    for (int i = 0; i < 2; ++i) d.qpos[i] = q(i), d.qvel[i] = v(i);
    mj_forward(peer.m.get(), &d);
    Kinematics k(m);
    ComputeKinematics(m, q, k);
    VectorX tau = VectorX::Zero(2);
    SpringForce(m, k, q, tau);
    tau -= DampingMatrix(m, k, q) * v;
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(tau(i), d.qfrc_passive[i], 1e-13) << pose;
    EXPECT_NEAR(SpringEnergy(m, k, q), d.energy[0], 1e-14) << pose;
    for (const Mechanism::Spring& s : m.springs()) ++seen[{s.name, s.SideOf(LengthOf(m, s.length, k, q))}];
  }
  EXPECT_EQ(seen.size(), 8u);  // the rope is never shorter than nothing
  for (const auto& [where, count] : seen) EXPECT_GT(count, 5) << where.first << " " << where.second;
}

TEST(ImportForces, ControlsKeepNamesRangesAndKinds) {
  const ImportedScene loaded = MustLoad(Model("", R"(<actuator>
    <position name="p" joint="ja" kp="20" ctrllimited="true" ctrlrange=".5 1"/>
    <motor name="m" joint="jb"/><velocity name="v" joint="jc" kv="3"/></actuator>)"));
  const auto& controls = loaded.scene.mechanisms[0].controls;
  ASSERT_EQ(controls.size(), 3u);
  EXPECT_TRUE(controls[0].is_setpoint);
  EXPECT_EQ(controls[0].initial, .5);  // 0 is outside the range
  EXPECT_EQ(controls[0].upper, 1);
  EXPECT_FALSE(controls[1].is_setpoint);
  EXPECT_FALSE(controls[2].is_setpoint);
  EXPECT_EQ(loaded.report.holds.size(), 3u);
  EXPECT_CONTAINS(loaded.report.holds[0].held_by, "position actuator 'p' 20 N·m/rad");
}

TEST(ImportForces, ClampctrlDisabled_LeavesControlsUnbounded) {
  const auto upper = [](const std::string& flag) {
    return MustLoad(
               "<mujoco><option><flag clampctrl='" + flag +
               "'/></option><worldbody><body name='b'><joint name='j'/><geom size='.1'/></body></worldbody>"
               "<actuator><motor name='m' joint='j' ctrlrange='-1 1'/></actuator></mujoco>")
        .scene.mechanisms[0]
        .controls[0]
        .upper;
  };
  EXPECT_EQ(upper("enable"), 1);
  EXPECT_EQ(upper("disable"), std::numeric_limits<double>::infinity());
}

// MuJoCo's limits push from `margin` inside of the range on.
TEST(ImportForces, MarginOfLimits_NarrowsTheRange) {
  const auto load = [](const std::string& margin) {
    return MustLoad(
               "<mujoco><worldbody><body name='b'><joint name='j' type='slide' axis='0 0 1' range='-.1 1' " +
               margin + "/><geom size='.1'/></body></worldbody><tendon><fixed range='-.2 .3' " + margin +
               "><joint joint='j' coef='1'/></fixed></tendon></mujoco>")
        .scene.mechanisms[0];
  };
  const MechanismDef near = load("margin='.02'"), beyond = load("margin='2'");
  EXPECT_DOUBLE_EQ(near.joints[0].freedoms[0].lower, -.08);
  EXPECT_DOUBLE_EQ(near.joints[0].freedoms[0].upper, .98);
  EXPECT_DOUBLE_EQ(near.length_limits[0].lower, -.18);
  EXPECT_DOUBLE_EQ(near.length_limits[0].upper, .28);
  EXPECT_DOUBLE_EQ(beyond.joints[0].freedoms[0].lower, .45);
  EXPECT_DOUBLE_EQ(beyond.joints[0].freedoms[0].upper, .45);
}

TEST(ImportForces, WhatIsNotSimulatedIsListed) {
  const ImportedScene loaded = MustLoad(
      Model(R"(frictionloss=".1")", R"(
    <tendon><spatial name="cable"><site site="s0"/><site site="s1"/></spatial>
      <fixed name="t"><joint joint="ja" coef="1"/></fixed></tendon>
    <actuator><motor name="pull" tendon="cable"/>
      <general name="tips_over" joint="jb" biastype="affine" biasprm="0 3 0"/>
      <position name="clipped" joint="jc" kp="2" forcelimited="true" forcerange="-1 1"/>
      <general name="slow" joint="ja" dyntype="filter"/></actuator>
    <equality><tendon tendon1="t" tendon2="cable"/><joint name="off" joint1="ja" joint2="jb" active="false"/></equality>
    <sensor><user dim="1"/><user dim="2"/></sensor>)")
          .replace(
              std::string(R"(<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>)").size(),
              0, R"(<site name="s0"/><site name="s1" pos="1 0 0"/>)"));
  for (const char* part : {"'pull'", "'tips_over'", "tendon equality constraint",
                           "inactive equality constraint 'off'", "2 x sensor"}) {
    EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, part)) << part;
  }
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "'slow'"));
  ASSERT_EQ(loaded.scene.mechanisms[0].force_limits.size(), 1u);
  EXPECT_EQ(loaded.scene.mechanisms[0].force_limits[0].name, "clipped");
  ASSERT_EQ(loaded.scene.mechanisms[0].frictions.size(), 1u);
  EXPECT_EQ(loaded.scene.mechanisms[0].frictions[0].force, 0.1);
  EXPECT_EQ(loaded.scene.mechanisms[0].controls.size(), 2u);  // slow, clipped
}

TEST(ImportForces, MusclesHaveTheirParameters) {
  const ImportedScene loaded = MustLoad(Model("", R"(<actuator>
    <muscle name="strong" joint="ja" gear=".1" lengthrange="-.2 .3" force="50" timeconst=".02 .06" tausmooth=".1"/>
    <muscle name="scaled" joint="jb" gear=".1" lengthrange="-.2 .3" scale="300" range=".8 1.1" fpmax="2"/>
    <muscle name="bound" joint="jc" lengthrange="-.2 .3" forcerange="-10 0"/>
    <general name="isometric" joint="jc" lengthrange="-.2 .3" gaintype="muscle" gainprm=".7 1.1 40 200 .5 1.6 1.5 1.3 1.2"/>
    <general name="mixed" joint="ja" lengthrange="-.2 .3" gaintype="muscle" gainprm=".7 1.1 40 200 .5 1.6 1.5 1.3 1.2"
      biastype="affine" biasprm="0 -1 0"/>
    <muscle name="endless" joint="jc"/></actuator>)"));
  const MechanismDef& def = loaded.scene.mechanisms[0];
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "'mixed'"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "'endless'"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "forcerange"));
  ASSERT_EQ(def.muscles.size(), 4u);
  ASSERT_EQ(def.controls.size(), 4u);
  EXPECT_EQ(def.controls[0].dynamics, ControlDynamics::kMuscle);
  EXPECT_EQ(def.controls[0].time_constant, .02);
  EXPECT_EQ(def.controls[0].deactivation_time, .06);
  EXPECT_EQ(def.controls[0].smoothing, .1);
  EXPECT_EQ(def.controls[3].dynamics, ControlDynamics::kNone);
  EXPECT_EQ(def.muscles[0].force, 50);
  EXPECT_EQ(def.muscles[0].length_lower, -.2);
  // jb is at -0.3 rad at the reference, of 0.1 m/rad.
  EXPECT_NEAR(def.muscles[1].length_lower, -.17, 1e-15);
  EXPECT_NEAR(def.muscles[1].length_upper, .33, 1e-15);
  EXPECT_EQ(def.muscles[1].range_lower, .8);
  EXPECT_EQ(def.muscles[1].fpmax, 2);
  EXPECT_EQ(def.muscles[3].fpmax, 0);
}

TEST(ImportForces, FiltersAndIntegratorsHaveAnActivation) {
  const std::vector<ControlDef> controls =
      MustLoad(Model("", R"(<actuator><general name="filter" joint="ja" dyntype="filter" dynprm=".3"/>
    <position name="exact" joint="ja" kp="2" timeconst=".2" inheritrange="0" ctrlrange="-1 1"/>
    <general name="bound" joint="jb" dyntype="filterexact" dynprm=".1" actlimited="true" actrange="-.4 .5"/>
    <general name="integrated" joint="jb" dyntype="integrator" actlimited="true" actrange="-2 3" ctrlrange="-1 1"/>
    <general name="instant" joint="jc" dyntype="filterexact" dynprm="0"/><motor name="motor" joint="jc"/></actuator>)"))
          .scene.mechanisms[0]
          .controls;
  ASSERT_EQ(controls.size(), 6u);
  EXPECT_EQ(controls[0].dynamics, ControlDynamics::kLag);
  EXPECT_EQ(controls[0].time_constant, .3);
  EXPECT_EQ(controls[0].initial_activation, 0);
  EXPECT_EQ(controls[1].dynamics, ControlDynamics::kLag);
  EXPECT_EQ(controls[1].time_constant, .2);
  EXPECT_EQ(controls[1].upper, 1);
  EXPECT_EQ(controls[2].activation_lower, -.4);
  EXPECT_EQ(controls[2].activation_upper, .5);
  EXPECT_EQ(controls[3].dynamics, ControlDynamics::kIntegrator);
  EXPECT_EQ(controls[3].activation_upper, 3);
  EXPECT_EQ(controls[3].upper, 1);  // of the input, which is the rate
  EXPECT_EQ(controls[4].dynamics, ControlDynamics::kNone);
  EXPECT_EQ(controls[5].dynamics, ControlDynamics::kNone);
}

TEST(ImportForces, BallSpringAndServo) {
  const std::string text = R"(<mujoco><option gravity="0 0 0"/><worldbody>
    <body name="a"><joint name="ball" type="ball" stiffness="5" damping=".2" pos="0 0 -.1"/><geom size=".1"/></body></worldbody>
    <actuator><position name="turn" joint="ball" kp="3" gear="0 1 0"/></actuator></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  Kinematics kinematics(mechanism);
  const Vector3 q(.2, -.4, .3);
  ComputeKinematics(mechanism, q, kinematics);
  VectorX tau = VectorX::Zero(3);
  SpringForce(mechanism, kinematics, q, tau);
  // The servo's torque of 3 (0 + 0.4) N·m is about the y axis of the body: a force on ω.
  const Vector3 on_omega = DexpRotation(-q).transpose() * Vector3(0, 3 * .4, 0);
  EXPECT_LT((tau - Vector3(-5 * q + on_omega)).norm(), 1e-12);
  EXPECT_EQ(loaded.report.holds.size(), 3u);
}

// Generalized forces of every actuator of a ball joint as MuJoCo has them, where the joint is far from zero.
TEST(ImportForces, BallActuatorsActInTheAxesOfTheFile) {
  const std::string text = R"(<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
    <body name="p" quat=".9 .1 -.3 .2"><joint name="h" axis="0 1 1"/><geom size=".1"/>
    <body name="a" pos=".1 0 0" quat=".8 .4 0 .4"><joint name="ball" type="ball" pos="0 0 -.1"/><geom size=".1"/></body>
    </body></worldbody><actuator>
    <motor name="child" joint="ball" gear=".5 1 -2"/><motor name="parent" jointinparent="ball" gear=".5 1 -2"/>
    <position name="servo" joint="ball" kp="3" gear=".2 1 -.4"/>
    <position name="parent_servo" jointinparent="ball" kp="2" gear="1 0 0"/></actuator></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  const Mechanism mechanism = MustBuild(loaded.scene.mechanisms[0]);
  const Vector3 theta(1.2, -.8, 1.4);
  Eigen::Vector4d q(.3, theta.x(), theta.y(), theta.z());
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const Eigen::Vector4d u(.7, -.4, .5, .2);
  VectorX tau = VectorX::Zero(4);
  SpringForce(mechanism, kinematics, q, tau);
  AddControlForce(mechanism, kinematics, u, tau);
  Peer peer(text);
  const Quaternion turn(ExpRotation(theta));
  const double qpos[] = {.3, turn.w(), turn.x(), turn.y(), turn.z()};
  std::copy(qpos, qpos + 5, peer.d->qpos);
  std::copy(u.data(), u.data() + 4, peer.d->ctrl);
  mj_forward(&*peer.m, &*peer.d);
  VectorX expected = Eigen::Map<const Eigen::Vector4d>(peer.d->qfrc_actuator);
  expected.tail<3>() = DexpRotation(-theta).transpose() * Vector3(expected.tail<3>());
  EXPECT_LT((tau - expected).norm(), 1e-12) << tau.transpose() << " and " << expected.transpose();
}

}  // namespace
}  // namespace fork1s::testing_importer
