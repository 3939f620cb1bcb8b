// Tendons through space, gravity compensation: against closed forms and MuJoCo.
#include <fmt/format.h>

#include <fork1s/reduction/compliance.hpp>

#include "helpers.hpp"
#include "importer/mjcf.hpp"

namespace fork1s::testing_importer {
namespace {

// Three links of 0.1, 0.08 and 0.06 m along x, hinges about y with springs, and one tendon over a pulley at
// each.
constexpr double kLink[3] = {0.1, 0.08, 0.06}, kRadius[3] = {0.012, 0.009, 0.007},
                 kJoint[3] = {0.8, 0.5, 0.3};
constexpr double kTendon = 4000;

std::string Finger() {
  std::string xml = R"(<mujoco><compiler angle="radian"/><worldbody>
    <site name="s0" pos="-.03 0 0"/><site name="side0" pos="0 0 .03"/>
    <geom name="p0" type="cylinder" size=".012 .01" euler="1.5707963267948966 0 0" contype="0" conaffinity="0"/>)";
  const char* const radius[3] = {"", ".009", ".007"};
  for (int i = 0; i < 3; ++i) {
    const double at = i == 0 ? 0 : kLink[i - 1];
    xml += "<body name=\"link" + std::to_string(i) + "\" pos=\"" + std::to_string(at) +
           " 0 0\"><joint name=\"j" + std::to_string(i) + "\" axis=\"0 1 0\" stiffness=\"" +
           std::to_string(kJoint[i]) +
           "\"/><inertial pos=\".03 0 0\" mass=\".1\" diaginertia=\"1e-4 1e-4 1e-4\"/>";
    const std::string n = std::to_string(i + 1), x = std::to_string(kLink[i]);
    xml += "<site name=\"s" + n + "\" pos=\"" + std::to_string(kLink[i] / 2) + " 0 0\"/>";
    if (i < 2)
      xml += "<site name=\"side" + n + "\" pos=\"" + x + " 0 .03\"/><geom name=\"p" + n +
             "\" type=\"cylinder\" size=\"" + radius[i + 1] + " .01\" pos=\"" + x +
             " 0 0\" euler=\"1.5707963267948966 0 0\" contype=\"0\" conaffinity=\"0\"/>";
  }
  xml += R"(</body></body></body></worldbody><tendon><spatial name="flexor" stiffness="4000">
    <site site="s0"/><geom geom="p0" sidesite="side0"/><site site="s1"/><geom geom="p1" sidesite="side1"/>
    <site site="s2"/><geom geom="p2" sidesite="side2"/><site site="s3"/></spatial></tendon></mujoco>)";
  return xml;
}

TEST(ImportTendons, AFingerOnATendonOverThreePulleysHasTheStiffnessOfTheClosedForm) {
  ImportOptions options;
  options.interfaces = {"link2"};
  const ImportedScene loaded = MustLoad(Finger(), options);
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kChanged, "tendon"));
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  const auto bodies = std::vector<BodyIndex>{m.FindBody("link2")};
  const auto compliance = WalkCompliance(m, VectorX::Zero(3), bodies);
  // The tip lies 0.24 m out; joint i moves it by its distance, a pulley takes in as much rope as it is round.
  Vector3 reach, arm;
  Matrix3 K = Matrix3::Zero();
  for (int i = 0; i < 3; ++i) {
    reach(i) = i == 0 ? 0.24 : i == 1 ? 0.14 : 0.06;
    arm(i) = kRadius[i];
    K(i, i) = kJoint[i];
  }
  K += kTendon * arm * arm.transpose();
  const double expected = reach.dot(K.inverse() * reach);
  Vector6 F;  // a unit force along z at the tip, about the origin of the last link
  F << Vector3(kLink[2], 0, 0).cross(Vector3::UnitZ()), Vector3::UnitZ();
  EXPECT_NEAR(F.dot(compliance.C * F), expected, 1e-8 * expected);
}

