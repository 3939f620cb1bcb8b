// The machines of examples/legged.hpp in MuJoCo, from the same pose on the same ground with the same gains.
#pragma once

#include <legged.hpp>

struct MuJoCoStand {
  bool stood = false;  // finite, and in the end the trunk is upright to half a radian, at half its height
  int coordinates = 0;
  double step_us = 0, real_time_factor = 0;
  double foot_motion = 0;  // m, as StandMeasurement has it
};

/// Steps of `dt` [s] with MuJoCo's default integrator, Euler, or with `discrete`. Errors: kModel where MuJoCo
/// refuses the file.
fork1s::Expected<MuJoCoStand> StandInMuJoCo(const fork1s::examples::LeggedScene& legged,
                                            const std::string& model_file, bool discrete, double dt,
                                            double settling, double time);
