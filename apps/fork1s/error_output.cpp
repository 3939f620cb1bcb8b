#include "error_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "print.hpp"

namespace fork1s::app {

using internal::ErrorFigure;

void AddErrorFigure(const ErrorFigure& figure, Json& summary) {
  const ErrorFigure::Largest all = figure.largest();
  constexpr double kDegreesARadian = 180 / std::numbers::pi;
  Json by_body = Json::object(), angles = Json::object();
  for (const ErrorFigure::Body& b : figure.bodies())
    by_body[b.name] = {{"max", 1e3 * b.total},
                       {"last", 1e3 * b.last},
                       {"interior_max", 1e3 * b.interior},
                       {"time_step_max", 1e3 * b.time},
                       {"motion", 1e3 * b.motion}};
  for (const ErrorFigure::Body& b : figure.bodies())
    angles[b.name] = {{"max", kDegreesARadian * b.angle}, {"last", kDegreesARadian * b.angle_last}};
  auto percent = [&](double x) {
    return all.motion > 0 && all.finite ? Json(100 * x / all.motion) : Json(nullptr);
  };
  summary["error_estimate_mm"] = std::move(by_body);
  summary["error_estimate_deg"] = std::move(angles);
  summary["error_estimate_percent"] = {
      {"total", percent(all.total)},    {"interior", percent(all.interior)},
      {"time_step", percent(all.time)}, {"of_mm", 1e3 * all.motion},
      {"quantified", all.finite},       {"within_range", all.IsWithinRange()}};
}

namespace {

void PrintBodyErrors(const Json& d) {
  for (const auto& [body, e] : d["error_estimate_mm"].items()) {
    const Json& angle = d["error_estimate_deg"][body];
    PrintText("    {:<20} {:.3g} mm at most, {:.3g} mm at the end; {:.3g} degrees at most\n", body,
              e["max"].get<double>(), e["last"].get<double>(), angle["max"].get<double>());
  }
}

}  // namespace

void PrintErrorFigure(const Json& d) {
  const Json& percent = d["error_estimate_percent"];
  if (!percent["quantified"].get<bool>()) {
    PrintText("  error           not quantified: see the warnings\n");
    return;
  }
  if (percent["total"].is_null()) {
    const Json& angles = d["error_estimate_deg"];
    const bool turned = std::any_of(angles.begin(), angles.end(),
                                    [](const Json& angle) { return angle["max"].get<double>() > 0; });
    PrintText("  error           {}\n",
              turned ? "of orientation alone: bodies turned in place" : "not estimated: nothing moved");
    if (turned) PrintBodyErrors(d);
    return;
  }
  const bool inside = percent["within_range"].get<bool>();
  auto share = [&](const char* key) { return percent[key].get<double>(); };
  PrintText(
      "  error           about {}, of {:.4g} mm of motion\n",
      inside ? fmt::format("{:.2g} %", share("total")) : fmt::format("> {:.0f} %", ErrorFigure::kMaxPercent),
      percent["of_mm"].get<double>());
  PrintText("                  time step {:.2g} %, interior left out {:.2g} %\n", share("time_step"),
            share("interior"));
  PrintBodyErrors(d);
}

}  // namespace fork1s::app
