// The cases of the table.
#pragma once

#include <functional>
#include <string>

#include "multibody.hpp"

namespace fork1s::lab {

struct Case {
  std::string name, parameter;
  System system;
  State start;
  double duration = 1;
  double lowest_energy = 0;  // potential energy at rest: swing energy is above it
  std::function<void(double time, System& system)> input;  // called at the start of each step
};

Case Bob(double stiffness, double amplitude);
Case Tray(double stiffness);
Case Pendulum(double amplitude);
Case DoublePendulum();
Case FourBar();
Case StandingLeg(double amplitude);
Case Overlap(double depth);
Case Oscillator(double frequency);
Case BouncingBall();
Case SlidingBall();
Case RollingBall();
Case Stack();
Case Grasp();
Case Tumbling();
Case Servo(double stiffness);
Case Landing(double stiffness);
Case RandomTree(unsigned seed, double stiffness_factor);

}  // namespace fork1s::lab
