// What a step of a mechanism reads and changes, as plain values.
#pragma once

#include <fork1s/mechanism/base_path.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <fork1s/stepping/applied_forces.hpp>
#include <fork1s/stepping/point_spring.hpp>
#include <limits>
#include <memory>
#include <vector>

namespace fork1s {

struct MechanismModel;  // insides of src/stepping

/// All that the next step of a mechanism depends on beside its definition and options: a copy that is put
/// back gives the same bits. Sizes: n joint coordinates, r reduced ones, m loop rows.
struct MechanismState {
  /// Of at_bound and of slack springs, within a step alone: a row of the contact solve, which finds what it
  /// gives.
  static constexpr signed char kInSolve = 2;

  std::shared_ptr<const ReducedModel> model;         // about the present reference
  std::shared_ptr<const MechanismModel> step_model;  // what steps make of it; null: Restore makes it again
  ReducedState reduced;
  VectorX expanded_at;  // r: z of the expansion that the next step begins with; empty: none
  VectorX mu;           // m: how far loops are closed along B at this pose, where the next correction starts

  VectorX controls;       // hold until changed
  VectorX controls_from;  // at the end of the last step, or where they start in a step within which they move
  bool controls_move = false;  // of the next step only
  VectorX activation;          // as controls, of those with dynamics, 0 of others; empty: none has
  RigidTransform driven_next;  // pose of a driven base at the end of the next step
  bool knows_driven_rate = false;
  Vector6 driven_rate =
      Vector6::Zero();  // its rate there, world axes, where that is known; of the next step only
  BaseHistory base_history;
  std::vector<AppliedForces> loads;  // per body, about its origin; of the next step only
  bool has_loads = false;
  PointSpring point_spring;  // holds until changed
  BodyIndex point_spring_body;
  std::vector<signed char> at_bound;  // per force limit: 1 at the upper, -1 at the lower, 0 between; kInSolve

  double missing_time = 0;  // s, for how long loads have had no column (FindMissingLoad)
  double reference_age = std::numeric_limits<double>::infinity();  // s, since a step last moved the reference

  // Predicts the velocity of the first stage: of the last step of two stages, zero where that is not known.
  // (v₂ - v₁)/((1 - γ) h) of the two stages; where the base floats, of the centre of mass in place of the
  // base's origin, world axes, beside what weight and forces from outside give it.
  VectorX acceleration;  // num_velocities
};

bool HasDynamics(const MechanismState& state, Eigen::Index control);
/// What the force of a control is proportional to: its activation, or its input where it has no dynamics.
double ActivationOf(const MechanismState& state, Eigen::Index control);
/// Of all controls.
VectorX ActivationsOf(const MechanismState& state);

}  // namespace fork1s
