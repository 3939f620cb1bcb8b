#include "accuracy_output.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "checks.hpp"
#include "print.hpp"

namespace fork1s::app {
namespace {

constexpr double kDegreesARadian = 180 / std::numbers::pi;

}  // namespace

Expected<WantedAccuracy> ParseAccuracy(const std::string& text) {
  for (const auto& [unit, scale] : {std::pair<std::string, double>{"mm", 1e-3}, {"m", 1}, {"%", 0.01}}) {
    if (text.size() <= unit.size() || text.substr(text.size() - unit.size()) != unit) continue;
    auto number = ParseNumber(text.substr(0, text.size() - unit.size()), "--accuracy");
    if (!number) return tl::unexpected(number.error());
    if (!(*number > 0)) break;
    WantedAccuracy wanted;
    (unit == "%" ? wanted.share : wanted.metres) = *number * scale;
    return wanted;
  }
  return Fail(ErrorCode::kUsage, "--accuracy", "wants a length or a share of the motion, as in 0.5mm or 1%");
}

Json AccuracyJson(const std::string& asked, const AccuracyChoice& choice) {
  auto setting = [](const AccuracyTrial& t) {
    return Json{{"dt_s", t.setting.dt},
                {"integrator", Name(t.setting.integrator)},
                {"modes", t.modes_kept},
                {"refresh_angle_deg", kDegreesARadian * t.setting.refresh_angle}};
  };
  Json trials = Json::array();
  for (const AccuracyTrial& t : choice.trials) {
    Json one = setting(t);
    one["error_mm"] = t.finite ? Json(1e3 * t.error.total) : Json(nullptr);
    one["error_percent"] =
        t.finite && t.error.motion > 0 ? Json(100 * t.error.total / t.error.motion) : Json(nullptr);
    if (t.apart > 0) {
      one["from_half_the_step_mm"] = std::isfinite(t.apart) ? Json(1e3 * t.apart) : Json(nullptr);
      one["order"] = t.order;
    }
    trials.push_back(std::move(one));
  }
  double wall = 0;
  for (const AccuracyTrial& t : choice.trials) wall += t.wall;
  const char* const kEnds[] = {"met", "trials", "smallest_step"};
  return Json{{"asked", asked},
              {"met", choice.met()},
              {"ended_by", kEnds[static_cast<int>(choice.end)]},
              {"wall_s", wall},
              {"chosen", setting(choice.trials[choice.chosen])},
              {"trials", std::move(trials)}};
}

void PrintAccuracy(const Json& a) {
  for (const Json& t : a["trials"]) {
    const Json apart = t.value("from_half_the_step_mm", Json(nullptr));
    PrintText("  tried           dt 1/{:.4g} s, {}, {} modes, refresh at {:.3g} degrees: {}{}\n",
              1 / t["dt_s"].get<double>(), t["integrator"].get<std::string>(), t["modes"].get<int>(),
              t["refresh_angle_deg"].get<double>(),
              t["error_mm"].is_null()
                  ? std::string("blew up")
                  : fmt::format("{:.3g} mm, {:.2g} %", t["error_mm"].get<double>(),
                                t["error_percent"].is_null() ? 0 : t["error_percent"].get<double>()),
              apart.is_null() ? ""
                              : fmt::format("; {:.3g} mm from half that step, of order {:.2g}",
                                            apart.get<double>(), t["order"].get<double>()));
  }
  const Json& c = a["chosen"];
  const std::string end = a["ended_by"].get<std::string>(),
                    ended = end == "met"      ? "by"
                            : end == "trials" ? fmt::format("not met in {} runs; best is", a["trials"].size())
                                              : fmt::format("not met down to 1/{:.0f} of the step; best is",
                                                            1 / kMinStepShare);
  PrintText(
      "  accuracy        {} {}: dt 1/{:.4g} s, {}, {} modes, refresh at {:.3g} degrees; {} runs, {:.2g} s\n",
      a["asked"].get<std::string>(), ended, 1 / c["dt_s"].get<double>(), c["integrator"].get<std::string>(),
      c["modes"].get<int>(), c["refresh_angle_deg"].get<double>(), a["trials"].size(),
      a["wall_s"].get<double>());
}

}  // namespace fork1s::app
