// The order in which the wire counts bodies.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <vector>

namespace fork1s::internal {

/// The wire counts as the world does: the bodies of every mechanism, what it holds last, then the free
/// bodies. Simulation::bodies() keeps its order whatever the fidelity; both are the same as long as nothing
/// is held. The body that stands in the place of a mechanism that joined another is on the wire alone.
class BodyOrder {
 public:
  explicit BodyOrder(const Simulation& simulation) {
    const World& world = simulation.world();
    first_.push_back(0);
    for (const MechanismDynamics& m : world.mechanisms())
      first_.push_back(first_.back() + m.mechanism().num_bodies());
    scene_body_.resize(static_cast<std::size_t>(first_.back()) + world.free_bodies().size(), -1);
    for (const SceneBody& b : simulation.bodies()) {
      const int scene_body = static_cast<int>(wire_body_.size());
      wire_body_.push_back(OnWire(b.mechanism, b.index));
      scene_body_[static_cast<std::size_t>(wire_body_.back())] = scene_body;
    }
  }

  int size() const { return static_cast<int>(scene_body_.size()); }
  /// Of a body of world(): of a mechanism, or -1 and a free body.
  int OnWire(int mechanism, int index) const {
    return (mechanism < 0 ? first_.back() : first_[static_cast<std::size_t>(mechanism)]) + index;
  }
  /// Of a place in Simulation::bodies(), and back; -1 is the still world in both, and back also an empty
  /// place.
  int OnWire(int scene_body) const {
    return scene_body < 0 ? -1 : wire_body_[static_cast<std::size_t>(scene_body)];
  }
  int InScene(int wire_body) const {
    return wire_body < 0 ? -1 : scene_body_[static_cast<std::size_t>(wire_body)];
  }

 private:
  std::vector<int> first_;  // body of every mechanism, then of the free bodies
  std::vector<int> wire_body_, scene_body_;
};

}  // namespace fork1s::internal
