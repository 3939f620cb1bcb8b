// How true a live simulation is: the estimated error, what it asks for, and bodies that pass through others.
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "body_order.hpp"
#include "scene_description.hpp"
#include "server/live_simulation.hpp"
#include "sim/interpenetration.hpp"

namespace fork1s {
namespace {

using Json = nlohmann::json;

constexpr std::uint32_t kLookEvery = 15;    // frames between two looks for bodies that pass through others
constexpr std::size_t kMostWatched = 300;   // bodies: their pairs are listed one by one
constexpr std::uint32_t kChooseEvery = 30;  // frames that a choice is given before the next
constexpr double kShortestStep = 1.0 / 64;  // of the first dt

}  // namespace

void LiveSimulation::ClearError() {
  error_.reset();
  scalars_.error = std::nan("");
}

void LiveSimulation::BeginError() {
  if (!settings_.error) return ClearError();
  if (error_) return;
  auto made = ErrorEstimate::Create(simulation_);
  if (made) {
    error_ = std::make_unique<ErrorEstimate>(std::move(*made));
    return;
  }
  settings_.error = false;
  replies_.push_back(
      {0, internal::Dump({{"type", "notice"}, {"message", "no error estimate: " + made.error().Text()}})});
  PublishSettings();
}

void LiveSimulation::EndError(const StepReport& report) {
  if (!error_) return;
  error_->Follow(simulation_, report);
  scalars_.error = 0;
  for (const BodyError& e : error_->bodies()) scalars_.error = std::max(scalars_.error, e.shown);
}

// As `run --accuracy` does: what the largest part of the error asks for.
void LiveSimulation::StoreAccuracy() {
  if (!(settings_.accuracy > 0) || !error_ || latest_.sequence < chosen_at_ + kChooseEvery) return;
  if (scalars_.error <= settings_.accuracy) return;
  chosen_at_ = latest_.sequence;
  double interior = 0, rest = 0;
  for (const BodyError& e : error_->bodies()) {
    interior = std::max(interior, e.shown_interior);
    rest = std::max(rest, e.shown_time);
  }
  int kept = 0;
  bool leaves_something = false;
  for (const MechanismDynamics& m : simulation_.world().mechanisms()) {
    kept = std::max(kept, m.model().num_modes);
    leaves_something |= m.model().has_complement;
  }
  LiveSettings changed = settings_;
  std::string what;
  Expected<void> done;
  if (interior > rest && leaves_something && kept < 64) {
    changed.modes = std::min(64, std::max(4, 2 * kept));
    what = fmt::format("{} modes", changed.modes);
    done = ChangeFidelity(changed);
  } else if (settings_.dt / 2 >= kShortestStep * first_dt_) {
    changed.dt = settings_.dt / 2;
    what = fmt::format("dt 1/{:.4g} s", 1 / changed.dt);
    const KeyframeDef now = PresentState();
    done = Rebuild(changed, &now);
  } else {
    settings_.accuracy = 0;
    what = "it cannot be met by smaller steps or more modes: dt and modes stay";
  }
  if (!done) what = done.error().Text();
  replies_.push_back(
      {0, internal::Dump({{"type", "notice"},
                          {"message", fmt::format("for {:.3g} mm: {}", 1e3 * changed.accuracy, what)}})});
  PublishSettings();
}

// Only interface bodies touch; what they alone make the user believe is said, with what helps.
void LiveSimulation::FindInterpenetrations() {
  if (latest_.sequence % kLookEvery != 0 || paused_ || !simulation_.frozen_grasps().empty() ||
      simulation_.bodies().size() > kMostWatched)
    return;
  if (!interpenetration_) {
    auto watch = InterpenetrationMonitor::Create(simulation_);
    if (!watch) return;
    interpenetration_ = std::make_shared<InterpenetrationMonitor>(std::move(*watch));
    advised_.clear();
  }
  interpenetration_->Update(simulation_);
  const internal::BodyOrder order(simulation_);
  Json items = Json::array();
  std::string now;
  for (const Interpenetration& p : interpenetration_->Found()) {
    const int body = simulation_.FindBody(p.body);
    if (body < 0 || items.size() >= 4) continue;
    now += p.body + '/' + p.other + ' ';
    items.push_back({{"body", order.OnWire(body)},
                     {"name", p.body},
                     {"other", p.other},
                     {"depth", p.depth},
                     {"time", time_offset_ + p.first}});
  }
  if (now == advised_) return;
  advised_ = now;
  replies_.push_back({0, internal::Dump({{"type", "advice"}, {"epoch", latest_.epoch}, {"items", items}})});
}

}  // namespace fork1s