// Points, both kinds of obstacle with and without side points, rings, pulleys and a point in the world.
const char* const kTangle =
    R"(<mujoco><compiler angle="radian"/><worldbody><site name="w" pos="-.05 .02 .08"/>
  <site name="w2" pos=".02 .3 .1"/>
  <geom name="post" type="cylinder" size=".03 .1" pos=".02 .05 .03" euler=".3 .4 0" contype="0" conaffinity="0"/>
  <site name="post_side" pos=".02 .1 .03"/>
  <body name="a" pos="0 0 .05"><joint name="ja" axis="0 1 .2"/><joint name="sa" type="slide" axis="1 0 0"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" contype="0" conaffinity="0"/>
    <site name="a1" pos=".05 .03 .02"/><site name="a2" pos=".18 -.02 .03"/>
    <geom name="ball" type="sphere" size=".025" pos=".1 0 .01" contype="0" conaffinity="0"/>
    <geom name="drum" type="cylinder" size=".02 .1" pos=".2 0 0" euler="1.4 .2 0" contype="0" conaffinity="0"/>
    <site name="drum_side" pos=".2 .01 .06"/><site name="in_drum" pos=".2 .001 .003"/>
    <body name="b" pos=".2 0 0"><joint name="jb" axis="0 1 0"/><joint name="kb" axis="0 .3 1"/>
      <geom type="capsule" fromto="0 0 0 .15 0 0" size=".01" contype="0" conaffinity="0"/>
      <site name="b1" pos=".06 .01 .04"/><site name="b2" pos=".14 0 -.02"/>
      <geom name="bead" type="sphere" size=".02" pos=".15 0 0" contype="0" conaffinity="0"/>
      <body name="c" pos=".15 0 0"><joint name="jc" axis="1 1 0"/>
        <geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" contype="0" conaffinity="0"/>
        <site name="c1" pos=".08 .02 .03"/><site name="bead_side" pos="0 .05 0"/></body></body></body>
  <body name="d" pos="0 .3 .05"><joint name="jd" axis="1 0 .1"/>
    <geom type="capsule" fromto="0 0 0 0 0 .2" size=".01" contype="0" conaffinity="0"/><site name="d1" pos=".03 0 .15"/>
  </body></worldbody>
  <tendon><spatial name="points" stiffness="1"><site site="w"/><site site="a1"/><site site="b1"/><site site="c1"/></spatial>
  <spatial name="post" stiffness="1"><site site="w"/><geom geom="post"/><site site="a2"/></spatial>
  <spatial name="post_aside" stiffness="1"><site site="w"/><geom geom="post" sidesite="post_side"/><site site="b1"/></spatial>
  <spatial name="ball" stiffness="1"><site site="w"/><geom geom="ball"/><site site="b2"/></spatial>
  <spatial name="drum" stiffness="1"><site site="a1"/><geom geom="drum" sidesite="drum_side"/><site site="b1"/>
    <geom geom="bead"/><site site="c1"/></spatial>
  <spatial name="pulley" stiffness="1"><site site="w"/><site site="a2"/><pulley divisor="2"/><site site="b1"/>
    <geom geom="ball"/><site site="d1"/><pulley divisor="3"/><site site="c1"/><site site="w2"/></spatial>
  <spatial name="bead_aside" stiffness="1"><site site="b1"/><geom geom="bead" sidesite="bead_side"/><site site="c1"/></spatial>
  <spatial name="ring" stiffness="1"><site site="a1"/><geom geom="drum" sidesite="in_drum"/><site site="b2"/></spatial>
  </tendon></mujoco>)";

