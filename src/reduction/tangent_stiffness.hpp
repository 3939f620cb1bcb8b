// Stiffness about a loaded equilibrium, and the compliance and frequencies that it makes.
#pragma once

#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/statics.hpp>
#include <vector>

#include "reduction/vibration_modes.hpp"

namespace fork1s {

/// At joint displacements q, an equilibrium under the loads (SolveStatics). Locked coordinates stay at rest.
TangentStiffness ComputeTangentStiffness(const Mechanism& mechanism, const VectorX& q,
                                         const std::vector<DeadLoad>& loads, const StaticsOptions& options);

/// Lowest `count` natural frequencies [Hz] of small vibrations about a stable equilibrium q, the base held,
/// motions of no stiffness left out; empty where it is unstable.
std::vector<double> TangentFrequencies(const Mechanism& mechanism, const VectorX& q,
                                       const TangentStiffness& tangent, int count = 8);

/// The same with their shapes.
VibrationModes ComputeTangentModes(const Mechanism& mechanism, const VectorX& q,
                                   const TangentStiffness& tangent, int count = 8);

/// A point of a body that loads act on.
struct BodyPoint {
  BodyIndex body;
  Vector3 p_B = Vector3::Zero();  // m, from the body's origin
};
/// Displacement [rotation; translation] of each point per load [moment; force] on each, world axes, about the
/// equilibrium q, the base held: C = J K_t⁻¹ Jᵀ, projected off the motions of no stiffness (InterfaceCompliance).
InterfaceCompliance TangentCompliance(const Mechanism& mechanism, const VectorX& q,
                                      const TangentStiffness& tangent, const std::vector<BodyPoint>& points);

}  // namespace fork1s
