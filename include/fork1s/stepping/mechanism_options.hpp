// What a mechanism in motion is made with, and which of its bodies may touch something.
#pragma once

#include <fork1s/recovery/recovery.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

struct MechanismOptions {
  ReductionOptions reduction;
  Recovery recovery = Recovery::kExact;
  double refresh_angle = 0.2617993877991494;  // rad (15 degrees); slides: this share of the length scale
  double refresh_gap = 2e-4;                  // m: of loops, by curved recovery
  Vector3 gravity_W = Vector3::Zero();        // m/s², of load columns
};

/// A rigid group of bodies that may touch something: an interface body with all that is welded to it, or the
/// base.
struct ContactGroup {
  int last_joint = -1;            // the joint that carries the group; -1: the base
  BodyIndex body;                 // the body that names it
  std::vector<BodyIndex> bodies;  // all of the group
};

}  // namespace fork1s
