// How much harder a grasp may press: told by `run`, and warned about when it is little.
#include <string>

#include <fmt/format.h>

#include "command.hpp"

namespace fork1s::test {
namespace {

// A ball between two tips that do not turn: ejected from k_t (R + r) = 300 N/m x 60 mm = 18 N on.
std::string Squeeze(double newtons) {
  constexpr double kNormal = 50;  // N/m
  std::string tips;
  for (const auto& [name, side] : {std::pair<const char*, int>{"left", 1}, {"right", -1}})
    tips += fmt::format(
        R"(<body name="{0}" pos="{1} 0 0">
          <joint name="{0}_x" type="slide" axis="1 0 0" stiffness="{2}" damping="1" springref="{3}"/>
          <joint name="{0}_y" type="slide" axis="0 1 0" stiffness="300" damping="6"/>
          <joint name="{0}_z" type="slide" axis="0 0 1" stiffness="300" damping="6"/>
          <geom type="sphere" size="0.015" mass="0.02" friction="2"/></body>)",
        name, -0.06 * side, kNormal, side * newtons / kNormal);
  return R"(<mujoco model="squeeze"><option gravity="0 0 0"/>
    <custom><text name="fork1s_interface" data="left right"/></custom><worldbody>)" +
         tips +
         R"(<body name="ball"><freejoint/><geom type="sphere" size="0.045" mass="0.1" friction="2"/></body>
    </worldbody></mujoco>)";
}

TEST(LoadFactor, IsWarnedAboutBelowOnePointThree) {
  for (const double share : {0.5, 0.9}) {
    const std::string model = Write(fmt::format("squeeze_{}.xml", share), Squeeze(18 * share));
    const Outcome o = Fork1s("run --json --time 1 " + model);
    ASSERT_EQ(o.code, 0) << o.err;
    const auto json = o.Json();
    // What penetration and the springs' shortening leave of the force: a few per cent.
    EXPECT_NEAR(json["load_factor_min"].get<double>(), 1 / share, 0.05 / share);
    const bool warned = json["warnings"].dump().find("'ball' is ejected") != std::string::npos;
    EXPECT_EQ(warned, share > 0.8) << json["warnings"].dump();
  }
  const std::string model = Write("squeeze.xml", Squeeze(17));
  EXPECT_TRUE(Fork1s("run --json --no-load-factor --time 1 " + model).Json()["load_factor_min"].is_null());
}

}  // namespace
}  // namespace fork1s::test
