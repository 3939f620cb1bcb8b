#include "gain.hpp"
#include "print.hpp"

#include <fmt/format.h>

namespace fork1s::app {

Json GainJson(const InterfaceGain& gain) {
  Json out;
  out["coordinates"] = {{"full", gain.coordinates_full}, {"reduced", gain.coordinates}};
  out["bodies"] = {
      {"with_shapes", gain.shaped}, {"interface", gain.touching}, {"without_contact", gain.without_contact}};
  out["fastest_hz"] = gain.fastest_hz > 0 ? Json(gain.fastest_hz) : Json(nullptr);
  out["explicit_step_s"] = gain.explicit_step_s > 0 ? Json(gain.explicit_step_s) : Json(nullptr);
  out["fewer"] = Json::array();
  for (const InterfaceGain::Choice& c : gain.fewer)
    out["fewer"].push_back(
        {{"interfaces", c.interfaces}, {"coordinates", c.coordinates}, {"modes", c.modes}});
  out["must_stay"] = gain.must_stay;
  out["text"] = gain.Sentences();
  return out;
}

Json StepTimesJson(const std::optional<StepTimes>& times) {
  if (!times) return nullptr;
  return {{"interface", times->interface_us}, {"all_bodies", times->all_us}, {"dt_s", times->dt}};
}

void PrintGain(const Json& gain) {
  const Json& lines = gain["text"];
  for (std::size_t i = 0; i < lines.size(); ++i)
    PrintText("  {:<11}{}\n", i == 0 ? "Reduction:" : "", lines[i].get<std::string>());
}

void PrintStepTimes(const Json& times) {
  if (times.is_null()) return;
  const double few = times["interface"].get<double>(), all = times["all_bodies"].get<double>();
  PrintText("a step of {:.4g} s takes {:.3g} us from the start on, {:.3g} us if every body might touch",
            times["dt_s"].get<double>(), few, all);
  if (few > 0 && all > 1.1 * few) PrintText(": {:.1f} times quicker", all / few);
  PrintText("\n");
}

}  // namespace fork1s::app
