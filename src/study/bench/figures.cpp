// The plots of a benchmark.
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "../figure.hpp"
#include "page.hpp"

namespace fork1s::internal {
namespace {

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  void Include(double v) {
    if (!std::isfinite(v) || v <= 0) return;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  bool empty() const { return !(high > 0); }
};

}  // namespace

std::string DrawPrecision(const BenchResults& results) {
  Range cost, error;
  std::vector<std::string> simulators;  // a style each, the same in every panel
  Figure f;
  f.title = "Work against precision, at steps of dt, dt/2, ...";
  f.x_label = "ms a simulated second";
  f.y_label = "error, % of the motion";
  for (const BenchScene& scene : results.scenes) {
    FigurePanel panel;
    panel.title = scene.name;
    panel.note = fmt::format("truth to {:.1g} %", scene.TruthErrorPercent());
    for (const PeerRow& row : scene.rows) {
      if (!row.survived || row.simulator.starts_with("full") || !(row.error_percent > 0)) continue;
      auto known = std::find(simulators.begin(), simulators.end(), row.simulator);
      if (known == simulators.end()) known = simulators.insert(known, row.simulator);
      auto series = std::find_if(panel.series.begin(), panel.series.end(),
                                 [&](const FigureSeries& s) { return s.label == row.simulator; });
      if (series == panel.series.end())
        series =
            panel.series.insert(series, {row.simulator, static_cast<int>(known - simulators.begin()), {}});
      const double ms = 1e-3 * row.step_us / row.dt_s;
      cost.Include(ms);
      error.Include(row.error_percent);
      series->points.emplace_back(ms, row.error_percent);
    }
    if (!panel.series.empty()) f.panels.push_back(std::move(panel));
  }
  if (cost.empty() || error.empty()) return "";
  f.x_ticks = DecadeTicks(cost.low, cost.high);
  // What is off by ten times its way, or moves by itself where all should rest, need not be told apart.
  constexpr double kLost = 3;
  f.low_decade = static_cast<int>(std::floor(std::log10(error.low)));
  f.high_decade =
      std::max<int>(f.low_decade + 1, static_cast<int>(std::min(kLost, std::ceil(std::log10(error.high)))));
  return DrawFigure(f);
}

std::string DrawStability(const BenchResults& results) {
  if (results.stability.empty()) return "";
  Figure f;
  f.title = "Largest stable step, of 1/60 s and its halves, against stiffness";
  f.x_label = "stiffness, times that of the file";
  f.y_label = "largest stable step, s";
  f.x_ticks = DecadeTicks(1, 1000);
  f.low_decade = -5;
  f.high_decade = -1;
  for (const BenchStability& s : results.stability) {
    FigurePanel panel{s.scene, "", {}};
    for (const StabilityRow& row : s.rows) {
      auto series = std::find_if(panel.series.begin(), panel.series.end(),
                                 [&](const FigureSeries& x) { return x.label == row.simulator; });
      if (series == panel.series.end())
        series = panel.series.insert(series, {row.simulator, static_cast<int>(panel.series.size()), {}});
      if (row.largest_stable_dt_s > 0)
        series->points.emplace_back(row.stiffness_scale, row.largest_stable_dt_s);
    }
    f.panels.push_back(std::move(panel));
  }
  return DrawFigure(f);
}

}  // namespace fork1s::internal
