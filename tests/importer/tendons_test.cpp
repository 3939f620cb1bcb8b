// Tendons through space, gravity compensation: against closed forms and MuJoCo.
#include <fork1s/reduction/compliance.hpp>

#include "helpers.hpp"

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
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "path of tendon 'flexor'"));
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
      const double arm = limit.terms[0].second;
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
