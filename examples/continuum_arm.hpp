// A continuum arm as a chain of many hinges: one elastic rod, cut as finely as wanted.
#pragma once

#include <fork1s/mechanism/builder.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s::examples {

/// A rod of glass fibre along +x, clamped at its root at the origin, with discs on it as the tendon-driven
/// arms of laboratories have them. The hinges twist about x and bend about y and z in turn, each standing for
/// the elasticity of three neighbouring links, so that any number of them makes the same arm.
struct ContinuumArm {
  int joints = 90;
  double length = 0.9;  // m
  /// Bending and torsional stiffness of a rod 12 mm thick, E I and G J [N·m²], E = 38.6 GPa and G = 4.14 GPa:
  /// unidirectional glass fibre in epoxy (Scotchply 1002; Tsai and Hahn, Introduction to Composite Materials,
  /// 1980).
  double bending = 39.3;
  double twisting = 8.43;
  double mass = 0.5;            // kg, rod (0.18 kg), discs and sheath
  double radius = 0.02;         // m, of the discs and of the ball at the tip
  double damping_time = 0.005;  // s, damping over stiffness: 9 % of critical in the first mode
  double stiffness_scale = 1;   // as ScaleStiffness: damping goes with its root
  double table = -0.07;         // m, height of a table to press on
  double friction = 0.4;        // of tip, table and ball
  bool ball = true;             // a ball of 60 mm and 0.2 kg lies on the table, where the arm sweeps
};

/// The arm alone: body `base`, links `link0` to `linkN`, the last of which, the only interface, has a ball at
/// its end. Controls `curl` and `sway` are the curvatures [1/m] about y (down) and z that its tendons ask
/// for.
MechanismDef MakeContinuumArm(const ContinuumArm& arm);

/// The arm over its table, with gravity.
Scene ContinuumArmScene(const ContinuumArm& arm);

/// Set-points of 4 s: the arm curls down until its tip presses on the table with about 5 N (at its own
/// stiffness), sweeps 0.2 m aside, striking the ball on its way, and lifts again.
ControlTrack ContinuumArmMotion();

}  // namespace fork1s::examples