TEST(ImportTendons, PathsAreMujocosAtAnyPose) {
  const ImportedScene loaded = MustLoad(kTangle);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);  // a tendon ties the two trees together
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  ASSERT_EQ(m.paths().size(), 8u);
  Peer peer(kTangle);
  mjData& d = *peer.d;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const int n = m.num_coordinates();
  VectorX q(n);
  std::vector<int> touched(8, 0), free(8, 0);
  for (int pose = 0; pose < 300; ++pose) {
    for (const auto& joint : m.joints()) {
      const bool slides = joint.kind == JointKind::kSlide;
      q(joint.offset) = (slides ? 0.05 : 1.4) * uniform(random);
      d.qpos[peer.Dof(joint.name)] = q(joint.offset);  // one coordinate a joint
    }
    mj_forward(peer.m.get(), &d);
    Kinematics k(m);
    ComputeKinematics(m, q, k);
    for (std::size_t p = 0; p < m.paths().size(); ++p) {
      const std::string& name = m.paths()[p].name;
      SCOPED_TRACE(name + ", pose " + std::to_string(pose));
      const int t = mj_name2id(peer.m.get(), mjOBJ_TENDON, name.c_str());
      bool wraps = false;
      for (int w = d.ten_wrapadr[t]; w < d.ten_wrapadr[t] + d.ten_wrapnum[t]; ++w)
        wraps = wraps || d.wrap_obj[w] >= 0;
      ++(wraps ? touched : free)[p];
      // Of a ring MuJoCo seeks the point of touch to 1e-6 rad; the length is stationary in it, its arms are
      // not.
      const bool ring = name == "ring";
      EXPECT_NEAR(k.paths[p].length, d.ten_length[t], ring ? 1e-11 : 1e-14);
      VectorX arms = VectorX::Zero(n), theirs = arms;
      for (const auto& [i, arm] : k.paths[p].arms) arms(i) += arm;
      for (const auto& joint : m.joints())
        for (int a = peer.m->ten_J_rowadr[t]; a < peer.m->ten_J_rowadr[t] + peer.m->ten_J_rownnz[t]; ++a)
          if (peer.m->ten_J_colind[a] == peer.Dof(joint.name)) theirs(joint.offset) = d.ten_J[a];
      EXPECT_LT((arms - theirs).norm(), ring ? 1e-5 : 1e-13);
      // By differences of our own length: a path that changes its way within the difference is left out.
      constexpr double kStep = 1e-6;
      for (const int i : m.paths()[p].coordinates) {
        double ends[2];
        for (const int side : {0, 1}) {
          Kinematics moved(m);
          ComputeKinematics(m, q + (side ? kStep : -kStep) * VectorX::Unit(n, i), moved);
          ends[side] = moved.paths[p].length;
        }
        const double curved = std::abs(ends[0] + ends[1] - 2 * k.paths[p].length);
        if (curved < 1e-9) {
          EXPECT_NEAR(arms(i), (ends[1] - ends[0]) / (2 * kStep), 2e-9);  // rounding over the step
        }
      }
    }
  }
  for (std::size_t p = 1; p < 8; ++p) {
    if (m.paths()[p].name != "pulley") {  // whose obstacle stands aside
      EXPECT_GT(touched[p], 10) << m.paths()[p].name;
    }
    EXPECT_GT(free[p], 10) << m.paths()[p].name;
  }
}

// A tendon through the still world on to another tree ties the two together, wherever it begins.
TEST(ImportTendons, ATendonFromTheWorldOverTwoTreesTiesThem) {
  const std::string text = R"(<mujoco><worldbody><site name="w"/>
    <body name="a" pos="1 0 0"><joint name="ja" axis="0 1 0"/><geom size=".1"/><site name="sa" pos="0 0 .1"/></body>
    <body name="b" pos="2 0 0"><joint name="jb" axis="0 1 0"/><geom size=".1"/><site name="sb" pos="0 0 .1"/></body>
    </worldbody><tendon><spatial name="t" stiffness="9"><site site="w"/><site site="sa"/><site site="sb"/></spatial>
    </tendon></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  ASSERT_EQ(loaded.scene.mechanisms.size(), 1u);
  EXPECT_EQ(MustBuild(loaded.scene.mechanisms[0]).paths()[0].coordinates, (std::vector<int>{0, 1}));
}

