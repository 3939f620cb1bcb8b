// Set-points of position servos at the start: F = gain u + b0 + b1 L, zero at u = -(b0 + b1 L)/gain with the length L
// of the starting pose.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "actuator_law.hpp"
#include "conversion.hpp"
#include "mujoco_model.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// A control that is the set-point of a servo, and the servo.
struct HeldControl {
  std::size_t mechanism = 0, control = 0;
  int actuator = -1;
  double gain = 0, b0 = 0, b1 = 0;

  double SetPoint(double length) const { return -(b0 + b1 * length) / gain; }
};

std::vector<HeldControl> FindHeldControls(const Conversion& c) {
  std::vector<HeldControl> held;
  for (const LinearActuator& a : LinearActuators(c.m, c.d)) {
    const auto mechanism = static_cast<std::size_t>(c.MechanismOf(a.length.terms[0].first));
    const auto& sources = c.controls[mechanism];
    for (const ActuatorInput& input : a.inputs) {
      if (!input.setpoint || input.gain == 0) continue;
      const auto source = std::find_if(sources.begin(), sources.end(),
                                       [&](const ControlSource& s) { return s.ctrl == input.ctrl; });
      if (source != sources.end())
        held.push_back({mechanism, static_cast<std::size_t>(source - sources.begin()), a.actuator, input.gain,
                        a.b0, a.b1});
    }
  }
  return held;
}

// Lengths of all actuators by MuJoCo at the positions of a state. Bases do not count: a length is within a mechanism.
void UpdateLengths(const Conversion& c, const KeyframeDef& state, mjData& d) {
  const FileState file = ComputeFileState(FileJointsOf(c), c.scene, state);
  std::copy(file.positions.begin(), file.positions.end(), d.qpos);
  mj_kinematics(&c.m, &d);
  mj_comPos(&c.m, &d);
  mj_tendon(&c.m, &d);
  mj_transmission(&c.m, &d);
}

// Writes set-points and activations into a state; names those whose set-point is outside of its range.
std::vector<std::string> HoldState(const Conversion& c, const std::vector<HeldControl>& held, mjData& d,
                                   KeyframeDef& state) {
  UpdateLengths(c, state, d);
  std::vector<std::string> bounded;
  for (const HeldControl& h : held) {
    const auto& controls = c.scene.mechanisms[h.mechanism].controls;
    const ControlDef& control = controls[h.control];
    KeyframeDef::MechanismState& at = state.mechanisms[h.mechanism];
    const auto i = static_cast<Eigen::Index>(h.control);
    const double wanted = h.SetPoint(d.actuator_length[c.m.actuator_outadr[h.actuator]]);
    // The rate of the set-point is the control of an integrator, the set-point its activation.
    const bool is_rate = control.dynamics == ControlDynamics::kIntegrator;
    double set = std::clamp(wanted, control.activation_lower, control.activation_upper);
    if (!is_rate) set = std::clamp(set, control.lower, control.upper);
    constexpr double kRounding = 1e-9;  // of ranges as files write them
    if (std::abs(set - wanted) > kRounding * std::max(1.0, std::abs(wanted))) bounded.push_back(control.name);
    at.controls[i] = is_rate ? std::clamp(0.0, control.lower, control.upper) : set;
    if (control.dynamics == ControlDynamics::kNone) continue;
    if (at.activation.size() == 0) {
      at.activation = VectorX::Zero(at.controls.size());
      for (std::size_t k = 0; k < controls.size(); ++k)
        at.activation[static_cast<Eigen::Index>(k)] = controls[k].initial_activation;
    }
    at.activation[i] = set;
  }
  return bounded;
}

// Controls that keep the value of the file.
void NoteOthers(Conversion& c, const std::vector<HeldControl>& held) {
  std::vector<std::string> others;
  for (std::size_t m = 0; m < c.controls.size(); ++m) {
    for (std::size_t k = 0; k < c.controls[m].size(); ++k) {
      const bool is_held = std::any_of(
          held.begin(), held.end(), [&](const HeldControl& h) { return h.mechanism == m && h.control == k; });
      if (!is_held && c.controls[m][k].pd.empty() && c.controls[m][k].ctrl >= 0)
        others.push_back(c.scene.mechanisms[m].controls[k].name);
    }
  }
  c.NoteMany(ImportNote::Kind::kChosen, "control", others,
             "is no set-point of a position servo, so the option hold leaves it at the value of the file");
  const bool has_pd = std::any_of(c.controls.begin(), c.controls.end(), [](const auto& sources) {
    return std::any_of(sources.begin(), sources.end(),
                       [](const ControlSource& source) { return !source.pd.empty(); });
  });
  if (held.empty() && !has_pd)
    c.Note(ImportNote::Kind::kChosen, "option hold",
           "no position servo is there to hold the start; the option pd gives joints one");
}

}  // namespace

std::optional<Error> ApplyHold(Conversion& c, const ImportOptions& options) {
  if (!options.hold) return std::nullopt;
  const std::vector<HeldControl> held = FindHeldControls(c);
  NoteOthers(c, held);
  if (held.empty()) return std::nullopt;
  // A keyframe of the file stays what MuJoCo reads there; the start is one of its own.
  if (c.initial_keyframe < c.m.nkey) AddStart(c, PresentStart(c));
  const auto data = ReferenceData(c.m, c.file);
  if (!data) return data.error();
  for (std::size_t key = 0; key < c.scene.keyframes.size(); ++key) {
    const std::vector<std::string> bounded = HoldState(c, held, **data, c.scene.keyframes[key]);
    if (static_cast<int>(key) == c.initial_keyframe)
      c.ChangedMany(
          "control", bounded,
          "the set-point that holds the start is outside its range: it is at the nearest value inside");
  }
  const KeyframeDef& start = c.scene.keyframes[static_cast<std::size_t>(c.initial_keyframe)];
  for (const HeldControl& h : held) {
    ControlDef& control = c.scene.mechanisms[h.mechanism].controls[h.control];
    const KeyframeDef::MechanismState& at = start.mechanisms[h.mechanism];
    const auto i = static_cast<Eigen::Index>(h.control);
    control.initial = at.controls[i];
    if (control.dynamics != ControlDynamics::kNone) control.initial_activation = at.activation[i];
  }
  return std::nullopt;
}

}  // namespace fork1s::internal
