#include "study/accuracy_choice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace fork1s {
namespace {

// Changes what the largest part of the error asks for. Returns false if nothing is left to try.
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
  if (next.dt / 2 < kMinStepShare * first_dt) return false;
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
    trial.apart =
        std::max(trial.apart, internal::WayBeyondRounding(half.positions[i], trial.positions[i]).norm());
  const double fell = trial.error.time / half.error.time;
  trial.order = fell > 1 ? std::clamp(std::log2(fell), kMinErrorOrder, kMaxErrorOrder)
                         : (half.error.time > 0 ? kMinErrorOrder : kMaxErrorOrder);
}

std::size_t Best(const std::vector<AccuracyTrial>& trials) {
  const auto worse = [](const AccuracyTrial& a, const AccuracyTrial& b) {
    return a.finite != b.finite ? a.finite : a.off() < b.off();
  };
  return static_cast<std::size_t>(std::min_element(trials.begin(), trials.end(), worse) - trials.begin());
}

}  // namespace

// The estimate of the time step is extrapolated from a quarter of it by the order of the integrator. With the observed
// order p it is t = time (1 - 4^-s)/(1 - 4^-p), s the integrator's, and by the run by half the step apart/(1 - 2^-p).
// What the interior leaves out does not depend on the step and is not extrapolated.
double AccuracyTrial::off() const {
  const auto share_seen = [](double ratio, double p) { return 1 - std::pow(ratio, -p); };
  const double of_smooth = setting.integrator == Integrator::kEuler ? 1 : 2, p = std::min(order, of_smooth);
  const double of_step =
      std::max(error.time * share_seen(4, of_smooth) / share_seen(4, p), apart / share_seen(2, p));
  return error.total + std::max(0.0, of_step - error.time);
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
        return choice;
      }
    }
    choice.chosen = Best(choice.trials);
    const bool awaits_half = wanted.Met(choice.trials[now]);  // whether half the step bears it out
    if (choice.trials.size() >= kMaxAccuracyTrials + (awaits_half ? 1 : 0)) {
      choice.end = AccuracyChoice::End::kTrials;
      return choice;
    }
    if (awaits_half) {
      next = choice.trials[now].setting;
      next.dt /= 2;
    } else if (!Improve(choice.trials[now], first.dt, may_change_integrator, next)) {
      choice.end = AccuracyChoice::End::kSmallestStep;
      return choice;
    }
  }
}

}  // namespace fork1s
