// The same file in MuJoCo at a small step.
#include "support.hpp"

namespace fork1s::adhesion_test {
namespace {

// A cup on a sprung arm of two hinges swings with a box, then lets it go. MuJoCo's contacts creep under a load across
// them, the less so the shorter the step and the larger `impratio`.
std::string Arm(const std::string& options) {
  return fmt::format(
      R"(<mujoco><option {}/><default><geom friction='.8' solref='.0004 1' solimp='.9999 .9999 .0001'/></default>
    <worldbody><body name='upper'><joint name='shoulder' axis='0 1 0' damping='.2'/>
      <geom type='box' pos='.2 0 0' size='.2 .02 .02' mass='1' contype='0' conaffinity='0'/>
      <body name='cup' pos='.4 0 0'><joint name='elbow' axis='0 1 0' damping='.1'/>
        <geom type='box' pos='.1 0 0' size='.1 .02 .02' mass='.5' contype='0' conaffinity='0'/>
        <geom type='box' pos='.15 0 -.03' size='.06 .06 .01' mass='.2' gap='.002'/></body></body>
      <body name='box' pos='.55 0 -.07'><freejoint/><geom type='box' size='.04 .04 .03' mass='.5'/></body>
    </worldbody><actuator>
      <position joint='shoulder' kp='60' kv='6' ctrlrange='-3 3'/><position joint='elbow' kp='30' kv='2' ctrlrange='-3 3'/>
      <adhesion name='suction' body='cup' ctrlrange='0 1' gain='40'/></actuator></mujoco>)",
      options);
}

struct Inputs {
  double shoulder, elbow, suction;
};
Inputs At(double t) { return {t < 0.3 ? -0.5 : 0.3, 0.4, t < 0.8 ? 1.0 : 0.0}; }

TEST(Adhesion, ArmThatSwingsABoxAndLetsGo_MovesAsInMuJoCo) {
  const MujocoModel model =
      LoadInMujoco(Arm("timestep='1e-4' impratio='100' cone='elliptic' integrator='implicitfast'"));
  ASSERT_NE(model, nullptr);
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  Simulation s = MustStart(Arm(""), 1. / 480);
  const int box = mj_name2id(model.get(), mjOBJ_BODY, "box");
  double farthest = 0;
  const Vector3 start = Place(s, "box");
  for (int k = 0; k < 480; ++k) {
    const Inputs u = At(s.time() + 1e-9);
    s.SetControl("actuator0", u.shoulder);
    s.SetControl("actuator1", u.elbow);
    s.SetControl("suction", u.suction);
    ASSERT_TRUE(s.Step().finite);
    data->ctrl[0] = u.shoulder;
    data->ctrl[1] = u.elbow;
    data->ctrl[2] = u.suction;
    StepMujocoTo(s.time(), *model, *data);
    const Vector3 expected = Eigen::Map<const Vector3>(data->xpos + 3 * box);
    farthest = std::max(farthest, (Place(s, "box") - start).norm());
    // MuJoCo's contacts give way: by `solref` .002 the boxes are 2 mm apart, by this one 0.3 mm.
    ASSERT_LT((Place(s, "box") - expected).norm(), 1e-3) << s.time();
  }
  EXPECT_GT(farthest, 0.1);
}

// What MuJoCo's contacts report bears the compression too.
TEST(Adhesion, ContactForceOfAHeldBox_IsThatOfMuJoCo) {
  Cup cup;
  cup.gain = 2.5 * cup.weight();
  cup.motors = fmt::format("<position name='servo' joint='slide' kp='{0}' kv='{1}'/>", 1e5, 2e3);
  const MujocoModel model = LoadInMujoco(cup.Text("timestep='1e-3'"));
  ASSERT_NE(model, nullptr);
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  data->ctrl[1] = 1;
  while (data->time < 1) mj_step(model.get(), data.get());
  mj_forward(model.get(), data.get());
  double sum = 0;
  for (int i = 0; i < data->ncon; ++i) {
    mjtNum force[6];
    mj_contactForce(model.get(), data.get(), i, force);
    sum += force[0];
  }
  Simulation s = MustStart(cup.Text(), 1. / 240);
  s.SetControl("suction", 1);
  RunUntil(s, 1);
  EXPECT_NEAR(sum, 1.5 * cup.weight(), 1e-3 * cup.weight());
  EXPECT_NEAR(NormalForces(s).contact, sum, 2e-3 * cup.weight());
}

}  // namespace
}  // namespace fork1s::adhesion_test
