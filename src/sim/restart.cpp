#include "sim/restart.hpp"

#include <algorithm>
#include <utility>

namespace fork1s::internal {

Expected<Restarted> RestartAt(const Simulation& from, const KeyframeDef& state, std::size_t num_keyframes) {
  Scene scene = from.scene();
  SimulationOptions options = from.options();
  if (scene.keyframes.size() > num_keyframes) scene.keyframes.resize(num_keyframes);
  scene.keyframes.push_back(state);
  options.initial_keyframe = static_cast<int>(scene.keyframes.size()) - 1;
  auto next = Simulation::Create(std::move(scene), options);
  if (!next) return tl::unexpected(next.error());
  for (int i = 0; i < next->controls().size(); ++i)
    if (!next->DrivesBase(i)) next->SetControl(i, from.controls()(i));
  double change = 0;
  for (std::size_t i = 0; i < state.mechanisms.size(); ++i) {
    const VectorX& wanted = state.mechanisms[i].q;
    if (wanted.size() == 0) continue;
    change = std::max(change, (next->JointCoordinates(static_cast<int>(i)) - wanted).cwiseAbs().maxCoeff());
  }
  return Restarted{std::move(*next), change};
}

}  // namespace fork1s::internal
