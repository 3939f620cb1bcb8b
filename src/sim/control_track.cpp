#include <algorithm>
#include <cmath>
#include <fork1s/sim/simulation.hpp>
#include <functional>
#include <limits>

namespace fork1s {
namespace {

// What the path of a driven body has beside the lines between rows: corners are rounded by parabolas over a
// time w about each row, so that its twist is continuous. Rows 1/30 s apart or less are so the points of a
// quadratic spline.
constexpr double kRounding = 1.0 / 30;  // s, at most

struct ValueAndRate {
  double value = 0, rate = 0;
};

ValueAndRate Rounding(const ControlTrack& track, std::size_t column, std::size_t row, double time) {
  const auto& t = track.times;
  constexpr double kForEver = std::numeric_limits<double>::infinity();
  // What is held before the first row and after the last one; nothing is known of before the start.
  const double before = row > 0 ? t[row] - t[row - 1] : t[row],
               after = row + 1 < t.size() ? t[row + 1] - t[row] : kForEver;
  const double w = std::min({before, after, kRounding}), left = 0.5 * w - std::abs(time - t[row]);
  if (!(w > 0 && left > 0)) return {};
  const auto value = [&](std::size_t at) { return track.rows[at][column]; };
  const double slope_before = row > 0 ? (value(row) - value(row - 1)) / before : 0,
               slope_after = row + 1 < t.size() ? (value(row + 1) - value(row)) / after : 0;
  const double bend = (slope_after - slope_before) / w;
  return {0.5 * bend * left * left, time < t[row] ? bend * left : -bend * left};
}

}  // namespace

std::vector<std::string> ControlTrack::FindMissing(const Simulation& simulation) const {
  std::vector<std::string> missing;
  for (const std::string& name : names)
    if (simulation.FindControl(name) < 0) missing.push_back(name);
  return missing;
}

void ControlTrack::Start(Simulation& simulation) const {
  FORK1S_REQUIRE(std::is_sorted(times.begin(), times.end(), std::less_equal<>()),
                 "times that do not increase");
  Apply(0, simulation);
  simulation.StartFromControls();
}

void ControlTrack::Apply(double time, Simulation& simulation) const {
  FORK1S_REQUIRE(times.size() == rows.size(), times.size(), "times and", rows.size(),
                 "rows; give a row for each time");
  FORK1S_REQUIRE(std::isfinite(time), "at", time, "s; give a finite time");
  if (times.empty()) return;
  const auto after =
      static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin());
  for (std::size_t row = after > 0 ? after - 1 : 0; row < std::min(after + 1, rows.size()); ++row)
    FORK1S_REQUIRE(rows[row].size() == names.size(), "row", row, "has", rows[row].size(), "values for",
                   names.size(), "names; give a value for each");
  for (std::size_t i = 0; i < names.size(); ++i) {
    const int control = simulation.FindControl(names[i]);
    if (control < 0) continue;
    double value, rate = 0;
    if (after == 0) {
      value = rows.front()[i];
    } else if (after == times.size()) {
      value = rows.back()[i];
    } else {
      const double share = (time - times[after - 1]) / (times[after] - times[after - 1]);
      value = rows[after - 1][i] + share * (rows[after][i] - rows[after - 1][i]);
      rate = (rows[after][i] - rows[after - 1][i]) / (times[after] - times[after - 1]);
    }
    if (!simulation.DrivesBase(control)) {
      simulation.SetControl(control, value);
      continue;
    }
    const auto round = [&](std::size_t row) {
      const ValueAndRate more = Rounding(*this, i, row, time);
      value += more.value;
      rate += more.rate;
    };
    if (after > 0) round(after - 1);
    if (after < times.size()) round(after);
    simulation.SetControl(control, value);
    simulation.SetBaseRate(control, rate);
  }
}

}  // namespace fork1s
