#include <fork1s/sim/error_estimate.hpp>

#include <algorithm>
#include <cmath>
#include <deque>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/world/world_state.hpp>
#include <limits>
#include <optional>

#include "error_figure.hpp"

namespace fork1s {
namespace {

constexpr int kAllModes = 1 << 20;
// Of a step. By two a step and its halves err alike where fingers close: half of such errors were told less than half
// (docs/accuracy.md, section 5, has the shares by four).
constexpr int kParts = 4;

// A second simulation at the present state.
Expected<Simulation> Copy(const Simulation& from) {
  SimulationOptions options = from.options();
  options.dt = from.dt();
  auto copy = Simulation::Create(from.scene(), options);
  if (!copy) return copy;
  if (auto restored = copy->Restore(from.Save()); !restored) return tl::unexpected(restored.error());
  return copy;
}

bool HasReductionError(const Simulation& simulation) {
  const auto& mechanisms = simulation.world().mechanisms();
  return std::any_of(mechanisms.begin(), mechanisms.end(), [](const MechanismDynamics& m) {
    return m.recovery() != Recovery::kExact || m.model().has_complement;
  });
}

RigidTransform Pose(const World& world, const BodyError& body) {
  const auto index = static_cast<std::size_t>(body.index);
  if (body.mechanism < 0) return world.free_bodies()[index].pose();
  return world.mechanisms()[static_cast<std::size_t>(body.mechanism)].BodyPose(BodyIndex(body.index));
}

// rad, world axes: the rotation vector that turns `from` into `to`.
Vector3 AngleBetween(const RigidTransform& from, const RigidTransform& to) {
  return LogRotation(to.rotation() * from.rotation().transpose());
}

}  // namespace

struct ErrorEstimate::Detail {
  ErrorEstimateOptions options;
  std::optional<Simulation> finer, whole_model;  // by shorter steps; that with all modes too
  struct Seen {
    double total, interior, time, angle;
  };
  struct Values {
    std::vector<BodyError> bodies;
    std::vector<Vector3> start;
    std::vector<std::deque<Seen>> window;
    bool failed = false;
  } values;
};

struct ErrorEstimate::Snapshot {
  Simulation::Snapshot finer;
  std::optional<Simulation::Snapshot> whole_model;
  Detail::Values values;
};

ErrorEstimate::ErrorEstimate(std::unique_ptr<Detail> detail) : detail_(std::move(detail)) {}
ErrorEstimate::~ErrorEstimate() = default;
ErrorEstimate::ErrorEstimate(ErrorEstimate&&) noexcept = default;
ErrorEstimate& ErrorEstimate::operator=(ErrorEstimate&&) noexcept = default;

const std::vector<BodyError>& ErrorEstimate::bodies() const { return detail_->values.bodies; }
bool ErrorEstimate::Failed() const { return detail_->values.failed; }

Expected<ErrorEstimate> ErrorEstimate::Create(const Simulation& simulation,
                                              const ErrorEstimateOptions& options) {
  auto detail = std::make_unique<Detail>();
  Detail& d = *detail;
  d.options = options;
  auto finer = Copy(simulation);
  if (!finer) return tl::unexpected(finer.error());
  d.finer.emplace(std::move(*finer));
  if (HasReductionError(simulation)) {
    auto whole = Copy(simulation);
    if (!whole) return tl::unexpected(whole.error());
    const Fidelity all{simulation.fidelity().level, kAllModes, Recovery::kExact};
    if (auto set = whole->SetFidelity(all, simulation.frozen_grasps()); !set)
      return tl::unexpected(set.error());
    d.whole_model.emplace(std::move(*whole));
  }
  Detail::Values& v = d.values;
  const World& world = simulation.world();
  for (std::size_t i = 0; i < world.mechanisms().size(); ++i) {
    const MechanismDynamics& m = world.mechanisms()[i];
    // The trunk of a walker; a driven base is where it is told to be.
    const auto& interfaces = m.model().interfaces;
    if (m.mechanism().base() == BaseKind::kFloating &&
        std::find(interfaces.begin(), interfaces.end(), BodyIndex(0)) == interfaces.end())
      v.bodies.push_back({m.mechanism().body(BodyIndex(0)).name, static_cast<int>(i), 0});
    for (const BodyIndex b : m.model().interfaces)
      v.bodies.push_back({m.mechanism().body(b).name, static_cast<int>(i), b.value()});
  }
  for (std::size_t i = 0; i < world.free_bodies().size(); ++i)
    v.bodies.push_back({world.free_bodies()[i].name(), -1, static_cast<int>(i)});
  v.window.resize(v.bodies.size());
  for (const BodyError& b : v.bodies) v.start.push_back(Pose(world, b).translation());
  return ErrorEstimate(std::move(detail));
}

std::shared_ptr<const ErrorEstimate::Snapshot> ErrorEstimate::Save() const {
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->finer = detail_->finer->Save();
  if (detail_->whole_model) snapshot->whole_model = detail_->whole_model->Save();
  snapshot->values = detail_->values;
  return snapshot;
}

Expected<void> ErrorEstimate::Restore(const Snapshot& snapshot) {
  Detail& d = *detail_;
  if (d.whole_model.has_value() != snapshot.whole_model.has_value())
    return Fail(ErrorCode::kUsage, "error estimate",
                "the moment is of a simulation that left something else out; make an estimate of that one");
  const Simulation::Snapshot before = d.finer->Save();
  if (auto restored = d.finer->Restore(snapshot.finer); !restored) return restored;
  if (d.whole_model)
    if (auto restored = d.whole_model->Restore(*snapshot.whole_model); !restored) {
      // What it was a moment ago it can be.
      FORK1S_REQUIRE(d.finer->Restore(before).has_value());
      return restored;
    }
  d.values = snapshot.values;
  return {};
}

void ErrorEstimate::Follow(const Simulation& simulation, const StepReport& report) {
  Detail& d = *detail_;
  Detail::Values& v = d.values;
  if (!report.finite) return;
  const WorldState& began = simulation.world().StartOfLastStep();
  const StepOptions& options = simulation.step_options();
  for (auto* other : {&d.finer, &d.whole_model})
    if (*other && !v.failed) v.failed = !(*other)->world().StepInParts(began, options, kParts).finite;
  // What a step of order p errs by is n^p/(n^p - 1) of what steps of 1/n of it change.
  const double power = options.integrator == Integrator::kEuler ? kParts : kParts * kParts;
  const double whole = power / (power - 1);
  const auto length = static_cast<std::size_t>(std::max(1.0, std::round(d.options.window / simulation.dt())));
  for (std::size_t i = 0; i < v.bodies.size(); ++i) {
    BodyError& b = v.bodies[i];
    const RigidTransform pose = Pose(simulation.world(), b);
    b.motion = std::max(b.motion, internal::WayBeyondRounding(v.start[i], pose.translation()).norm());
    if (v.failed) {
      b.shown = b.shown_interior = b.shown_time = b.shown_angle = std::numeric_limits<double>::infinity();
      continue;
    }
    const RigidTransform finer = Pose(d.finer->world(), b);
    b.time = whole * internal::WayBeyondRounding(pose.translation(), finer.translation());
    b.time_angle = whole * AngleBetween(pose, finer);
    if (d.whole_model) {
      const RigidTransform whole_model = Pose(d.whole_model->world(), b);
      b.interior = internal::WayBeyondRounding(finer.translation(), whole_model.translation());
      b.interior_angle = AngleBetween(finer, whole_model);
    }
    auto& window = v.window[i];
    window.push_back({(b.interior + b.time).norm(), b.interior.norm(), b.time.norm(),
                      (b.interior_angle + b.time_angle).norm()});
    if (window.size() > length) window.pop_front();
    b.shown = b.shown_interior = b.shown_time = b.shown_angle = 0;
    for (const Detail::Seen& s : window) {
      b.shown = std::max(b.shown, s.total);
      b.shown_interior = std::max(b.shown_interior, s.interior);
      b.shown_time = std::max(b.shown_time, s.time);
      b.shown_angle = std::max(b.shown_angle, s.angle);
    }
  }
}

}  // namespace fork1s
