// The spring of a servo of a file stores F²/(2k), whatever the unit of its input, its bias and where its length counts from.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>

#include <cmath>

namespace fork1s {
namespace {

struct ServoFile {
  const char* name;
  const char* joint;                     // attributes
  const char* rest;                      // what follows the bodies
  double gain, bias, stiffness, length;  // F = gain u + bias - stiffness L, L where it starts
  bool reaches = true;                   // the length at which F = 0
};

const ServoFile kServoFiles[] = {
    {"position", "ref='0.2'", "<actuator><position name='a' joint='j' kp='20' gear='3'/></actuator>", 20, 0,
     20, 0.6},
    {"gain is not stiffness", "",
     "<actuator><general name='a' joint='j' gainprm='0.1' biastype='affine' biasprm='0 -10 0'/></actuator>",
     0.1, 0, 10, 0},
    {"bias", "ref='-0.1'",
     "<actuator><general name='a' joint='j' gear='-2' gainprm='5' biastype='affine' biasprm='1.5 -4 0'/></actuator>",
     5, 1.5, 4, 0.2},
    {"fixed tendon", "ref='0.3'",
     "<tendon><fixed name='t'><joint joint='j' coef='2'/></fixed></tendon><actuator><general name='a' tendon='t' "
     "gainprm='3' biastype='affine' biasprm='0.4 -6 0'/></actuator>",
     3, 0.4, 6, 0.6},
    {"spatial tendon", "",
     "<tendon><spatial name='t'><site site='w'/><site site='b'/></spatial></tendon><actuator><general name='a' "
     "tendon='t' gainprm='3' biastype='affine' biasprm='0.4 -6 0'/></actuator>",
     3, 0.4, 6, 0.5, false},
};

TEST(ServoEnergy, OfAFile_IsItsForceSquaredOverTwiceItsStiffness) {
  for (const ServoFile& file : kServoFiles) {
    const std::string text =
        std::string(
            "<mujoco><compiler angle='radian'/><option gravity='0 0 0'/><worldbody><site name='w' pos='0.5 0 "
            "0.3'/><body><joint name='j' axis='0 1 0' damping='5' ") +
        file.joint + "/><geom size='0.1' mass='1'/><site name='b' pos='0 0 0.3'/></body></worldbody>" +
        file.rest + "</mujoco>";
    auto imported = LoadMechanismFromString(text, file.name);
    ASSERT_TRUE(imported) << imported.error().Text();
    auto simulation = Simulation::Create(imported->scene, {});
    ASSERT_TRUE(simulation) << simulation.error().Text();
    for (const double u : {0.0, 0.2, -0.15}) {
      SimulationOptions short_step;
      short_step.dt = 1e-9;  // moves by 1e-17
      auto start = Simulation::Create(imported->scene, short_step);
      start->SetControls(VectorX::Constant(1, u));
      start->Step();
      const double force = file.gain * u + file.bias - file.stiffness * file.length;
      EXPECT_NEAR(start->PotentialEnergy(), force * force / (2 * file.stiffness), 1e-7)
          << file.name << ", " << u;
      simulation->SetControls(VectorX::Constant(1, u));
      for (int i = 0; i < 1500; ++i) simulation->Step();
      if (file.reaches) {
        EXPECT_NEAR(simulation->PotentialEnergy(), 0, 1e-9) << file.name << ", " << u;
      }
    }
  }
}

}  // namespace
}  // namespace fork1s