// Springs and dampers with more than one coefficient. MuJoCo's forces at some poses: `qfrc_passive` of 4.0.1.
TEST(ImportTendons, HigherTermsOfSpringsAndDampers) {
  const std::string text = R"(<mujoco><worldbody><site name="w"/>
    <body name="a" pos="1 0 0"><joint name="ja" axis="0 1 0" stiffness="3 0.5" damping=".1 0 .02"/>
      <geom size=".1"/><site name="sa" pos="0 0 .1"/></body></worldbody>
    <tendon><spatial name="t" stiffness="9 2" damping=".2"><site site="w"/><site site="sa"/></spatial></tendon></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  using Higher = std::array<double, 2>;
  ASSERT_EQ(m.springs().size(), 2u);
  EXPECT_EQ(m.stiffness()(0), 0);
  EXPECT_EQ(m.damping()(0), 0.1);
  EXPECT_EQ(m.springs()[0].stiffness, 3);
  EXPECT_EQ(m.springs()[0].higher_stiffness, (Higher{0.5, 0}));
  EXPECT_EQ(m.springs()[0].higher_damping, (Higher{0, 0.02}));
  EXPECT_EQ(m.springs()[1].stiffness, 9);
  EXPECT_EQ(m.springs()[1].higher_stiffness, (Higher{2, 0}));

  const Mechanism hinge = MustBuild(MustLoad(R"(<mujoco><worldbody><body><joint name="j" axis="0 1 0"
    stiffness="3 5 7" damping="2 4 6"/><geom size=".1"/></body></worldbody></mujoco>)")
                                        .scene.mechanisms[0]);
  for (const auto& [q, force] : {std::pair(0.1, -0.357), {-0.1, 0.257}, {0.5, -3.625}}) {
    Kinematics k(hinge);
    const VectorX at = VectorX::Constant(1, q);
    ComputeKinematics(hinge, at, k);
    VectorX tau;
    SpringForce(hinge, k, at, tau);
    EXPECT_NEAR(tau(0), force, 1e-14) << q;
  }
  const Mechanism::Spring& s = hinge.springs()[0];
  for (const auto& [rate, force] : {std::pair(0.1, -0.246), {-0.1, 0.246}, {0.5, -2.75}})
    EXPECT_NEAR(-rate * (hinge.damping()(0) + s.DampingAt(rate)), force, 1e-14) << rate;
}

TEST(ImportTendons, HigherTermsOfABallAreListed) {
  const ImportedScene loaded =
      MustLoad(R"(<mujoco><worldbody><body><joint name="ball" type="ball" stiffness="3 5"/>
    <geom size=".1"/></body></worldbody></mujoco>)");
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped,
                      "higher terms of the spring or damper of joint 'ball'"));
}

// A tendon within a robot that floats does not depend on where the robot is.
TEST(ImportTendons, TendonWithinAFloatingRobot_DependsOnItsJointsAlone) {
  const std::string text = R"(<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint/>
    <geom size=".1"/><site name="s" pos=".1 0 .05"/><body name="leg" pos=".1 0 0"><joint name="hip" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site name="t" pos=".2 0 .02"/></body></body></worldbody>
    <tendon><spatial name="within" stiffness="50"><site site="s"/><site site="t"/></spatial></tendon></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  EXPECT_EQ(loaded.scene.mechanisms[0].base, BaseKind::kFloating);
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  ASSERT_EQ(m.springs().size(), 1u);
  EXPECT_EQ(m.springs()[0].name, "within");
  EXPECT_EQ(m.paths()[0].coordinates, std::vector<int>{0});
}

// A floating robot on a leash, a free body behind it, and one that an actuator pushes.
const char* const kTethered = R"(<mujoco><compiler angle="radian"/><worldbody><site name="w" pos=".1 0 2"/>
    <body name="base" pos="0 0 1" euler=".3 .2 .5"><joint name="float" type="free" damping=".3"/>
      <geom size=".1"/><site name="s" pos=".1 0 .05"/>
      <body name="leg" pos=".1 0 0"><joint name="hip" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site name="t" pos=".2 0 .02"/></body></body>
    <body name="load" pos="1 0 1" euler="1 0 .2"><freejoint name="trails"/><geom size=".05 .1 .2" type="box"/>
      <site name="eye" pos="0 .1 .2" euler=".2 .1 .7"/></body>
    <body name="drone" pos="0 3 0" euler="0 .4 0"><freejoint name="flies"/><geom size=".1 .1 .02" type="box"/>
      <site name="rotor" pos=".1 .1 0" euler=".1 .2 .3"/></body></worldbody>
  <tendon><spatial name="leash" stiffness="50" springlength="0 .5" damping="2"><site site="w"/><site site="t"/></spatial>
    <spatial name="tow" stiffness="30" damping="1"><site site="s"/><site site="eye"/></spatial></tendon>
  <actuator><motor name="thrust" site="rotor" gear="0 .2 1 0 .3 -.02"/>
    <motor name="reel" tendon="tow" gear="2"/>
    <motor name="jets" joint="flies" gear="1 -2 .5 .3 -.2 .7"/>
    <velocity name="brake" joint="trails" gear=".4 0 1 .3 .5 -.2" kv=".6"/>
    <motor name="outside" jointinparent="float" gear=".2 .4 -1 2 .3 -.5"/>
    <velocity name="slow" jointinparent="flies" gear="0 0 0 .7 .4 -.3" kv=".2"/></actuator></mujoco>)";

