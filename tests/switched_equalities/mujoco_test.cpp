// The same file in MuJoCo at a small step, by its stiff springs in the place of what is hard here.
#include "support.hpp"

namespace fork1s::switched_equalities_test {
namespace {

// An arm of two hinges swings with a box by a weld or a connect of `where`, then throws it.
std::string Crane(const std::string& kind, const std::string& where, const std::string& options) {
  return fmt::format(
      R"(<mujoco><option {}/><worldbody><body name='upper'><joint name='shoulder' axis='0 1 0' damping='.2'/>
      <geom type='box' pos='.2 0 0' size='.2 .02 .02' mass='1' contype='0' conaffinity='0'/>
      <body name='hook' pos='.4 0 0'><joint name='elbow' axis='0 1 .2' damping='.1'/>
        <geom type='box' pos='.1 0 0' size='.1 .02 .02' mass='.5' contype='0' conaffinity='0'/>
        <site name='tip' pos='.2 0 0' euler='10 20 0'/></body></body>
      <body name='box' pos='.65 .03 -.1'><freejoint/><geom type='box' size='.04 .05 .03' mass='.5'/>
        <site name='eye' pos='-.05 -.03 .1' euler='10 20 0'/></body>
    </worldbody><actuator>
      <position joint='shoulder' kp='60' kv='6' ctrlrange='-3 3'/><position joint='elbow' kp='30' kv='2' ctrlrange='-3 3'/>
      </actuator><equality><{} name='grab' {} active='false' solref='.0004 1' solimp='.9999 .9999 .0001'/></equality></mujoco>)",
      options, kind, where);
}

struct Inputs {
  double shoulder, elbow, grab;
};
Inputs At(double t) { return {t < 0.3 ? -0.5 : 0.3, 0.4, t < 0.8 ? 1.0 : 0.0}; }

void ExpectAsInMujoco(const std::string& kind, const std::string& where) {
  SCOPED_TRACE(kind + " " + where);
  const MujocoModel model = LoadInMujoco(Crane(kind, where, "timestep='1e-4' integrator='implicitfast'"));
  ASSERT_NE(model, nullptr);
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  Simulation s = MustStart(Crane(kind, where, ""), 1. / 480);
  const int box = mj_name2id(model.get(), mjOBJ_BODY, "box");
  double farthest = 0;
  const Vector3 start = Place(s, "box");
  for (int k = 0; k < 480; ++k) {
    const Inputs u = At(s.time() + 1e-9);
    s.SetControl("actuator0", u.shoulder);
    s.SetControl("actuator1", u.elbow);
    s.SetControl("grab", u.grab);
    ASSERT_TRUE(s.Step().finite);
    data->ctrl[0] = u.shoulder;
    data->ctrl[1] = u.elbow;
    data->eq_active[0] = u.grab > 0.5;
    StepMujocoTo(s.time(), *model, *data);
    const Vector3 expected = Eigen::Map<const Vector3>(data->xpos + 3 * box);
    farthest = std::max(farthest, (Place(s, "box") - start).norm());
    // Its springs give way by some 1e-4 m under a load, and its step is of first order.
    ASSERT_LT((Place(s, "box") - expected).norm(), 1e-3) << s.time();
    const Quaternion turn(data->xquat[4 * box], data->xquat[4 * box + 1], data->xquat[4 * box + 2],
                          data->xquat[4 * box + 3]);
    ASSERT_LT(turn.angularDistance(s.Pose("box").quaternion()), 1e-2) << s.time();
  }
  EXPECT_GT(farthest, 0.1);
}

TEST(SwitchedEquality, ArmThatSwingsABoxAndThrowsIt_MovesAsInMujoco) {
  ExpectAsInMujoco("weld", "body1='hook' body2='box'");
  ExpectAsInMujoco("weld", "body1='box' body2='hook' anchor='.02 .03 .01'");
  ExpectAsInMujoco("connect", "body1='hook' body2='box' anchor='.2 0 0'");
  ExpectAsInMujoco("weld", "site1='tip' site2='eye'");
  ExpectAsInMujoco("connect", "site1='eye' site2='tip'");
}

// Tool that docks at a pose of the file, relpose, away from where it starts: it comes to rest where MuJoCo's does.
TEST(SwitchedEquality, ReferencePoseOfTheFile_IsWhereBothComeToRest) {
  const std::string text =
      "<mujoco><worldbody><body name='wrist' pos='0 0 1'><joint name='j' axis='0 0 1' stiffness='1e5' "
      "damping='1e3'/><geom size='.1' mass='5' contype='0' conaffinity='0'/></body><body name='tool' pos='.3 .1 .8' "
      "euler='0 0 40'><freejoint/><geom type='box' size='.05 .02 .1' mass='.2'/></body></worldbody><equality><weld "
      "name='dock' body1='wrist' body2='tool' relpose='.2 0 0 .9238795 0 .3826834 0' active='false' "
      "solref='.01 1' solimp='.9999 .9999 .0001'/></equality></mujoco>";
  const MujocoModel model = LoadInMujoco(text);
  ASSERT_NE(model, nullptr);
  model->opt.timestep = 1e-4;
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  data->eq_active[0] = 1;
  while (data->time < 1) mj_step(model.get(), data.get());
  Simulation s = MustStart(text, 1. / 240);
  s.SetControl("dock", 1);
  RunUntil(s, 1);
  const int tool = mj_name2id(model.get(), mjOBJ_BODY, "tool");
  const Vector3 expected = Eigen::Map<const Vector3>(data->xpos + 3 * tool);
  EXPECT_LT((Place(s, "tool") - expected).norm(), 1e-4);
  const Quaternion turn(data->xquat[4 * tool], data->xquat[4 * tool + 1], data->xquat[4 * tool + 2],
                        data->xquat[4 * tool + 3]);
  EXPECT_LT(turn.angularDistance(s.Pose("tool").quaternion()), 1e-3);
}

}  // namespace
}  // namespace fork1s::switched_equalities_test
