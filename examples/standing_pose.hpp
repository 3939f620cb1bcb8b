// Finds the pose in which a machine stands on its feet, and the set-points that hold it there.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <string>
#include <vector>

namespace fork1s::examples {

/// A sole, a frame on a foot with x ahead and z up, and where it is to stand in the frame of the base.
struct Footing {
  std::string body;
  RigidTransform X_BS;
  RigidTransform X_RS;
  bool rolls = false;  // about its x, for legs without a joint for that
};

/// Joint displacements [n] at which the loops are closed and the soles stand where they are to, reached from
/// q0 by degrees. The definition's joints come in the order of BuildMechanism's result. Errors: kModel where
/// a sole does not get there; those of BuildMechanism.
Expected<VectorX> PlaceFeet(const MechanismDef& definition, const VectorX& q0,
                            const std::vector<Footing>& footings);

/// In R [m].
Vector3 CenterOfMass(const Mechanism& mechanism, const VectorX& q);

/// A pose and the controls that hold it under its weight.
struct StandingPose {
  VectorX q, controls;
};

/// Places the soles and moves them along x until their mean is below the centre of mass. Every sole then
/// bears an equal share of the weight at its origin, and the servos bear what follows; springs that no servo
/// reaches give way until they do. R is upright, `gravity` [m/s²] points down. Errors: those of PlaceFeet;
/// kNumerics where it does not settle.
Expected<StandingPose> FindStandingPose(const MechanismDef& definition, const VectorX& q0,
                                        std::vector<Footing> footings, double gravity = 9.81);

}  // namespace fork1s::examples