// Coordinates and rates of a built mechanism at MuJoCo's state, by the keyframe that holds it.
TEST(ImportTendons, TendonsAndActuatorsOnFreeJoints_ForcesAndPosesAreThoseOfMujoco) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int trial = 0; trial < 20; ++trial) {
    Peer peer(kTethered);
    mjData& d = *peer.d;
    const auto numbers = [](const mjtNum* values, mjtSize count) {
      std::string text;
      for (mjtSize i = 0; i < count; ++i) text += fmt::format(" {:.17g}", values[i]);
      return text;
    };
    for (int i = 0; i < peer.m->nq; ++i) d.qpos[i] += 0.8 * uniform(random);
    mj_normalizeQuat(peer.m.get(), d.qpos);
    for (int i = 0; i < peer.m->nv; ++i) d.qvel[i] = uniform(random);
    for (int i = 0; i < peer.m->nu; ++i) d.ctrl[i] = uniform(random);
    mj_forward(peer.m.get(), &d);
    std::string text = kTethered;
    text.insert(text.rfind("</mujoco>"), "<keyframe><key qpos=\"" + numbers(d.qpos, peer.m->nq) +
                                             "\" qvel=\"" + numbers(d.qvel, peer.m->nv) + "\"/></keyframe>");
    const ImportedScene loaded = MustLoad(text);
    EXPECT_TRUE(loaded.scene.free_bodies.empty());
    ASSERT_EQ(loaded.scene.mechanisms.size(), 2u);  // the tow ties two trees together
    EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "actuator"));
    for (std::size_t i = 0; i < 2; ++i) {
      const Mechanism m = MustBuild(loaded.scene.mechanisms[i]);
      EXPECT_EQ(m.base(), BaseKind::kFixed);
      const KeyframeDef::MechanismState& state = loaded.scene.keyframes[0].mechanisms[i];
      Kinematics k(m);
      ComputeKinematics(m, state.q, k);
      for (int b = 1; b < m.num_bodies(); ++b) {
        const Mechanism::Body& body = m.body(BodyIndex(b));
        SCOPED_TRACE(body.name);
        EXPECT_LT(PoseDifference(k.X_RB[static_cast<std::size_t>(b)], peer.Pose(body.name)), 1e-14);
      }
      // Work of forces in the motion at hand: free of the coordinates in which it is written.
      double ours = 0, theirs = 0;
      VectorX rates = state.q_dot;  // of rotations the angular velocity, on which dampers and motors act
      for (const Mechanism::Rotation& rotation : m.rotations()) {
        const Vector3 omega = AngularVelocityMap(m, k, rotation) * rates(rotation.coordinates);
        rates(rotation.coordinates) = omega;
      }
      const auto rate_of = [&](const Mechanism::Length& length) {
        double rate = 0;
        const VectorX& motion = length.path < 0 ? rates : state.q_dot;
        ForEachArm(length, k.paths, [&](int j, double a) { rate += a * motion(j); });
        return rate;
      };
      for (const Mechanism::Spring& spring : m.springs()) {
        const double rate = rate_of(spring.length);
        ours += rate * (spring.Force(LengthOf(m, spring.length, k, state.q)) - spring.damping * rate);
      }
      for (const Mechanism::Control& control : m.controls()) {
        const int a = mj_name2id(peer.m.get(), mjOBJ_ACTUATOR, control.name.c_str());
        ours += rate_of(control.length) * control.gain * d.ctrl[a];
      }
      ours -= rates.dot(m.damping().cwiseProduct(rates));
      for (int dof = 0; dof < peer.m->nv; ++dof)
        if (loaded.scene.mechanisms[i].FindBody(peer.BodyOf(dof)).valid())
          theirs += d.qvel[dof] * (d.qfrc_passive[dof] + d.qfrc_actuator[dof]);
      EXPECT_NEAR(ours, theirs, 1e-12 * (1 + std::abs(theirs)));
      EXPECT_NE(theirs, 0);
    }
  }
}

