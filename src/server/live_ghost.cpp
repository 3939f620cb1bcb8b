// The full simulation beside the live one: when it starts, what it is given, what viewers get of it.
#include "server/live_simulation.hpp"
#include "sim/interface_names.hpp"

namespace fork1s {
namespace {

std::vector<Vector3> Origins(const Simulation& simulation) {
  std::vector<RigidTransform> X_WB;
  simulation.Poses(X_WB);
  std::vector<Vector3> p_WB;
  for (const RigidTransform& X : X_WB) p_WB.push_back(X.translation());
  return p_WB;
}

}  // namespace

void LiveSimulation::SwitchGhost(bool on) {
  if (on == ghost_on_) return;
  ghost_on_ = on;
  latest_.ghost = nullptr;
  if (on)
    BeginGhost();
  else
    ghost_->End();
  PublishSettings();
}

void LiveSimulation::BeginGhost() {
  if (!ghost_) ghost_ = std::make_unique<FullGhost>();
  latest_.ghost = nullptr;
  ghost_steps_ = -1;
  GhostStart start;
  start.scene = simulation_.scene();
  start.scene.keyframes.push_back(PresentState());
  start.options.dt = simulation_.dt();
  start.options.initial_keyframe = static_cast<int>(start.scene.keyframes.size()) - 1;
  start.options.interfaces = InterfaceNames(simulation_);
  start.options.collision = simulation_.options().collision;
  start.base_start = base_start_;
  start.p_WB = Origins(simulation_);
  start.time = time_offset_ + simulation_.time();
  ghost_->Begin(std::move(start));
}

void LiveSimulation::StepGhost() {
  if (!ghost_on_) return;
  ghost_->Push({simulation_.controls(), simulation_.step_options().gravity, loads_, Origins(simulation_)});
}

void LiveSimulation::CaptureGhost(int viewers) {
  if (!ghost_on_) return;
  if (auto fault = ghost_->PopFault()) {
    faults_.push_back({"ghost", *fault});
    return SwitchGhost(false);
  }
  if (viewers == 0) return SwitchGhost(false);  // it costs a processor
  const std::optional<GhostView> view = ghost_->Newest();
  if (!view) return;
  // Where no step was done since, how far behind it is still is news, but not sixty times a second.
  constexpr std::uint32_t kSeldom = 15;
  if (view->steps == ghost_steps_ && latest_.sequence % kSeldom != 0) return;
  ghost_steps_ = view->steps;
  ++latest_.ghost_sequence;
  latest_.ghost = std::make_shared<const std::string>(EncodeGhost(*view, simulation_, latest_.epoch));
}

}  // namespace fork1s
