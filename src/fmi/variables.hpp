// The variables of a functional mock-up unit (FMI): what a master sets and reads. Its description and its program list
// them by the same function, so that a value reference means the same in both.
#pragma once

#include <cstdint>
#include <fork1s/importer/file_state.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s::fmi {

enum class Causality { kIndependent, kConstant, kInput, kOutput };

struct Variable {
  std::string name;  // by the structured naming of FMI
  Causality causality = Causality::kOutput;
  std::string unit;  // a Unit::name; empty: none is known
  std::string description;
  double start = 0;                // of constants and inputs
  double lower = 0, upper = 0;     // of inputs, where lower < upper
  bool depends_on_inputs = false;  // of outputs: within the same instant
};

/// SI units by the exponents of their base units.
struct Unit {
  const char* name;
  int kg, m, s, rad;
};
inline constexpr Unit kUnits[] = {{"1", 0, 0, 0, 0},      {"s", 0, 0, 1, 0},       {"m", 0, 1, 0, 0},
                                  {"m/s", 0, 1, -1, 0},   {"m/s2", 0, 1, -2, 0},   {"rad", 0, 0, 0, 1},
                                  {"rad/s", 0, 0, -1, 1}, {"rad/s2", 0, 0, -2, 1}, {"N", 1, 1, -2, 0},
                                  {"N.m", 1, 2, -2, 0},   {"N.m.s", 1, 2, -1, 0},  {"J", 1, 2, -2, 0}};

/// Value references are indices of `all`. Numbers of a body stand one after the other from the place named.
struct VariableList {
  static constexpr int kTime = 0, kStep = 1;
  struct Body {
    int body = 0;      // of Simulation::bodies()
    Vector3 center_B;  // m: centre of mass, where the force acts
    int force = 0;     // input: 3 of force [N], 3 of torque [N·m], world axes
    int pose = 0;      // output: 3 of position [m], 4 of orientation (w x y z, w >= 0)
    int velocity = 0;  // output: 3 of angular velocity [rad/s], 3 of the origin's velocity [m/s]
  };

  std::vector<Variable> all;
  int first_control = 0;
  std::vector<Body> bodies;
  int first_position = 0, first_velocity = 0;  // of joints, as FileState
  int first_sensor = 0;                        // values as Sensors
  int first_report = 0;                        // kReport
  std::vector<std::string> notes;              // what has no variable, a sentence each
};

inline constexpr int kNumReportVariables = 6;

/// `joints`: those that move. `bodies`: places in Simulation::bodies().
VariableList ListVariables(const Simulation& simulation, const std::vector<FileJoint>& joints,
                           const std::vector<int>& bodies);

}  // namespace fork1s::fmi
