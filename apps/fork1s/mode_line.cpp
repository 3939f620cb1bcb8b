#include "mode_line.hpp"
#include "mechanism/names.hpp"

#include <fmt/format.h>
#include <fork1s/reduction/frequencies.hpp>

namespace fork1s::app {

Json ModesJson(const ReducedModel& model) {
  const LeftOutModes left = ComputeLeftOutModes(model);
  Json out;
  out["kept"] = model.num_modes;
  out["free"] = model.num_free;
  out["elastic"] = model.num_elastic;
  out["load_columns"] = model.num_loads;
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
  std::string text;
  const auto add = [&](const char* key, const char* name) {
    if (const int count = modes[key].get<int>(); count > 0) text += fmt::format("{} {}, ", count, name);
  };
  add("free", "free");
  add("elastic", "elastic");
  text += fmt::format("{} modes", modes["kept"].get<int>());
  if (left["count"].get<int>() <= 0) return "coordinates: " + text + "; no motion left out";
  const bool has_lowest = !left["lowest_hz"].is_null();
  if (const Json& below = modes["below_hz"]; !below.is_null()) {
    const double limit = below.get<double>();
    text += has_lowest && left["lowest_hz"].get<double>() < limit
                ? fmt::format(", those of largest contribution below 1/(6 dt) = {:.3g} Hz", limit)
                : fmt::format(", all below 1/(6 dt) = {:.3g} Hz", limit);
  }
  if (const int loads = modes["load_columns"].get<int>(); loads > 0)
    text += fmt::format(", {} load{}", loads, loads == 1 ? "" : "s");
  text += fmt::format("; {} modes left out", left["count"].get<int>());
  if (has_lowest)
    text += fmt::format(
        ", from {:.3g} Hz on: under a load of the mechanism's weight the interface misses at most {:.3g} mm "
        "({:.3g} Hz)",
        left["lowest_hz"].get<double>(), 1e3 * left["largest_m"].get<double>(),
        left["largest_hz"].get<double>());
  return "coordinates: " + text;
}

}  // namespace fork1s::app
