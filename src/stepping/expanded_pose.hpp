// A mechanism between two expansions: what a step asks of it, in reduced coordinates alone
// (reduction/expansion.hpp).
//
// Momenta of a pose z' are w' and G(δ') w', of which sums are flat as those of parts are; the pose z feels
// them as M w' + G(δ)ᵀ w' + G(δ') w'.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "reduction/expansion.hpp"
#include "stepping/step_context.hpp"

namespace fork1s {

struct StageBase;

/// Why a mechanism is never stepped by expansions; empty where it may be.
std::string WhatForbidsExpansion(const Mechanism& mechanism);

/// Const from one expansion to the next.
struct ExpandedMechanism {
  std::shared_ptr<const ReducedModel> of;
  Expansion expansion;
  MatrixX M_inverse;                  // r x r
  std::vector<BodyExpansion> groups;  // as MechanismModel::groups
  std::vector<int> coordinates;       // those that controls, stops and dry frictions act on
  std::vector<MatrixX> curvatures;    // r x r each: ∂²q/∂z² of those
};

/// At the pose at hand.
struct ExpandedPose {
  VectorX delta;                     // r: z - z*
  MatrixX G, D, scratch;             // r x r: G(δ), D'(δ)
  std::vector<RigidTransform> X_RG;  // of groups
  std::vector<Matrix6X> J;           // 6 x r: twist of groups in R about R's origin per rate of z
  VectorX q;                         // n, those of `coordinates`; others stay as they are at z*
  RowMatrixX Q;                      // n x r, likewise
  MatrixX servo_rows;                // r x forces with bounds: rate of the length of each per rate of z
  VectorX rates, loop_rates;         // r, m: scratch
};

/// Expands about the present z, which need not be the pose at hand. Allocates.
void Expand(const StepContext& ctx);
/// About the pose of `at`, which closes the loops at the z that the state is expanded at.
void ExpandAt(const StepContext& ctx, const Configuration& at);
/// The pose at hand <- that of the present z.
void MoveExpanded(const StepContext& ctx);
/// q_dot [n] <- rates of joints at rates w, to first order in δ.
void ComputeExpandedJointRates(const StepContext& ctx, const VectorX& w, VectorX& q_dot);
void ComputeExpandedMass(const StepContext& ctx);
/// Momenta at the velocity x of the workspace and the pose at hand.
void ComputeExpandedMomenta(const StepContext& ctx, StageBase& out);
/// momentum_change.all <- of `base` less those at velocity v, with what dampers give within b [s].
void ComputeExpandedMomentumChange(const StepContext& ctx, const StageBase& base, const VectorX& v, double b);
/// forces.f_z <- springs, weight and controls.
void LoadExpandedForces(const StepContext& ctx, const Vector3& gravity_R);
/// matrix.A += b D + b² K at the pose at hand.
void AddExpandedOperator(const StepContext& ctx, double b);

}  // namespace fork1s
