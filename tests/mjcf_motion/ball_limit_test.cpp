// Ball joints that turn by a bounded angle.
#include <fork1s/sim/sensors.hpp>
#include <mjcf_text.hpp>

#include <cmath>

namespace fork1s {
namespace {

using testing::MustStart;

// A rod of 1 kg on a ball joint, turned in space; `degrees`: how far it may turn.
std::string LimitedPendulum(double degrees, const Vector3& gravity, const std::string& turn,
                            const std::string& more = "") {
  return fmt::format(
      "<mujoco><option gravity='{} {} {}'/><worldbody><body name='p' pos='0 0 1' euler='{}'>"
      "<joint name='b' type='ball' range='0 {}' damping='.2'/>"
      "<geom type='capsule' fromto='0 0 0 0 0 -.4' size='.02' mass='1'/></body></worldbody>{}</mujoco>",
      gravity.x(), gravity.y(), gravity.z(), turn, degrees, more);
}

double Turned(const Simulation& s, const Matrix3& from) {
  return LogRotation(from.transpose() * s.Pose("p").rotation()).norm();
}

// It comes to rest at the cone, whose moment holds its weight across.
TEST(BallLimit, PendulumUnderSidewaysGravity_RestsAtItsCone) {
  for (const double dt : {1. / 60, 1. / 240})
    for (const double degrees : {30.0, 75.0})
      for (const Vector3& g : {Vector3(9.81, 0, 0), Vector3(6, -7, 0)})
        for (const char* turn : {"0 0 0", "20 0 130"}) {
          SCOPED_TRACE(fmt::format("{} {} {}", dt, degrees, turn));
          Simulation s = MustStart(
              LimitedPendulum(degrees, g, turn,
                              "<sensor><jointlimitfrc joint='b'/><jointlimitpos joint='b'/></sensor>"),
              dt);
          const Matrix3 from = s.Pose("p").rotation();
          double most = 0;
          while (s.time() < 4) {
            ASSERT_TRUE(s.Step(true).IsSolved());
            most = std::max(most, Turned(s, from));
          }
          const double limit = degrees * M_PI / 180;
          // Stops are hard; what a step enters by is what the push-out of the last one leaves.
          EXPECT_LT(most, limit + 1e-3);
          EXPECT_NEAR(Turned(s, from), limit, 1e-5);
          // It rests where its weight has no moment along the cone: about the axis of the turn alone.
          const Vector3 down = s.Pose("p").rotation() * Vector3(0, 0, -0.2);
          const Vector3 moment = down.cross(Vector3(g)),
                        axis = LogRotation(s.Pose("p").rotation() * from.transpose()).normalized();
          EXPECT_NEAR(Sensors(s).values()[0], moment.norm(), 1e-2 * moment.norm());
          EXPECT_NEAR(moment.normalized().dot(axis), 1, 1e-3);
        }
}

// Spun within its cone by a moment, thrown against it: as in MuJoCo at a small step with a stiff limit.
TEST(BallLimit, MovesAsInMuJoCo) {
  const std::string text = LimitedPendulum(40, Vector3(4, 3, -9.81), "10 20 30");
  const testing::MujocoModel model = testing::LoadInMujoco(
      text.substr(0, 8) + "<default><joint solreflimit='.0005 4' solimplimit='.999 .999 .0001'/></default>" +
      text.substr(8));
  ASSERT_NE(model, nullptr);
  model->opt.timestep = 1e-4;
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  Simulation s = MustStart(text, 1. / 480);
  double most = 0;
  const Matrix3 from = s.Pose("p").rotation();
  while (s.time() < 1.5) {
    ASSERT_TRUE(s.Step(true).IsSolved());
    testing::StepMujocoTo(s.time(), *model, *data);
    const double* q = data->xquat + 4;
    const Matrix3 R = Quaternion(q[0], q[1], q[2], q[3]).toRotationMatrix();
    most = std::max(most, Turned(s, from));
    // MuJoCo's limit lets it in by the speed, up to 8 rad/s, times 0.5 ms; damped less it throws the rod back.
    ASSERT_LT(LogRotation(R.transpose() * s.Pose("p").rotation()).norm(), 1e-3) << s.time();
  }
  EXPECT_GT(most, 39.9 * M_PI / 180);
}

}  // namespace
}  // namespace fork1s
