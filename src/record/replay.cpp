#include <bit>
#include <cmath>
#include <fork1s/record/recording.hpp>
#include <optional>
#include <utility>

namespace fork1s {
namespace {

Expected<void> CheckKeyframe(const RecordingHeader& h) {
  const int key = h.options.initial_keyframe;
  if (key < 0) return {};
  auto refuse = [&](const std::string& what) {
    return Fail(ErrorCode::kFormat, h.path, "names an initial keyframe " + what + "; the file is damaged");
  };
  if (key >= static_cast<int>(h.scene.keyframes.size())) return refuse("that the scene does not have");
  const KeyframeDef& k = h.scene.keyframes[static_cast<std::size_t>(key)];
  if (k.mechanisms.size() != h.scene.mechanisms.size() || k.free_bodies.size() != h.scene.free_bodies.size())
    return refuse("of another scene");
  for (std::size_t i = 0; i < k.mechanisms.size(); ++i) {
    Eigen::Index n = 0;
    for (const JointDef& j : h.scene.mechanisms[i].joints) n += static_cast<Eigen::Index>(j.freedoms.size());
    const auto& s = k.mechanisms[i];
    const auto controls = static_cast<Eigen::Index>(h.scene.mechanisms[i].controls.size());
    if (s.q.size() != n || (s.q_dot.size() != 0 && s.q_dot.size() != n) ||
        (s.controls.size() != 0 && s.controls.size() != controls) ||
        (s.activation.size() != 0 && s.activation.size() != controls))
      return refuse("of another scene");
  }
  return {};
}

// 0 and -0 are two inputs.
std::uint64_t Bits(double value) { return std::bit_cast<std::uint64_t>(value); }

// Only what changed: an initial value may lie outside the limits to which a new value is moved.
void SetChangedControls(const Eigen::Ref<const VectorX>& values, Simulation& simulation) {
  for (int k = 0; k < values.size(); ++k)
    if (Bits(values(k)) != Bits(simulation.controls()(k))) simulation.SetControl(k, values(k));
}

void SetInitialControls(const RecordingHeader& h, Simulation& simulation) {
  const auto count = static_cast<Eigen::Index>(h.control_names.size());
  // Driven bases start at their pose.
  SetChangedControls(
      Eigen::Map<const VectorX>(h.start_controls.data(), count - simulation.num_base_coordinates()),
      simulation);
  simulation.StartFromControls();
  SetChangedControls(Eigen::Map<const VectorX>(h.initial_controls.data(), count), simulation);
}

// Goes on from `result`.
Expected<void> ReplaySteps(const Recording& recording, Simulation& simulation, ReplayResult& result) {
  for (int i = 0; i < recording.num_steps(); ++i) {
    const VectorX controls = recording.Controls(i);
    SetChangedControls(controls, simulation);
    const VectorX rates = recording.BaseRates(i);
    const auto first = static_cast<int>(controls.size() - rates.size());
    for (int k = 0; k < rates.size(); ++k)
      if (!std::isnan(rates(k))) simulation.SetBaseRate(first + k, rates(k));
    if (auto set = simulation.SetFidelity(recording.FidelityOf(i)); !set) return set;
    simulation.ClearPointSprings();
    for (const auto& [body, spring] : recording.PointSprings(i)) simulation.SetPointSpring(body, spring);
    ApplyWrenches(recording.Wrenches(i), simulation);
    simulation.Step(recording.data().controls_moved[static_cast<std::size_t>(i)] != 0);
    ++result.steps;
    result.final_hash = simulation.HashState();
    if (result.first_difference_step < 0 &&
        result.final_hash != recording.data().hash[static_cast<std::size_t>(i)])
      result.first_difference_step = result.steps;
  }
  return {};
}

}  // namespace

void ApplyWrenches(const std::vector<AppliedWrench>& wrenches, Simulation& simulation) {
  for (const AppliedWrench& w : wrenches) simulation.ApplyWrench(w.body, w.force_W, w.moment_W, w.point_W);
}

namespace {

// Calls `next` for one stretch after the other until there is none, or none with steps.
template <class NextPart>
Expected<ReplayResult> ReplayParts(const RecordingHeader& h, NextPart&& next) {
  if (!h.has_steps_of_this_version)
    return Fail(ErrorCode::kUsage, h.path,
                "was written by " + h.program +
                    ", whose steps were others; view and export show it, and that version replays it");
  if (h.first_step != 0)
    return Fail(ErrorCode::kUsage, h.path,
                "begins after " + std::to_string(h.first_step) +
                    " steps of a run, whose state it does not hold; only recordings from the first step can "
                    "be replayed");
  if (auto ok = CheckKeyframe(h); !ok) return tl::unexpected(ok.error());
  try {
    auto simulation = Simulation::Create(h.scene, h.options);
    if (!simulation) return tl::unexpected(simulation.error());
    if (simulation->control_names() != h.control_names || simulation->bodies().size() != h.bodies.size())
      return Fail(ErrorCode::kFormat, h.path,
                  "names other controls or bodies than its scene has; the file is damaged");
    SetInitialControls(h, *simulation);
    ReplayResult result;
    result.final_hash = simulation->HashState();
    if (result.final_hash != h.initial_hash) result.first_difference_step = 0;
    while (true) {
      const Expected<const Recording*> part = next();
      if (!part) return tl::unexpected(part.error());
      if (*part == nullptr || (*part)->num_steps() == 0) break;
      if (auto ok = ReplaySteps(**part, *simulation, result); !ok) return tl::unexpected(ok.error());
    }
    result.identical = result.first_difference_step < 0;
    return result;
  } catch (const std::invalid_argument& e) {  // inputs that no run can have had
    return Fail(ErrorCode::kFormat, h.path,
                std::string("cannot be replayed (") + e.what() + "); the file is damaged");
  }
}

}  // namespace

Expected<ReplayResult> Replay(const Recording& recording) {
  bool given = false;
  return ReplayParts(recording.header(), [&]() -> Expected<const Recording*> {
    return std::exchange(given, true) ? nullptr : &recording;
  });
}

Expected<ReplayResult> Replay(RecordingReader& reader) {
  std::optional<Recording> part;
  return ReplayParts(reader.header(), [&]() -> Expected<const Recording*> {
    auto next = reader.Next();
    if (!next) return tl::unexpected(next.error());
    part.emplace(std::move(*next));
    return &*part;
  });
}

}  // namespace fork1s
