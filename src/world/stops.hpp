// Stops of joints and tendons: what they did, and how what moves approaches them.
#pragma once

#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <vector>

namespace fork1s {

/// What stops and dry friction of a mechanism did and are to do, two of every length limit, lower and upper.
struct StopHistory {
  std::vector<double> impulses;           // N s, N m s, of the last stage; between steps of the step
  std::vector<double> friction_impulses;  // likewise, per dry friction
  std::vector<double> friction_held;      // N s, N m s: what dry friction bears where the stage starts
  std::vector<char> carried;              // carried load at the start of the step or in its first stage
  std::vector<char> is_fresh;             // of these, in the stage alone
  std::vector<char> is_row;
  std::vector<double> start_gap;  // m, rad: at the start of the step if it carried load there, else NaN

  void Resize(std::size_t limits, std::size_t frictions);
};

/// How a length approaches a stop; of what turns, in lengths of its mechanism.
struct StopApproach {
  bool bore = true;               // what follows is of no interest
  double gap = 0, speed = 0;      // m, m/s: to the stop; above 0 while it closes
  double base_gap = 0;            // m, at the base point of a stage
  double size = 0;                // m, of the mechanism
  double scale = 1;               // m a unit of the length: rad or m
  int mechanism = -1, stop = -1;  // of length_limits()
};
/// `at_stage_start`: by the velocity where the stage at hand starts.
StopApproach ApproachOf(const MechanismDynamics& m, const Mechanism::LengthLimit& stop, bool upper,
                        bool at_stage_start);
/// Whether a stop without a row is violated at the pose at hand.
bool PassesStop(const std::vector<MechanismDynamics>& mechanisms, const std::vector<StopHistory>& stops);
/// m a unit of a length; lengths that turn, in rad, count by the length of the mechanism.
double MetersPerUnit(const MechanismDynamics& m, const Mechanism::Length& length);

}  // namespace fork1s
