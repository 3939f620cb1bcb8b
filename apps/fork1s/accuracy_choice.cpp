#include "accuracy_choice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "checks.hpp"
#include "print.hpp"

namespace fork1s::app {
namespace {

constexpr std::size_t kMostTrials = 10;
constexpr double kShortest = 1.0 / 64;  // of the first dt: below, another model is what is wanted
constexpr double kLeastOrder = 0.5, kMostOrder = 2;
constexpr double kDegreesARadian = 180 / std::numbers::pi;

// What the largest part asks for; false where nothing is left to try.
bool Improve(const AccuracyTrial& trial, double first_dt, bool may_change_integrator, AccuracySetting& next) {
  next = trial.setting;
  const internal::ErrorFigure::Largest& e = trial.error;
  if (trial.finite && e.interior > e.time && trial.leaves_something) {
    next.modes = std::max(4, 2 * trial.modes_kept);
    return true;
  }
  // Where screws are summed what bends is the distance from the reference, not the step.
  if (!trial.exact && e.interior > e.time && next.refresh_angle > 0.01) {
    next.refresh_angle /= 2;
    return true;
  }
  if (may_change_integrator && trial.exact && next.integrator == Integrator::kEuler) {
    next.integrator = Integrator::kTwoStage;
    return true;
  }
  if (next.dt / 2 < kShortest * first_dt) return false;
  next.dt /= 2;
  return true;
}

// The trial before the last, where that is the same by half the step.
std::optional<std::size_t> WholeStepOf(const std::vector<AccuracyTrial>& trials) {
  if (trials.size() < 2) return std::nullopt;
  const std::size_t before = trials.size() - 2;
  const AccuracySetting &a = trials[before].setting, &b = trials.back().setting;
  const bool same = a.integrator == b.integrator && a.modes == b.modes && a.refresh_angle == b.refresh_angle;
  return same && b.dt == a.dt / 2 ? std::optional(before) : std::nullopt;
}

// Impacts are of first order in time, smooth motion of second, and what parts exponentially of none.
void SetHalfStep(const AccuracyTrial& half, AccuracyTrial& trial) {
  trial.apart = half.finite ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; half.finite && i < std::min(half.positions.size(), trial.positions.size()); ++i)
    trial.apart = std::max(trial.apart, (half.positions[i] - trial.positions[i]).norm());
  const double fell = trial.error.total / half.error.total;
  trial.order = fell > 1 ? std::clamp(std::log2(fell), kLeastOrder, kMostOrder)
                         : (half.error.total > 0 ? kLeastOrder : kMostOrder);
}

std::size_t Best(const std::vector<AccuracyTrial>& trials) {
  const auto worse = [](const AccuracyTrial& a, const AccuracyTrial& b) {
    return a.finite != b.finite ? a.finite : a.off() < b.off();
  };
  return static_cast<std::size_t>(std::min_element(trials.begin(), trials.end(), worse) - trials.begin());
}

}  // namespace

// The estimate is extrapolated from a quarter of the step, by the order of the integrator.
double AccuracyTrial::off() const {
  const auto told_by = [](double ratio, double by_order) { return 1 - std::pow(ratio, -by_order); };
  const double of_smooth = setting.integrator == Integrator::kEuler ? 1 : 2,
               by_order = std::min(order, of_smooth);
  return std::max(error.total * told_by(4, of_smooth) / told_by(4, by_order), apart / told_by(2, by_order));
}

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

Expected<AccuracyChoice> ChooseForAccuracy(
    const WantedAccuracy& wanted, const AccuracySetting& first, bool may_change_integrator,
    const std::function<Expected<AccuracyTrial>(const AccuracySetting&)>& try_out) {
  AccuracyChoice choice;
  AccuracySetting next = first;
  for (;;) {
    auto trial = try_out(next);
    if (!trial) return tl::unexpected(trial.error());
    choice.trials.push_back(std::move(*trial));
    const std::size_t now = choice.trials.size() - 1;
    if (const auto before = WholeStepOf(choice.trials); before && wanted.Met(choice.trials[*before])) {
      SetHalfStep(choice.trials[now], choice.trials[*before]);
      if (wanted.Met(choice.trials[*before])) {
        choice.chosen = *before;
        choice.met = true;
        return choice;
      }
    }
    choice.chosen = Best(choice.trials);
    if (wanted.Met(choice.trials[now])) {  // if half the step bears it out
      if (choice.trials.size() > kMostTrials) return choice;
      next = choice.trials[now].setting;
      next.dt /= 2;
    } else if (choice.trials.size() >= kMostTrials ||
               !Improve(choice.trials[now], first.dt, may_change_integrator, next)) {
      return choice;
    }
  }
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
  return Json{{"asked", asked},
              {"met", choice.met},
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
  PrintText(
      "  accuracy        {} {}: dt 1/{:.4g} s, {}, {} modes, refresh at {:.3g} degrees; {} runs, {:.2g} s\n",
      a["asked"].get<std::string>(), a["met"].get<bool>() ? "by" : "not met; best is",
      1 / c["dt_s"].get<double>(), c["integrator"].get<std::string>(), c["modes"].get<int>(),
      c["refresh_angle_deg"].get<double>(), a["trials"].size(), a["wall_s"].get<double>());
}

}  // namespace fork1s::app
