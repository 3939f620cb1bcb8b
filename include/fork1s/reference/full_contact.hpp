// Options and report of the contact solve of FullSimulation.
#pragma once

namespace fork1s {

/// Spring and damper beneath each contact point (docs/method.md, section 6).
struct FullContactMaterial {
  double stiffness = 1e6;       // k [N/m]
  double depth = 1e-5;          // m: up to it the load is linear; deeper it grows with the eighth power
  double relaxation_steps = 4;  // τ/h: time constant of the damper in steps
  double max_push_speed = 0.1;  // m/s: largest speed at which an initial overlap is resolved
};

struct FullContactOptions {
  /// Largest accepted residual, see FullContactReport::residual.
  double tolerance = 1e-10;
  /// Newton iterations from one starting point. The first is the previous solution, the next ones are those
  /// after each set of Gauss-Seidel sweeps.
  int max_newton_iterations = 40;
  /// Sets of Gauss-Seidel sweeps, the first of 20 sweeps and each twice as long as the one before. The solve
  /// is reported as not converged after the last one.
  int max_sweep_sets = 9;
  /// Upper bound of R over the inverse mass at a point: an impact leaves at most this share of its speed.
  double max_relative_regularization = 1e-3;
};

struct FullContactReport {
  int newton_iterations = 0;  // factorizations of the Newton matrix
  int sweeps = 0;             // Gauss-Seidel sweeps; 0 where Newton's method alone converges
  /// |λ - Π(λ - ρ (w + R λ))| over |W^½ λ|, both in the kinetic-energy norm, beyond rounding.
  double residual = 0;
  int active = 0, sticking = 0, sliding = 0;  // contacts that carry force, and of these
  bool converged = true;                      // residual <= tolerance
};

}  // namespace fork1s
