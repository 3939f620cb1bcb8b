#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/sim/load_factor.hpp>
#include <utility>

#include <fmt/format.h>

#include "body_order.hpp"
#include "scene_description.hpp"
#include "server/live_simulation.hpp"
#include "server/pull_spring.hpp"
#include "signals.hpp"

namespace fork1s {
namespace {

constexpr double kFrame = 1.0 / 60;  // s
constexpr double kPushTime = 0.05;   // s
constexpr std::size_t kMaxPushes = 16;

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Fidelity FidelityOf(const LiveSettings& s) { return {s.detail, s.modes, s.recovery}; }

Message Share(std::string text) { return std::make_shared<const std::string>(std::move(text)); }

}  // namespace

Expected<LiveSimulation> LiveSimulation::Create(Scene scene, const SimulationOptions& given,
                                                const std::string& title, ModelFile file) {
  Scene original = scene;
  SimulationOptions options = given;
  auto simulation = Simulation::Create(std::move(scene), options);
  if (!simulation) return tl::unexpected(simulation.error());
  LiveSimulation live(std::move(*simulation));
  live.original_ = std::move(original);
  live.options_ = options;
  live.title_ = title;
  LiveSettings& s = live.settings_;
  s.dt = live.simulation_.dt();
  s.gravity = live.original_.gravity;
  s.recovery = options.recovery;
  s.modes = options.reduction.modes;
  s.detail = options.detail;
  s.pull_stiffness = SuggestPullStiffness(live.simulation_);
  // Groups name joints by their place in the built mechanism; both definitions hold them in that order.
  for (std::size_t i = 0; i < live.original_.mechanisms.size(); ++i)
    live.original_.mechanisms[i] = live.simulation_.world().mechanisms()[i].mechanism().definition();
  s.groups = FindJointGroups(live.original_.mechanisms);
  s.servos = file.servos;
  s.tunables = FindTunables(live.original_, s.servos);
  live.file_ = std::move(file);
  live.first_dt_ = s.dt;
  s.interfaces.resize(live.original_.mechanisms.size());
  for (const MechanismDynamics& m : live.simulation_.world().mechanisms())
    live.base_origin_.push_back(m.state().X_WR);
  live.base_start_ = live.base_origin_;
  live.targets_ = live.simulation_.controls();
  live.past_ = Past(live.simulation_.bodies().size());
  live.ShowShapes(1);
  live.ShowTuning();
  live.AfterBuild();
  return live;
}

void LiveSimulation::ShowShapes(std::uint32_t version) {
  latest_.geometry_version = version;
  latest_.geometry = Share(EncodeGeometry(simulation_, version));
  latest_.meshes = Share(EncodeMeshes(simulation_));
}

// Everything that hangs on the identity of the reduced model.
void LiveSimulation::AfterBuild() {
  interpenetration_.reset();
  servos_ = ServosNow(original_, settings_);
  ClearError();
  encoded_reference_.assign(simulation_.world().mechanisms().size(), VectorX());
  latest_.maps.assign(encoded_reference_.size(), nullptr);
  latest_.versions.resize(encoded_reference_.size(), 0);
  ++latest_.epoch;
  latest_.scene = Share(SceneMessage());
  PublishSettings();
  if (ghost_on_) BeginGhost();
}

KeyframeDef LiveSimulation::PresentState() const { return SetDown(simulation_.State()); }

KeyframeDef LiveSimulation::SetDown(KeyframeDef key) const {
  for (std::size_t i = 0; i < key.mechanisms.size(); ++i)
    if (simulation_.given_mechanism(static_cast<int>(i)).base() == BaseKind::kDriven)
      key.mechanisms[i].V_R.setZero();  // it is set down again
  return key;
}

// At `state`, or from the start.
Expected<void> LiveSimulation::Rebuild(LiveSettings settings, const KeyframeDef* state) {
  const bool keep_state = state != nullptr;
  const double start = Now();
  Scene scene = ApplySettings(original_, settings);
  const bool holds = settings.detail == DetailLevel::kObject;
  if (holds && !keep_state) settings.detail = DetailLevel::kInterface;  // nothing is held at the start
  SimulationOptions options = options_;
  options.dt = settings.dt;
  options.recovery = settings.recovery;
  options.reduction.modes = settings.modes;
  options.detail = holds ? DetailLevel::kInterface : settings.detail;
  if (keep_state) {
    scene.keyframes.push_back(*state);
    options.initial_keyframe = static_cast<int>(scene.keyframes.size()) - 1;
  }
  const double time = keep_state ? time_offset_ + simulation_.time() : 0;
  const double steps = keep_state ? steps_before_ + static_cast<double>(simulation_.steps()) : 0;
  auto built = Simulation::Create(std::move(scene), options);
  if (!built) return tl::unexpected(built.error());
  if (settings.detail == DetailLevel::kObject)
    if (auto done = built->SetFidelity(FidelityOf(settings), simulation_.frozen_grasps()); !done) return done;
  const bool new_order = !simulation_.frozen_grasps().empty() || !built->frozen_grasps().empty();
  simulation_ = std::move(*built);
  time_offset_ = time;
  steps_before_ = steps;
  settings_ = std::move(settings);
  base_start_.clear();
  for (std::size_t i = 0; i < simulation_.scene().mechanisms.size(); ++i)
    base_start_.push_back(simulation_.BasePose(static_cast<int>(i)));
  if (!keep_state) {
    targets_ = simulation_.controls();
    pull_.reset();
    pushes_.clear();
    carry_ = 0;
    scalars_.refreshes = 0;
    played_ = table_;
  }
  StartTargets();
  scalars_.reduce_ms = 1e3 * (Now() - start);
  if (new_order) ShowShapes(latest_.geometry_version + 1);
  AfterBuild();
  return {};
}

Expected<void> LiveSimulation::ChangeFidelity(const LiveSettings& settings) {
  const double start = Now();
  const bool held = !simulation_.frozen_grasps().empty();
  if (auto done = simulation_.SetFidelity(FidelityOf(settings)); !done) return done;
  settings_ = settings;
  scalars_.reduce_ms = 1e3 * (Now() - start);
  if (held || !simulation_.frozen_grasps().empty()) ShowShapes(latest_.geometry_version + 1);
  AfterBuild();
  return {};
}

// A model that cannot be built leaves the present one as it is; the sliders go back to what holds.
std::optional<Refusal> LiveSimulation::OrSay(const Expected<void>& done) {
  if (done) return {};
  ++latest_.settings_version;
  return Refusal{done.error().Text()};
}

void LiveSimulation::Replace(LiveSimulation next) {
  next.latest_.sequence = latest_.sequence;
  next.latest_.epoch = latest_.epoch;
  next.latest_.settings_version = latest_.settings_version;
  next.latest_.problem_version = latest_.problem_version;
  next.latest_.problem = latest_.problem;
  next.latest_.tuning_version = latest_.tuning_version;
  next.settings_.speed = settings_.speed;
  next.settings_.signals = settings_.signals;
  next.settings_.error = settings_.error;
  next.paused_ = paused_;
  next.ghost_ = std::move(ghost_);
  next.ghost_on_ = ghost_on_;
  next.latest_.ghost_sequence = latest_.ghost_sequence;
  next.ShowShapes(latest_.geometry_version + 1);
  next.ShowTuning();
  next.AfterBuild();
  *this = std::move(next);
  if (latest_.problem_version > 0) SetFileProblem("");
}

void LiveSimulation::SetFileProblem(const std::string& sentence) {
  ++latest_.problem_version;
  latest_.problem = Share(internal::ProblemMessage("file", sentence));
}

std::optional<Refusal> LiveSimulation::Handle(const Command& c) {
  const internal::BodyOrder order(simulation_);
  const bool touches = c.kind == Command::Kind::kPull || c.kind == Command::Kind::kPush;
  const bool known = c.body >= 0 && c.body < order.size() && order.InScene(c.body) >= 0;
  if (touches && !known) return Refusal{fmt::format("there is no body {}", c.body)};
  const int body = touches ? order.InScene(c.body) : -1;
  switch (c.kind) {
    case Command::Kind::kPull:
      if (pull_ && pull_->viewer != c.viewer)
        return Refusal{"another viewer is dragging; wait until it lets go", true};
      if (!pull_ || pull_->body != body)
        pull_ = Pull{c.viewer, body, c.point, c.target, simulation_.Pose(body) * c.point};
      pull_->point_B = c.point;
      pull_->target_W = c.target;
      return {};
    case Command::Kind::kLeft:
    case Command::Kind::kRelease:
      if (pull_ && pull_->viewer == c.viewer) pull_.reset();
      return {};
    case Command::Kind::kPush: {
      const double length = c.target.norm();
      if (!(length > 1e-9)) return Refusal{"a push needs a direction"};
      if (pushes_.size() >= kMaxPushes) return Refusal{"enough pushes at once; wait a moment", true};
      // As hard as the spring pulls over a fifth of the model, for 50 ms.
      const double force = 0.2 * SceneRadius(simulation_) * settings_.pull_stiffness;
      pushes_.push_back({body, c.point, force / length * c.target,
                         std::max(1, static_cast<int>(std::lround(kPushTime / simulation_.dt())))});
      return {};
    }
    case Command::Kind::kPause:
      paused_ = c.on;
      return {};
    case Command::Kind::kStep:
      paused_ = step_requested_ = true;
      return {};
    case Command::Kind::kReset:
      return OrSay(Rebuild(settings_, nullptr));
    case Command::Kind::kHold:
      return HandleHold();
    case Command::Kind::kSet:
      return HandleSet(c);
    case Command::Kind::kInterfaces:
      return HandleInterfaces(c);
    case Command::Kind::kShape:
      return HandleShape(c);
    case Command::Kind::kResume:
      return HandleResume(c);
    case Command::Kind::kWrite:
      return HandleWrite(c);
    case Command::Kind::kGhost:
      SwitchGhost(c.on);
      return {};
  }
  return {};
}

std::optional<Refusal> LiveSimulation::HandleSet(const Command& c) {
  if (c.setting == "control") {
    if (c.index < 0 || c.index >= targets_.size())
      return Refusal{fmt::format("there is no control {}", c.index)};
    targets_(c.index) = c.value;
    RemoveFromTable(c.index);
  } else {
    LiveSettings changed = settings_;
    const auto kind = ChangeSetting(c.setting, c.index, c.value, changed);
    if (!kind) return OrSay(tl::unexpected(kind.error()));
    if (*kind == SettingKind::kFidelity) return OrSay(ChangeFidelity(changed));
    if (*kind == SettingKind::kModel) {
      const KeyframeDef now = PresentState();
      auto refusal = OrSay(Rebuild(changed, &now));
      if (c.setting == "tune") ShowTuning();
      return refusal;
    }
    settings_ = changed;
    simulation_.step_options().gravity = settings_.gravity;
  }
  PublishSettings();
  return {};
}

std::optional<Refusal> LiveSimulation::HandleInterfaces(const Command& c) {
  if (c.index < 0 || c.index >= static_cast<int>(settings_.interfaces.size()))
    return Refusal{fmt::format("there is no mechanism {}", c.index)};
  LiveSettings changed = settings_;
  // While mechanisms hold something together the wire has them as one.
  const auto is_part = [&](std::size_t i) {
    return simulation_.place(static_cast<int>(i)).mechanism == c.index;
  };
  for (std::size_t i = 0; i < changed.interfaces.size(); ++i)
    if (is_part(i)) changed.interfaces[i].clear();
  const internal::BodyOrder order(simulation_);
  for (int body : c.bodies) {
    if (body < 0 || body >= order.size() || order.InScene(body) < 0)
      return Refusal{fmt::format("there is no body {}", body)};
    const SceneBody& b = simulation_.bodies()[static_cast<std::size_t>(order.InScene(body))];
    if (b.mechanism != c.index) return Refusal{fmt::format("body '{}' is no part of that mechanism", b.name)};
    if (b.given < 0) continue;  // held, and one in any case as long as it is
    if (b.index == simulation_.place(b.given).first_body)
      return Refusal{fmt::format("body '{}' is the base, which always may touch the world", b.name)};
    auto& names = changed.interfaces[static_cast<std::size_t>(b.given)];
    if (std::find(names.begin(), names.end(), b.name) == names.end()) names.push_back(b.name);
  }
  for (std::size_t i = 0; i < changed.interfaces.size(); ++i)
    if (is_part(i) && changed.interfaces[i].empty())
      return Refusal{"a mechanism needs at least one interface body"};
  const KeyframeDef now = PresentState();
  return OrSay(Rebuild(changed, &now));
}

bool LiveSimulation::StepOnce() {
  FollowTable(time_offset_ + static_cast<double>(simulation_.steps() + 1) * simulation_.dt());
  ApplyTargets();
  ApplyPulls();
  BeginError();
  const StepReport report = simulation_.Step();
  EndError(report);
  scalars_.penetration = report.max_penetration;
  scalars_.residual = report.solver.residual;
  scalars_.refreshes += report.refreshes;
  if (report.finite) {
    ShowPull();
    StepGhost();
    return true;
  }
  paused_ = true;
  pull_.reset();
  pushes_.clear();
  const std::string unsolved = simulation_.world().NameOf(report.halving_of);
  if (!report.stages_converged && !unsolved.empty())
    faults_.push_back(
        {"run", fmt::format("step {} was undone: {} could not be solved even in parts of 1/64 of the step; "
                            "the simulation paused. Pull more softly, or take a smaller dt or softer gains",
                            simulation_.steps(), unsolved)});
  else
    faults_.push_back(
        {"run", fmt::format("step {} gave numbers that are not finite; the state before it was kept and the "
                            "simulation paused. Take a smaller dt or reset",
                            simulation_.steps())});
  return false;
}

void LiveSimulation::Advance(double wall_budget) {
  if (paused_ && !step_requested_) {
    if (!pull_) shown_.clear();
    advanced_at_ = 0;
    return;
  }
  const double start = Now();
  const double since = advanced_at_ > 0 ? start - advanced_at_ : kFrame;
  advanced_at_ = start;
  const double h = simulation_.dt();
  const double wanted = kFrame * settings_.speed;
  carry_ += wanted;
  int steps = static_cast<int>(std::floor(carry_ / h + 1e-9)), done = 0;
  if (step_requested_) steps = std::max(steps, 1);
  step_requested_ = false;
  for (; done < steps; ++done) {
    if (done > 0 && Now() - start > wall_budget) break;
    if (!StepOnce()) break;
  }
  // What could not be computed in time is dropped: the motion becomes slower, never jerky.
  carry_ = done == steps ? std::max(0.0, carry_ - done * h) : 0;
  if (done > 0) scalars_.step_us = 1e6 * (Now() - start) / done;
  // Over some ten frames: what was simulated against what the clock wanted, everything between frames
  // included.
  constexpr double kKept = 0.9;
  simulated_ = kKept * simulated_ + done * h;
  wanted_ = kKept * wanted_ + since * settings_.speed;
  real_time_share_ = std::min(1.0, simulated_ / wanted_);
}

std::vector<LiveFault> LiveSimulation::PopFaults() { return std::exchange(faults_, {}); }

void LiveSimulation::EncodeChangedMaps() {
  const auto& mechanisms = simulation_.world().mechanisms();
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const VectorX& reference = mechanisms[i].model().q_ref;
    VectorX& encoded = encoded_reference_[i];
    if (latest_.maps[i] && encoded.size() == reference.size() && encoded == reference) continue;
    encoded = reference;
    ++latest_.versions[i];
    latest_.maps[i] =
        Share(EncodeMaps(mechanisms[i], latest_.epoch, static_cast<std::uint32_t>(i), latest_.versions[i]));
  }
}

