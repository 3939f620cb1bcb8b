#include "error_watch.hpp"
#include "print.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fork1s::app {
namespace {

// Errors that are small beside the motion shrink by the order of the step; larger ones need not.
constexpr double kOutside = 10;  // percent of the motion

}  // namespace

void ErrorWatch::Begin(const Simulation& simulation) {
  if (estimate_ || !refused_.empty()) return;
  auto made = ErrorEstimate::Create(simulation);
  if (made)
    estimate_.emplace(std::move(*made));
  else
    refused_ = made.error().Text();
}

void ErrorWatch::End(const Simulation& simulation, const StepReport& report) {
  if (!estimate_) return;
  estimate_->Follow(simulation, report);
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
    at->time = std::max(at->time, now.shown_time);
    failed_ |= !std::isfinite(now.shown);
  }
}

void ErrorWatch::Forget() {
  forgot_ |= estimate_.has_value();
  estimate_.reset();
}

ErrorWatch::Largest ErrorWatch::largest() const {
  Largest out;
  out.finite = !failed_ && refused_.empty();
  for (const Body& b : bodies_) {
    out.motion = std::max(out.motion, b.motion);
    out.total = std::max(out.total, b.total);
    out.interior = std::max(out.interior, b.interior);
    out.time = std::max(out.time, b.time);
  }
  return out;
}

void ErrorWatch::AddTo(Json& summary) const {
  const Largest all = largest();
  Json by_body = Json::object();
  for (const Body& b : bodies_)
    by_body[b.name] = {{"max", 1e3 * b.total},
                       {"last", 1e3 * b.last},
                       {"interior_max", 1e3 * b.interior},
                       {"time_step_max", 1e3 * b.time},
                       {"motion", 1e3 * b.motion}};
  auto percent = [&](double x) {
    return all.motion > 0 && all.finite ? Json(100 * x / all.motion) : Json(nullptr);
  };
  summary["error_estimate_mm"] = std::move(by_body);
  summary["error_estimate_percent"] = {
      {"total", percent(all.total)},
      {"interior", percent(all.interior)},
      {"time_step", percent(all.time)},
      {"of_mm", 1e3 * all.motion},
      {"within_range", all.finite && 100 * all.total <= kOutside * all.motion}};
}

std::vector<std::string> ErrorWatch::Warnings() const {
  std::vector<std::string> out;
  const Largest all = largest();
  std::string names;
  for (const Body& b : bodies_)
    if (!all.finite || 100 * b.total > kOutside * all.motion)
      names += (names.empty() ? "'" : ", '") + b.name + "'";
  if (!names.empty())
    out.push_back(fmt::format(
        "estimated error above {:.0f} % of the motion, past what the estimate can tell, of {}: try "
        "a smaller --dt or more --modes",
        kOutside, names));
  if (!refused_.empty()) out.push_back("no error estimate: " + refused_);
  if (forgot_) out.push_back("the error estimate began anew where the detail changed");
  return out;
}

void PrintErrorEstimate(const Json& d) {
  const Json& percent = d["error_estimate_percent"];
  if (percent["total"].is_null()) {
    PrintText("  error           not estimated: nothing moved\n");
    return;
  }
  const bool inside = percent["within_range"].get<bool>();
  auto share = [&](const char* key) { return percent[key].get<double>(); };
  PrintText("  error           about {}, of {:.4g} mm of motion\n",
            inside ? fmt::format("{:.2g} %", share("total")) : fmt::format("> {:.0f} %", kOutside),
            percent["of_mm"].get<double>());
  PrintText("                  time step {:.2g} %, interior left out {:.2g} %\n", share("time_step"),
            share("interior"));
  for (const auto& [body, e] : d["error_estimate_mm"].items())
    PrintText("    {:<20} {:.3g} mm at most, {:.3g} mm at the end\n", body, e["max"].get<double>(),
              e["last"].get<double>());
}

}  // namespace fork1s::app
