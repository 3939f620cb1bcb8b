// Stops of joints that a loop drives through a dead centre.
#include <mjcf_text.hpp>

#include <array>

namespace fork1s {
namespace {

using testing::MustStart;

// A crank-rocker, turned in space, in the axes of the scene the crank turns about -y.
struct CrankRocker {
  double crank_x, crank_z;        // m: end of the crank, from its joint
  double rod_x, rod_z;            // m: end of the rod, from that of the crank
  double rocker_x, rocker_mass;   // m, kg
  double damping, stop, torque;   // N m s, rad: of the rocker, above; N m
  std::array<int, 3> directions;  // of the torque, half a second each

  std::string Text(const std::string& euler) const {
    const double end_x = crank_x + rod_x - rocker_x, end_z = crank_z + rod_z;
    const auto rod = [](double x, double z, double radius, double mass) {
      return fmt::format(
          "<geom type='capsule' fromto='0 0 0 {:.17g} 0 {:.17g}' size='{}' mass='{:.17g}' "
          "contype='0' conaffinity='0'/>",
          x, z, radius, mass);
    };
    return fmt::format(
        "<mujoco><option gravity='0 0 0'/><compiler angle='radian' autolimits='true'/><worldbody><body euler='{}'>"
        "<body name='crank'><joint name='c' axis='0 -1 0' damping='{:.17g}' armature='0.01'/>{}"
        "<body name='rod' pos='{:.17g} 0 {:.17g}'><joint axis='0 -1 0'/>{}</body></body>"
        "<body name='rocker' pos='{:.17g} 0 0'><joint axis='0 -1 0' range='-4 {:.17g}'/>{}</body></body></worldbody>"
        "<equality><connect body1='rod' body2='rocker' anchor='{:.17g} 0 {:.17g}'/></equality>"
        "<actuator><motor name='m' joint='c'/></actuator></mujoco>",
        euler, damping, rod(crank_x, crank_z, .005, .05), crank_x, crank_z, rod(rod_x, rod_z, .004, .05),
        rocker_x, stop, rod(end_x, end_z, .005, rocker_mass), rod_x, rod_z);
  }
};

CrankRocker First(std::array<int, 3> directions) {
  return {0.03082723487605406,  -0.021535360995476364,
          0.074163367168831,    0.12987676943981277,
          0.15489394021780745,  0.034278845749199996,
          0.004255449773296243, 0.3368758693529852,
          21.39723181,          directions};
}

// At hundreds of radians a second the rocker passes its stop and is beyond it at a dead centre, where the row of the
// stop vanishes.
TEST(DeadCentre, StopPassedThere_StepsGoOn) {
  for (const CrankRocker& crank : {First({-1, 1, -1}), First({-1, 1, 1}), First({-1, -1, 1})})
    for (const char* euler : {"0 0 0", "0.3 -1 2"}) {
      Simulation s = MustStart(crank.Text(euler), 1. / 60);
      int undone = 0;
      for (int i = 0; i < 90; ++i) {
        s.SetControl("m", crank.directions[static_cast<std::size_t>(i / 30)] * crank.torque);
        undone += s.Step(true).finite ? 0 : 1;
      }
      EXPECT_EQ(undone, 0) << euler;
      EXPECT_LT(s.JointGap(), 1e-6);
    }
}

}  // namespace
}  // namespace fork1s
