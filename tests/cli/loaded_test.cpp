// What reduce, statics and inspect say of mechanisms under load.
#include <numbers>

#include "command.hpp"

namespace fork1s::test {
namespace {

std::string Mast(double stiffness) {
  return Write(
      "mast.xml",
      "<mujoco><option gravity='0 0 -9.81'/><worldbody><body name='mast' pos='0 0 .5'>"
      "<joint name='foot' axis='0 1 0' stiffness='" +
          std::to_string(stiffness) +
          "'/>"
          "<inertial pos='0 0 .4' mass='1.5' diaginertia='.002 .002 .002'/>"
          "<geom type='capsule' fromto='0 0 0 0 0 .8' size='.01' mass='0'/></body></worldbody></mujoco>");
}

TEST(Loaded, ReduceHasStiffnessAndFrequenciesUnderWeight) {
  const std::string model = Mast(10);
  const auto json = Fork1s("reduce --json " + model).Json();
  const double k = 10 - 1.5 * 9.81 * 0.4, inertia = 0.002 + 1.5 * 0.16, turn = 2 * std::numbers::pi;
  EXPECT_NEAR(json["frequencies_hz"]["full"][0].get<double>(), std::sqrt(10 / inertia) / turn, 1e-9);
  EXPECT_NEAR(json["compliance_world"][1][1].get<double>(), 0.1, 1e-12);
  const auto& loaded = json["loaded"];
  EXPECT_NEAR(loaded["frequencies_hz"][0].get<double>(), std::sqrt(k / inertia) / turn, 1e-8);
  EXPECT_NEAR(loaded["compliance_world"][1][1].get<double>(), 1 / k, 1e-8);
  EXPECT_NEAR(loaded["lowest_stiffness_Nm"].get<double>(), k, 1e-7);
  EXPECT_TRUE(loaded["stable"].get<bool>());
  const std::string text = Fork1s("reduce " + model).out;
  for (const char* said : {"of the springs alone", "about the loaded equilibrium", "0.2431", "0.656213"})
    EXPECT_NE(text.find(said), std::string::npos) << text;
}

TEST(Loaded, ReduceSaysThatAnEquilibriumIsUnstable) {
  const auto json = Fork1s("reduce --json " + Mast(5)).Json();
  EXPECT_FALSE(json["loaded"]["stable"].get<bool>());
  EXPECT_TRUE(json["loaded"]["frequencies_hz"].empty());
  EXPECT_NE(json["warnings"].dump().find("unstable"), std::string::npos) << json["warnings"];
}

}  // namespace
}  // namespace fork1s::test
