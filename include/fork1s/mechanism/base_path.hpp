// The path of a driven base within a step: poses and rates at both ends.
//
// Inputs give the pose at the end of a step. A base whose twist were that of the chord would change it at once between
// two steps, and the first of two implicit stages, 0.29 of a step long, would feel all of the change: 3.4 times the
// acceleration. So the rate is continuous from step to step. At the end of a step it is that of the path that the
// poses are samples of, where that is known; else it follows from the mean rates of the last three steps.
#pragma once

#include <fork1s/spatial/rigid_transform.hpp>
#include <optional>

namespace fork1s {

/// What the estimate of a rate knows of the last two steps, of lengths h and h_before [s]; 0: nothing is known.
struct BaseHistory {
  double h = 0, h_before = 0;
  Vector6 mean_rate = Vector6::Zero();  // [rotation; translation] in world axes, rad/s and m/s
  Vector6 mean_rate_before = Vector6::Zero();
};

/// θ(s) and p(s), s from 0 to 1: R(s) = exp(θ(s)) R_start, and p(s) from the start; both in world axes.
struct BasePath {
  RigidTransform X_start, X_end;
  double h = 0;                                                        // s
  Vector6 shift = Vector6::Zero();                                     // [θ(1); p(1)]
  Vector6 slope_start = Vector6::Zero(), slope_end = Vector6::Zero();  // d/dt [θ; p]
  /// The rate at the start is not the one that the base had: no smooth path leads to X_end.
  bool jumps = false;

  /// [angular velocity; velocity of the origin], world axes: the derivative of PoseAt. What sticks to the base moves by
  /// these rates alone, so their mean is that of the displacement.
  Vector6 RateAt(double share) const;
  /// The Hermite cubic.
  RigidTransform PoseAt(double share) const;
  Vector6 MeanRate() const { return shift / h; }
  /// What the next step knows of this one, which knew `before`.
  BaseHistory History(const BaseHistory& before) const { return {h, before.h, MeanRate(), before.mean_rate}; }
  /// [θ; p] of PoseAt.
  Vector6 DisplacementAt(double share) const;
};

/// The path from X_start, where the base has `rate_start` (world axes, velocity of the origin), to X_end. `rate_end` is
/// that of the path that X_end is a sample of; none: the slope at X_end of the cubic through the last four poses, of the
/// parabola through three where the path is not smooth.
/// Rotation and translation each are a straight line at constant rate where the distance is not what the two rates lead
/// to: a sudden stop would overshoot its last pose else, and a sudden start its speed.
BasePath ComputeBasePath(const RigidTransform& X_start, const Vector6& rate_start,
                         const RigidTransform& X_end, const std::optional<Vector6>& rate_end,
                         const BaseHistory& history, double h);

/// World rate of a base that is driven by coordinates [x y z, rotation vector] from the derivatives of these; NaN: not
/// known, and 0 where a coordinate stays as it is. None where one that changes, or all, are unknown.
std::optional<Vector6> BaseRateOf(const Vector6& coordinates, const Vector6& last_coordinates,
                                  const Vector6& derivatives);

}  // namespace fork1s
