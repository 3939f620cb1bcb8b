// What a step of a mechanism reads and changes, as plain values.
#pragma once

#include <fork1s/dynamics/applied_forces.hpp>
#include <fork1s/dynamics/point_spring.hpp>
#include <fork1s/mechanism/base_path.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <memory>
#include <vector>

namespace fork1s {

/// What a step of second order knows of the step before, for the rule of two steps (docs/method.md, section
/// 5). Sizes as of MechanismState; of k rigid parts.
struct MechanismPast {
  double h = 0;                        // s, of that step; 0: nothing is known, and the rule begins anew
  bool anew = false;                   // whether that step itself knew nothing of the past
  VectorX z_moved;                     // r: how far it went
  VectorX nu;                          // n: joint velocities at its start
  Matrix3X c_dot_W;                    // 3 x k: velocities of centres at its start, world axes
  Matrix3X omega;                      // 3 x k: turns at its start, in the parts' own axes
  Matrix3 R_WR = Matrix3::Identity();  // of a floating base at its start
  Vector3 center_W = Vector3::Zero();  // centre of mass of a floating mechanism at its start
  Vector6 V_R = Vector6::Zero();       // twist of a driven base at its end
};

/// How the interior's own displacement goes on (docs/method.md, section 5); of n joint coordinates.
struct InteriorState {
  VectorX offset;    // n: leftover of the last refresh, fading; empty: not known yet
  VectorX last_way;  // n: of the last step
  double share = 1;  // of a step of Newton that it took last
};

/// All that the next step of a mechanism depends on beside its definition and options: a copy that is put
/// back gives the same bits. Sizes: n joint coordinates, r reduced ones, m loop rows.
struct MechanismState {
  /// Of at_bound, and within a step alone: a row of the contact solve, which finds what it gives.
  static constexpr signed char kInSolve = 2;

  std::shared_ptr<const ReducedModel> model;  // about the present reference
  ReducedState reduced;
  VectorX mu;  // m: how far loops are closed along B at this pose, where the next correction starts

  VectorX controls;            // hold until changed
  VectorX controls_from;  // at the end of the last step, or where they start in a step within which they move
  bool controls_move = false;  // of the next step only
  RigidTransform driven_next;  // pose of a driven base at the end of the next step
  bool knows_driven_rate = false;
  Vector6 driven_rate = Vector6::Zero();  // its rate there, world axes, where that is known; of the next step only
  BaseHistory base_history;               // of steps of two stages
  std::vector<AppliedForces> loads;       // per body, about its origin; of the next step only
  bool has_loads = false;
  PointSpring point_spring;  // holds until changed
  BodyIndex point_spring_body;
  std::vector<signed char> at_bound;  // per force limit: 1 at the upper, -1 at the lower, 0 between; kInSolve

  InteriorState interior;

  MechanismPast past;  // of the step of second order alone

  // Predicts the velocity of the first stage of a two-stage step: of its last one, zero where that is not
  // known.
  // (v₂ - v₁)/((1 - γ) h) of the two stages; where the base floats, of the centre of mass in place of the
  // base's origin, world axes, beside what weight and forces from outside give it.
  VectorX acceleration;  // num_velocities
};

}  // namespace fork1s