Snapshot LiveSimulation::Capture(int viewers) {
  if (viewers == 0 && (settings_.signals || settings_.error)) {
    settings_.signals = settings_.error = false;  // they cost time
    PublishSettings();
  }
  StoreAccuracy();
  EncodeChangedMaps();
  scalars_.time = time_offset_ + simulation_.time();
  scalars_.steps = steps_before_ + static_cast<double>(simulation_.steps());
  scalars_.real_time_factor = paused_ ? 0 : real_time_share_ * settings_.speed;
  scalars_.kinetic_energy = simulation_.KineticEnergy();
  scalars_.potential_energy = simulation_.PotentialEnergy();
  scalars_.joint_gap = simulation_.JointGap();
  // Every tenth frame: it costs more than a step, and a grasp changes slowly beside frames.
  if (latest_.sequence % 10 == 0) {
    const double factor = ComputeLoadFactor(simulation_).factor;
    scalars_.load_factor = std::isfinite(factor) ? factor : std::nan("");
  }
  scalars_.viewers = viewers;
  ++latest_.sequence;
  signals_.clear();
  if (settings_.signals) internal::MeasureSignals(simulation_, servos_, error_.get(), signals_);
  latest_.frame = Share(EncodeFrame(simulation_, latest_.epoch, latest_.sequence, paused_, scalars_,
                                    latest_.versions, shown_, signals_));
  StoreMoment();
  FindInterpenetrations();
  CaptureGhost(viewers);
  return latest_;
}

}  // namespace fork1s
