// Adhesion: a force along the normals of the contacts of a body that pulls both sides together.
//
// The force F [N] of a stage is known before its contacts are solved: of an AdhesionDef by the control at the stage, an
// equal share F/n for each of the n points in reach; of shapes F at every point. It is an external force of the contact
// solve, so that the normal impulses bear the compression and friction has its bound by them.
#pragma once

#include <vector>

#include "bodies.hpp"
#include "contact_history.hpp"
#include "detection.hpp"
#include "rows.hpp"

namespace fork1s {

/// An AdhesionDef of a scene.
struct Adhesion {
  std::size_t mechanism = 0;  // of its control
  Eigen::Index control = 0;
  double gain = 0, lower = 0, upper = 0;  // N per unit of the control; N
  int collision_body = 0;
  std::vector<char> is_of_body;  // per shape of the collision body
};

/// Those of all mechanisms, once the collision bodies are known. Sets detection.shapes_adhere, and adhesion_reach to the
/// largest gap. Errors: kModel where nothing can touch the body of one.
Expected<std::vector<Adhesion>> FindAdhesions(const Bodies& bodies,
                                              const std::vector<ContactPairDef>& contact_pairs,
                                              Detection& detection);
/// rows.pulls of a stage of length h [s]. A point is in reach where its gap at the base point of the stage is at most
/// that of its shapes, or where it bore load before. `depth` [m]: of ContactMaterial.
void AssemblePulls(const std::vector<Adhesion>& adhesions, const Bodies& bodies, const Detection& detection,
                   const ContactHistory& history, double h, double depth, ConstraintRows& rows);
/// Adds to rows.velocities, the free ones, what rows.pulls change them by; after AssembleOperators.
void ApplyPulls(ConstraintRows& rows);

}  // namespace fork1s
