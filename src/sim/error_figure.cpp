#include "sim/error_figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace fork1s::internal {

Vector3 WayBeyondRounding(const Vector3& from, const Vector3& to) {
  constexpr double kDigits = 1e-13;  // that positions are known by
  const Vector3 way = to - from;
  return way.norm() > kDigits * (from.norm() + to.norm()) ? way : Vector3::Zero();
}

void ErrorFigure::BeginStep(const Simulation& simulation) {
  if (estimate_ || !values_.refused.empty()) return;
  auto made = ErrorEstimate::Create(simulation);
  if (made)
    estimate_.emplace(std::move(*made));
  else
    values_.refused = made.error().Text();
}

void ErrorFigure::EndStep(const Simulation& simulation, const StepReport& report) {
  if (!estimate_) return;
  estimate_->Follow(simulation, report);
  UpdateLargest();
}

void ErrorFigure::UpdateLargest() {
  std::vector<Body>& bodies = values_.bodies;
  std::vector<bool> updated(bodies.size(), false);  // those not followed any more keep their last error
  for (const BodyError& now : estimate_->bodies()) {
    auto at = std::find_if(bodies.begin(), bodies.end(), [&](const Body& b) { return b.name == now.body; });
    if (at == bodies.end()) {
      bodies.emplace_back();
      updated.push_back(false);
      at = bodies.end() - 1;
      at->name = now.body;
    }
    const auto place = static_cast<std::size_t>(at - bodies.begin());
    at->last = updated[place] ? std::max(at->last, now.shown) : now.shown;
    at->angle_last = updated[place] ? std::max(at->angle_last, now.shown_angle) : now.shown_angle;
    at->angle = std::max(at->angle, now.shown_angle);
    updated[place] = true;
    at->motion = std::max(at->motion, now.motion);
    at->total = std::max(at->total, now.shown);
    at->interior = std::max(at->interior, now.shown_interior);
    at->time = std::max(at->time, now.shown_time);
    values_.failed |= !std::isfinite(now.shown);
  }
}

void ErrorFigure::Restart(const std::string& where) {
  if (estimate_) values_.began_anew.insert(where);
  estimate_.reset();
}

void ErrorFigure::Reset(const std::string& where) {
  values_ = {};
  values_.began_anew.insert(where);
  estimate_.reset();
}

ErrorFigure::Largest ErrorFigure::largest() const {
  Largest out;
  out.finite = !values_.failed && values_.refused.empty();
  for (const Body& b : values_.bodies) {
    out.motion = std::max(out.motion, b.motion);
    out.total = std::max(out.total, b.total);
    out.interior = std::max(out.interior, b.interior);
    out.time = std::max(out.time, b.time);
    out.angle = std::max(out.angle, b.angle);
  }
  return out;
}

std::vector<std::string> ErrorFigure::Warnings() const {
  std::vector<std::string> out;
  const Largest all = largest();
  if (values_.failed)
    out.push_back(
        "no error estimate: a shorter step beside the run could not be solved; try a shorter time step");
  std::string names;
  for (const Body& b : values_.bodies)
    if (all.finite && 100 * b.total > kMaxPercent * all.motion)
      names += (names.empty() ? "'" : ", '") + b.name + "'";
  if (!names.empty())
    out.push_back(fmt::format(
        "estimated error above {:.0f} % of the motion, past what the estimate can tell, of {}: try "
        "a shorter time step or more modes",
        kMaxPercent, names));
  if (!values_.refused.empty()) out.push_back("no error estimate: " + values_.refused);
  for (const std::string& where : values_.began_anew)
    out.push_back("the error estimate began again " + where);
  return out;
}

ErrorFigure::Snapshot ErrorFigure::Save() const {
  Snapshot snapshot{values_, nullptr};
  if (estimate_) snapshot.estimate = estimate_->Save();
  return snapshot;
}

void ErrorFigure::Restore(const Simulation& simulation, const Snapshot& snapshot) {
  values_ = snapshot.values;
  if (!snapshot.estimate) return estimate_.reset();
  if (estimate_ && estimate_->Restore(*snapshot.estimate)) return;
  // Of a simulation that has not been stepped, or of other detail.
  estimate_.reset();
  BeginStep(simulation);
  if (!estimate_) return;
  if (auto restored = estimate_->Restore(*snapshot.estimate); !restored)
    Restart("at a moment that was gone back to: " + restored.error().Text());
}

}  // namespace fork1s::internal
