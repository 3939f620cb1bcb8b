// What a FullSimulation holds.
#pragma once

#include <fork1s/reference/full_simulation.hpp>
#include <string>
#include <vector>

#include "contact_set.hpp"
#include "free_body.hpp"
#include "full_mechanism.hpp"

namespace fork1s {

struct FullSimulation::Detail {
  Scene scene;
  FullSimulationOptions options;
  double dt = 0;
  std::int64_t steps = 0;
  std::vector<internal::FullMechanism> mechanisms;
  std::vector<internal::FullFreeBody> free_bodies;
  internal::ContactSet contact_set;
  std::vector<FullContact> contacts;
  std::vector<FullBody> bodies;
  std::vector<std::string> control_names, warnings;
  VectorX controls, control_lower, control_upper;
  std::vector<RigidTransform> base_start;

  Expected<void> AddMechanisms(const KeyframeDef* key);
  Expected<void> AddFreeBodies(const KeyframeDef* key);
  Expected<std::vector<std::vector<int>>> Interfaces() const;
  void AddControls();
  void PassControls();
  FullStepReport Step();
  /// Newton on the whole step; false where numbers are no longer finite.
  bool Iterate(bool stiffening, FullStepReport& report);
};

}  // namespace fork1s
