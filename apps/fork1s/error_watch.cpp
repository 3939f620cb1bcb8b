#include "error_watch.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fork1s::app {
namespace {

// What is linear about the estimate holds for errors that are small beside the motion.
constexpr double kOutside = 10;  // percent of the motion

}  // namespace

void ErrorWatch::Begin(const Simulation& simulation) {
  if (!estimate_) estimate_.emplace(simulation.world());
  estimate_->Begin(simulation.world());
}

void ErrorWatch::End(const Simulation& simulation, const StepReport& report) {
  estimate_->End(simulation.world(), simulation.step_options(), report);
  Keep();
}

void ErrorWatch::Keep() {
  for (const BodyError& now : estimate_->bodies()) {
    auto at = std::find_if(bodies_.begin(), bodies_.end(), [&](const Body& b) { return b.name == now.body; });
    if (at == bodies_.end()) {
      bodies_.emplace_back();
      at = bodies_.end() - 1;
      at->name = now.body;
      at->is_interface = now.mechanism >= 0;
    }
    at->last = now.shown;
    at->motion = std::max(at->motion, now.motion);
    at->total = std::max(at->total, now.shown);
    at->interior = std::max(at->interior, now.shown_interior);
    at->nonlinear = std::max(at->nonlinear, now.shown_nonlinear);
    at->time = std::max(at->time, now.shown_time);
    failed_ |= !std::isfinite(now.shown);
  }
}

void ErrorWatch::Forget() {
  forgot_ |= estimate_.has_value();
  estimate_.reset();
}

void ErrorWatch::AddTo(Json& summary) const {
  Json by_body = Json::object();
  double motion = 0, total = 0, interior = 0, nonlinear = 0, time = 0;
  for (const Body& b : bodies_) {
    motion = std::max(motion, b.motion);
    total = std::max(total, b.total);
    interior = std::max(interior, b.interior);
    nonlinear = std::max(nonlinear, b.nonlinear);
    time = std::max(time, b.time);
    by_body[b.name] = {{"max", 1e3 * b.total},
                       {"last", 1e3 * b.last},
                       {"interior_max", 1e3 * b.interior},
                       {"nonlinear_max", 1e3 * b.nonlinear},
                       {"time_step_max", 1e3 * b.time},
                       {"motion", 1e3 * b.motion}};
  }
  auto percent = [&](double x) { return motion > 0 && !failed_ ? Json(100 * x / motion) : Json(nullptr); };
  summary["error_estimate_mm"] = std::move(by_body);
  summary["error_estimate_percent"] = {
      {"total", percent(total)},         {"interior", percent(interior)},
      {"nonlinear", percent(nonlinear)}, {"time_step", percent(time)},
      {"of_mm", 1e3 * motion},           {"within_range", !failed_ && 100 * total <= kOutside * motion}};
}

std::vector<std::string> ErrorWatch::Warnings() const {
  std::vector<std::string> out;
  double motion = 0;
  for (const Body& b : bodies_) motion = std::max(motion, b.motion);
  for (const Body& b : bodies_)
    if (failed_ || 100 * b.total > kOutside * motion)
      out.push_back(fmt::format(
          "the estimated error of '{}' is more than {:.0f} % of the motion, past what the estimate "
          "can tell: take a smaller --dt, --integrator theta or more --modes",
          b.name, kOutside));
  if (forgot_) out.push_back("the error estimate began anew where the detail changed");
  return out;
}

void PrintErrorEstimate(const Json& d) {
  const Json& percent = d["error_estimate_percent"];
  if (percent["total"].is_null()) {
    fmt::print("  error           not estimated: nothing moved\n");
    return;
  }
  const bool inside = percent["within_range"].get<bool>();
  auto share = [&](const char* key) { return percent[key].get<double>(); };
  fmt::print("  error           about {}, of {:.4g} mm of motion\n",
             inside ? fmt::format("{:.2g} %", share("total")) : fmt::format("> {:.0f} %", kOutside),
             percent["of_mm"].get<double>());
  fmt::print("                  time step {:.2g} %, interior left out {:.2g} %, nonlinear {:.2g} %\n",
             share("time_step"), share("interior"), share("nonlinear"));
  for (const auto& [body, e] : d["error_estimate_mm"].items())
    fmt::print("    {:<20} {:.3g} mm at most, {:.3g} mm at the end\n", body, e["max"].get<double>(),
               e["last"].get<double>());
}

}  // namespace fork1s::app
