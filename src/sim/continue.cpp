#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/set_stiffness.hpp>
#include <fork1s/sim/continue.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "mechanism/activation.hpp"
#include "mechanism/freedoms.hpp"
#include "mechanism/sensor_stiffness.hpp"

namespace fork1s {
namespace {

template <class T>
int PlaceOf(const std::vector<T>& all, const std::string& name) {
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].name == name) return static_cast<int>(i);
  return -1;
}

std::map<std::string, int> CoordinatesByName(const Mechanism& mechanism) {
  std::map<std::string, int> places;
  for (int i = 0; i < mechanism.num_coordinates(); ++i) places[mechanism.CoordinateName(i)] = i;
  return places;
}

// The state of a mechanism as its definition has it, with what `before` says of joints and controls of the
// same name.
Expected<KeyframeDef::MechanismState> StateOf(const MechanismDef& def, const MechanismDef* known,
                                              const KeyframeDef::MechanismState* before) {
  auto built = BuildMechanism(def);
  if (!built) return tl::unexpected(built.error());
  KeyframeDef::MechanismState state;
  state.q = state.q_dot = VectorX::Zero(built->num_coordinates());
  state.X_WR = def.X_WR;
  state.controls = VectorX(static_cast<Eigen::Index>(def.controls.size()));
  for (std::size_t c = 0; c < def.controls.size(); ++c)
    state.controls(static_cast<Eigen::Index>(c)) = def.controls[c].initial;
  state.activation = internal::InitialActivation(def);
  if (!known) return state;
  const auto old = BuildMechanism(*known);
  if (!old) return tl::unexpected(old.error());
  const auto places = CoordinatesByName(*old);
  for (const auto& [name, at] : CoordinatesByName(*built))
    if (const auto found = places.find(name); found != places.end()) {
      state.q(at) = before->q(found->second);
      state.q_dot(at) = before->q_dot(found->second);
    }
  for (std::size_t c = 0; c < def.controls.size(); ++c)
    if (const int at = PlaceOf(known->controls, def.controls[c].name);
        at >= 0 && at < before->controls.size()) {
      state.controls(static_cast<Eigen::Index>(c)) = before->controls(at);
      if (state.activation.size() > 0 && at < before->activation.size())
        state.activation(static_cast<Eigen::Index>(c)) = before->activation(at);
    }
  if (def.base != BaseKind::kFixed) {
    state.X_WR = before->X_WR;
    state.V_R = before->V_R;
  }
  return state;
}

}  // namespace

Expected<Scene> WithStiffness(Scene scene, const std::string& coordinate, double stiffness) {
  if (!(std::isfinite(stiffness) && stiffness >= 0))
    return Fail(ErrorCode::kUsage, "stiffness of '" + coordinate + "'", "must be finite and 0 or more");
  std::string known;
  const auto add = [&](const std::string& name) { known += (known.empty() ? "" : ", ") + name; };
  for (MechanismDef& def : scene.mechanisms)
    for (const JointDef& joint : def.joints)
      for (int f = 0; f < static_cast<int>(joint.freedoms.size()); ++f) {
        const std::string name =
            internal::CoordinateName(joint.name, static_cast<int>(joint.freedoms.size()), f);
        if (name == coordinate) {
          const FreedomRef freedom{def.FindJoint(joint.name), f};
          internal::SetSensorStiffness(static_cast<std::size_t>(&def - scene.mechanisms.data()), freedom,
                                       stiffness, scene);
          def = SetStiffness(std::move(def), freedom, stiffness);
          return scene;
        }
        add(name);
      }
  for (MechanismDef& def : scene.mechanisms) {
    if (StiffnessOf(def, coordinate) > 0) {
      if (stiffness == 0)
        return Fail(ErrorCode::kUsage, "stiffness of '" + coordinate + "'",
                    "must be above 0 for a tendon or its servo");
      internal::SetSensorStiffness(static_cast<std::size_t>(&def - scene.mechanisms.data()), coordinate,
                                   stiffness, scene);
      def = SetStiffness(std::move(def), coordinate, stiffness);
      return scene;
    }
    for (const SpringDef& spring : def.springs)
      if (spring.stiffness > 0) add(spring.name);
  }
  return Fail(ErrorCode::kUsage, "joint coordinate, tendon or servo of a tendon '" + coordinate + "'",
              "there are: " + known);
}

Expected<Simulation> Continue(const Simulation& from, Scene scene) {
  const KeyframeDef present = from.State();
  const Scene& before = from.scene();
  KeyframeDef key;
  key.name = "continued";
  for (const MechanismDef& def : scene.mechanisms) {
    const int at = PlaceOf(before.mechanisms, def.name);
    const auto place = static_cast<std::size_t>(at);
    auto state = at < 0 ? StateOf(def, nullptr, nullptr)
                        : StateOf(def, &before.mechanisms[place], &present.mechanisms[place]);
    if (!state) return tl::unexpected(state.error());
    key.mechanisms.push_back(std::move(*state));
  }
  for (const FreeBodyDef& def : scene.free_bodies) {
    const int at = PlaceOf(before.free_bodies, def.name);
    key.free_bodies.push_back(at < 0 ? KeyframeDef::FreeBodyState{def.X_WB}
                                     : present.free_bodies[static_cast<std::size_t>(at)]);
  }
  SimulationOptions options = from.options();
  options.dt = from.dt();
  options.initial_keyframe = 0;
  // Alone, since keyframes of the file may be of other joints than the scene has now.
  scene.keyframes = {std::move(key)};
  auto next = Simulation::Create(std::move(scene), options);
  if (!next) return next;
  if (auto detailed = next->SetFidelity(from.fidelity(), from.frozen_grasps()); !detailed)
    return tl::unexpected(detailed.error());
  // The same moment with the clock and the inputs of before: so set-points over time go on where they were.
  Simulation::Snapshot moment = next->Save();
  const Simulation::Snapshot then = from.Save();
  moment.steps = then.steps;
  std::vector<std::string> new_bases;  // driven ones that were none before: they count from where they are
  for (std::size_t i = 0; i < next->scene().mechanisms.size(); ++i) {
    const MechanismDef& def = next->scene().mechanisms[i];
    if (def.base != BaseKind::kDriven) continue;
    const int at = PlaceOf(before.mechanisms, def.name);
    if (at >= 0 && before.mechanisms[static_cast<std::size_t>(at)].base == BaseKind::kDriven)
      moment.base_start[i] = then.base_start[static_cast<std::size_t>(at)];
    else
      new_bases.push_back(def.bodies[0].name + ".");
  }
  for (int i = 0; i < next->controls().size(); ++i) {
    const std::string& name = next->control_names()[static_cast<std::size_t>(i)];
    const bool is_new = std::any_of(new_bases.begin(), new_bases.end(),
                                    [&](const std::string& base) { return name.starts_with(base); });
    if (const int at = from.FindControl(name); at >= 0 && !is_new) {
      moment.controls(i) = then.controls(at);
      moment.last_controls(i) = then.last_controls(at);
    }
  }
  if (auto restored = next->Restore(moment); !restored) return tl::unexpected(restored.error());
  next->SetControls(next->controls());  // within the limits that the scene has now
  return next;
}

}  // namespace fork1s