TEST(ImportTendons, PdOnAFreeJoint_HoldsItsPosition) {
  ImportOptions options;
  options.joint_pd["trails.position"] = {70, 3};
  const ImportedScene loaded = MustLoad(kTethered, options);
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  double held = 0;
  for (const Mechanism::Joint& joint : m.joints()) {
    const double stiffness = m.stiffness().segment(joint.offset, joint.size).sum();
    EXPECT_EQ(stiffness, joint.name == "trails.position" ? 210 : 0) << joint.name;
    held += stiffness;
  }
  EXPECT_EQ(held, 210);
  const auto written = ModelAsMjcf(WriteFile("tethered.xml", kTethered), options, ".", "");
  ASSERT_FALSE(written);
  EXPECT_CONTAINS(written.error().Text(), "free joint 'trails'");
}

TEST(ImportTendons, GravityCompensationIsMujocos) {
  const std::string text = R"(<mujoco><worldbody><body name="a" gravcomp="1"><joint name="ja" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .3 0 .1" size=".02"/><body name="b" pos=".3 0 .1" gravcomp=".4">
    <joint name="jb" axis="1 1 0"/><geom type="capsule" fromto="0 0 0 .2 .1 0" size=".02"/></body></body>
    </worldbody></mujoco>)";
  const ImportedScene loaded = MustLoad(text);
  const Mechanism m = MustBuild(loaded.scene.mechanisms[0]);
  Peer peer(text);
  const VectorX q = (VectorX(2) << 0.4, -0.7).finished();
  peer.d->qpos[0] = q(0);
  peer.d->qpos[1] = q(1);
  mj_forward(peer.m.get(), peer.d.get());
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  Matrix6X F = Matrix6X::Zero(6, m.num_bodies());
  AddGravityWrenches(m, kinematics, Vector3(0, 0, -9.81), F);
  VectorX tau = VectorX::Zero(2);
  AccumulateGeneralizedForce(m, kinematics.S, F, tau);
  for (int i = 0; i < 2; ++i) {
    const double theirs = peer.d->qfrc_gravcomp[i] - peer.d->qfrc_bias[i];
    EXPECT_NEAR(tau(i), theirs, 1e-12 * std::abs(peer.d->qfrc_bias[0]));  // rounding of sums of this size
  }
  EXPECT_GT(std::abs(tau(1)), 0.01);
}

// What MuJoCo's actuators give together with ours, where some are at their bounds.
TEST(ImportForces, BoundsAreMujocos) {
  const std::string text = R"(<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body>
    <body name="b" pos="0 1 0"><joint name="k" axis="0 1 0" actuatorfrcrange="-.3 .5"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body></worldbody>
    <actuator><position name="p" joint="j" kp="5" kv=".3" gear="2" forcerange="-1 2"/>
    <motor name="m" joint="k" gear="1.5"/><position name="s" joint="k" kp="3"/></actuator></mujoco>)";
  ImportOptions options;
  const ImportedScene loaded = MustLoad(text, options);
  Peer peer(text);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int bound = 0;
  for (int trial = 0; trial < 20; ++trial) {
    for (int i = 0; i < 2; ++i) {
      peer.d->qpos[i] = uniform(random);
      peer.d->qvel[i] = uniform(random);
    }
    for (int i = 0; i < 3; ++i) peer.d->ctrl[i] = uniform(random);
    mj_forward(peer.m.get(), peer.d.get());
    ASSERT_EQ(loaded.scene.mechanisms.size(), 2u);
    for (const MechanismDef& def : loaded.scene.mechanisms) {
      const Mechanism m = MustBuild(def);
      const int dof = peer.Dof(m.joints()[0].name);
      const double q = peer.d->qpos[dof], v = peer.d->qvel[dof];
      ASSERT_EQ(m.force_limits().size(), 1u);
      const Mechanism::ForceLimit& limit = m.force_limits()[0];
      double f = 0;
      for (const auto& [control, gain] : limit.inputs) {
        const std::string& name = m.controls()[static_cast<std::size_t>(control)].name;
        f += gain * peer.d->ctrl[mj_name2id(peer.m.get(), mjOBJ_ACTUATOR, name.c_str())];
      }
      const double arm = limit.length.terms[0].second;
      f += limit.stiffness * (limit.rest - arm * q) - limit.damping * arm * v;
      const double held = std::min(std::max(f, limit.lower), limit.upper);
      bound += held != f ? 1 : 0;
      EXPECT_NEAR(arm * held, peer.d->qfrc_actuator[dof], 1e-12);
    }
  }
  EXPECT_GT(bound, 5);
}

}  // namespace
}  // namespace fork1s::testing_importer
