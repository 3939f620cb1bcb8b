// Momenta of a mechanism in the flat space of a two-stage step: spatial momenta of its rigid parts about a
// point that moves evenly with the base, in the axes of the start of the step. `time` [s]: from the start of
// the step to the pose at hand.
#pragma once

#include "mechanism_detail.hpp"

namespace fork1s {

/// Momenta at the velocity x of the workspace and the pose at hand.
void ComputeFlatMomenta(const StepContext& ctx, double time, StageBase& out);
/// A wrench in R about R's origin [N m s; N s] as a change of momentum in that space.
Vector6 FlattenWrench(const StepContext& ctx, double time, const Vector6& wrench);
Vector6 Total(const StageBase& base);
/// ws.momentum_change.all <- J(x)ᵀ (p of `base` - p(v, x)) at the pose at hand, with the impulse that dampers
/// of joints and along lengths give within b [s].
void ComputeMomentumResidual(const StepContext& ctx, double time, const StageBase& base, const VectorX& v,
                             double b);
/// Of a floating mechanism, world axes [N s]; 0 for others.
Vector3 LinearMomentum(const StepContext& ctx, const StageBase& of);

}  // namespace fork1s
