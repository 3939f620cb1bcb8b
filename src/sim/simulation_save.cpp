// Moments of a simulation: taken, gone back to, compared.
#include <fork1s/sim/simulation.hpp>

#include <cstring>

#include "join.hpp"

namespace fork1s {

Simulation::Snapshot Simulation::Save() const {
  Snapshot snapshot;
  Save(snapshot);
  return snapshot;
}

void Simulation::Save(Snapshot& out) const {
  auto& [steps, controls, last_controls, base_rates, fidelity, frozen_grasps, made_of, keyframe, base_start,
         last_step, world] = out;
  steps = steps_;
  controls = controls_;
  last_controls = last_controls_;
  base_rates = base_rates_;
  fidelity = fidelity_;
  frozen_grasps = frozen_grasps_;
  made_of = present_scene_;
  keyframe = world_keyframe_;
  base_start = base_start_;
  last_step = last_step_;
  world_.Save(world);
}

Expected<void> Simulation::Restore(const Snapshot& snapshot) {
  const auto other = [&](const char* what) {
    return Fail(ErrorCode::kUsage, "scene '" + scene_.name + "'",
                std::string("cannot go back to a moment of another scene: it has ") + what +
                    "; restore what this simulation, or one of the same scene, has saved");
  };
  if (!snapshot.made_of) return other("no scene, as a snapshot that nothing was saved to");
  const Scene& then = *snapshot.made_of;
  if (then.name != scene_.name) return other("another name");
  if (then.mechanisms.size() != scene_.mechanisms.size()) return other("another number of mechanisms");
  if (snapshot.controls.size() != controls_.size()) return other("another number of controls");
  const bool same_world =
      fidelity_ == snapshot.fidelity && world_keyframe_ == snapshot.keyframe &&
      frozen_grasps_.size() == snapshot.frozen_grasps.size() &&
      (present_scene_ == snapshot.made_of || (frozen_grasps_.empty() && world_keyframe_ < 0));
  if (!same_world) {
    auto places = internal::PlacesOf(given_, snapshot.frozen_grasps);
    if (!places) return tl::unexpected(places.error());
    World::Options options = WorldOptions(snapshot.fidelity);
    options.initial_keyframe = snapshot.keyframe;
    auto world = World::Create(then, options);
    if (!world) return tl::unexpected(world.error());
    if (auto fits = world->CanRestore(snapshot.world); !fits) return fits;
    world_ = std::move(*world);
    places_ = std::move(*places);
  } else if (auto fits = world_.CanRestore(snapshot.world); !fits) {
    return fits;
  }
  world_.Restore(snapshot.world);
  present_scene_ = snapshot.made_of;
  world_keyframe_ = snapshot.keyframe;
  fidelity_ = snapshot.fidelity;
  frozen_grasps_ = snapshot.frozen_grasps;
  steps_ = snapshot.steps;
  controls_ = snapshot.controls;
  last_controls_ = snapshot.last_controls;
  base_rates_ = snapshot.base_rates;
  base_start_ = snapshot.base_start;
  last_step_ = snapshot.last_step;
  // Forces of frozen contacts depend on more than what is saved.
  last_step_.exists = last_step_.exists && frozen_grasps_.empty();
  if (!same_world) ListBodies();
  return {};
}

std::uint64_t Simulation::HashState() const {
  WorldState state;
  world_.Save(state);
  VectorX inputs = controls_;
  const auto add = [&](const VectorX& v) {
    inputs.conservativeResize(inputs.size() + v.size());
    inputs.tail(v.size()) = v;
  };
  if (last_controls_ != controls_) add(last_controls_);
  if (!base_rates_.array().isNaN().all()) add(base_rates_);
  return HashOf(state, inputs);
}

}  // namespace fork1s
