// Which dt, integrator, modes and refresh angle a wanted accuracy asks for (`run --accuracy`).
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/world/world.hpp>
#include <functional>
#include <vector>

#include "sim/error_figure.hpp"

namespace fork1s {

/// Trials after which no further setting is tried. A run by half the step of the last one may follow.
inline constexpr std::size_t kMaxAccuracyTrials = 10;
/// Of the first dt: a step is not halved below this because its estimate is too large. Six halvings reduce an error of
/// first order 64 times; one that stays needs another model. Where estimates are within what is wanted and only the runs
/// by half the step disagree, halving goes on up to kMaxAccuracyTrials.
inline constexpr double kMinStepShare = 1.0 / 64;
/// Bounds of an observed order: of smooth motion it is 2, of impacts 1; what diverges exponentially has none, and the
/// extrapolation by 1/(1 - 2^-order) has no bound without the lower one.
inline constexpr double kMinErrorOrder = 0.5, kMaxErrorOrder = 2;

/// What may be chosen.
struct AccuracySetting {
  double dt = 0;  // s
  Integrator integrator = Integrator::kEuler;
  int modes = -1;            // fixed-interface modes at most; -1: the file's
  double refresh_angle = 0;  // rad
};

/// A run with one setting.
struct AccuracyTrial {
  AccuracySetting setting;
  internal::ErrorFigure::Largest error;
  int modes_kept = 0;             // the most of any mechanism
  bool leaves_something = false;  // more modes would change something
  bool exact = true;              // recovery
  bool finite = true;
  /// m, of all bodies, at the whole steps of the first setting.
  std::vector<Vector3> positions;
  /// m, the largest distance between these positions and those by half the step, where that was asked, and the order by
  /// which its part of the time step fell there, within kMinErrorOrder and kMaxErrorOrder.
  double apart = 0, order = 2;
  double wall = 0;     // s
  double off() const;  // m, the estimate with its part of the time step by that order
};

struct WantedAccuracy {
  double metres = 0;  // 0: not asked in metres
  double share = 0;   // of the motion
  bool Met(const AccuracyTrial& t) const {
    return t.finite && t.off() <= (metres > 0 ? metres : share * t.error.motion);
  }
};

struct AccuracyChoice {
  std::vector<AccuracyTrial> trials;
  std::size_t chosen = 0;  // of trials: the first that is good enough, else the best
  enum class End { kMet, kTrials, kSmallestStep };
  End end = End::kMet;  // what ended the search: a good one, kMaxAccuracyTrials, or kMinStepShare
  bool met() const { return end == End::kMet; }
};
/// Tries settings, from `first` on, each time changing what the largest part of the estimated error asks for. A setting
/// is met where its estimate is within what is wanted and a run by half its step stays as near: where contacts, stops
/// or ropes are met at other times, or motions part, an estimate by one run says little.
/// `may_change_integrator`: the second-order step may take the place of implicit Euler.
Expected<AccuracyChoice> ChooseForAccuracy(
    const WantedAccuracy& wanted, const AccuracySetting& first, bool may_change_integrator,
    const std::function<Expected<AccuracyTrial>(const AccuracySetting&)>& try_out);

}  // namespace fork1s
