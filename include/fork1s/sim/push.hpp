// Forces and moments from outside over time: a shove in a table of controls, or on the command line.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <limits>
#include <string>
#include <vector>

namespace fork1s {

/// Over one step, at a point of a body that moves with it.
struct PushNow {
  int body = 0;                        // place in Simulation::bodies()
  Vector3 force_W = Vector3::Zero();   // N
  Vector3 moment_W = Vector3::Zero();  // N·m
  Vector3 point_B = Vector3::Zero();   // m, in the body's axes
  Vector3 point_W = Vector3::Zero();   // m, the same where the body of this simulation is at present
};

/// World axes, fixed in direction, at `point_B` of the body (its own axes; 0: its origin).
struct Push {
  std::string body;
  Vector3 point_B = Vector3::Zero();  // m
  // Constant from `from` to `to`.
  Vector3 force_W = Vector3::Zero(), moment_W = Vector3::Zero();
  double from = 0, to = std::numeric_limits<double>::infinity();  // s
  // Or of a table: what is linear between rows, and held before the first and after the last.
  std::vector<double> times;
  std::vector<Vector6> rows;  // [moment; force]
};

struct PushTrack {
  std::vector<Push> pushes;

  /// "BODY:FX,FY,FZ[,MX,MY,MZ][@PX,PY,PZ][:T0..T1]". Errors: kUsage with `option` as place.
  static Expected<Push> Parse(const std::string& text, const std::string& option);
  /// Takes the columns force:BODY[@PX,PY,PZ]:AXIS and torque:... out of a track of controls. Errors: kFormat
  /// with `where` as place.
  static Expected<PushTrack> ExtractFrom(ControlTrack& track, const std::string& where);

  /// Bodies that the simulation does not have.
  std::vector<std::string> FindMissing(const Simulation& simulation) const;
  /// What acts in the step of h [s] that ends at `end`, a window that covers part of it by its mean.
  std::vector<PushNow> Over(double end, double h, const Simulation& simulation) const;
};

}  // namespace fork1s
