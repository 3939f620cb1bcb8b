#include "mode_line.hpp"

#include <fmt/format.h>
#include <fork1s/mechanism/names.hpp>
#include <fork1s/reduction/frequencies.hpp>

namespace fork1s::app {

Json ModesJson(const ReducedModel& model) {
  const LeftOutModes left = ComputeLeftOutModes(model);
  Json out;
  out["kept"] = model.num_modes;
  out["below_hz"] = model.mode_selection.below_hz > 0 ? Json(model.mode_selection.below_hz) : Json(nullptr);
  out["choice"] = Name(model.mode_selection.choice);
  out["left_out"] = {{"count", left.count},
                     {"lowest_hz", left.lowest_hz > 0 ? Json(left.lowest_hz) : Json(nullptr)},
                     {"largest_m", left.contribution_m},
                     {"largest_hz", left.largest_hz > 0 ? Json(left.largest_hz) : Json(nullptr)}};
  return out;
}

std::string ModeLine(const Json& modes) {
  const Json& left = modes["left_out"];
  std::string text = fmt::format("modes: {}", modes["kept"].get<int>());
  if (left["count"].get<int>() <= 0) return text + "; no motion left out";
  const bool has_lowest = !left["lowest_hz"].is_null();
  if (const Json& below = modes["below_hz"]; !below.is_null()) {
    const double limit = below.get<double>();
    text += has_lowest && left["lowest_hz"].get<double>() < limit
                ? fmt::format(", those of largest contribution below 1/(6 dt) = {:.3g} Hz", limit)
                : fmt::format(", all below 1/(6 dt) = {:.3g} Hz", limit);
  }
  text += fmt::format("; {} left out", left["count"].get<int>());
  if (has_lowest)
    text += fmt::format(
        ", from {:.3g} Hz on: under a load of the mechanism's weight the interface misses at most {:.3g} mm "
        "({:.3g} Hz)",
        left["lowest_hz"].get<double>(), 1e3 * left["largest_m"].get<double>(),
        left["largest_hz"].get<double>());
  return text;
}

}  // namespace fork1s::app
