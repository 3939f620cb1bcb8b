// The four plots and the four tables of docs/accuracy.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "mechanism/names.hpp"
#include "results.hpp"
#include "study/figure.hpp"

namespace fork1s::internal {
namespace {

const std::vector<std::pair<double, std::string>> kAngleTicks{{0.5, "0.5"}, {1, "1"},   {2, "2"}, {5, "5"},
                                                              {10, "10"},   {20, "20"}, {30, ""}, {45, "45"}};

std::string Statics(const AccuracyResults& r) {
  Figure f{"Static error of the loaded body's position",
           "largest joint rotation, degrees",
           "error, % of the displacement",
           kAngleTicks,
           true,
           -4,
           2,
           1,
           {}};
  for (const StaticCurve& c : r.statics) {
    FigurePanel panel{c.name, "", {}};
    for (std::size_t k = 0; k < c.modes.size(); ++k) {
      FigureSeries s{Name(c.modes[k]), static_cast<int>(c.modes[k]), {}};
      for (const auto& p : c.points) s.points.emplace_back(p.angle_deg, p.percent[k]);
      panel.series.push_back(std::move(s));
    }
    f.panels.push_back(std::move(panel));
  }
  return DrawFigure(f);
}

std::string Gaps(const AccuracyResults& r) {
  Figure f{"Largest joint gap of the recovered poses",
           "largest joint rotation, degrees",
           "gap, % of the mean link length",
           {{0.5, "0.5"}, {1, "1"}, {2, "2"}, {5, "5"}, {10, "10"}, {20, "20"}, {45, "45"}},
           true,
           -6,
           2,
           0,
           {}};
  for (const GapCurve& c : r.gaps) {
    FigurePanel panel{c.name,
                      fmt::format("slope {:.2f} twist, {:.2f} second order",
                                  LogSlope(c.angles_deg, c.twist, kSlopeLow, kSlopeHigh),
                                  LogSlope(c.angles_deg, c.second_order, kSlopeLow, kSlopeHigh)),
                      {}};
    auto add = [&](StaticMode mode, const std::vector<double>& gap) {
      FigureSeries s{Name(mode), static_cast<int>(mode), {}};
      for (std::size_t i = 0; i < gap.size(); ++i) s.points.emplace_back(c.angles_deg[i], gap[i]);
      panel.series.push_back(std::move(s));
    };
    add(StaticMode::kTwist, c.twist);
    add(StaticMode::kSecondOrder, c.second_order);
    if (c.open != c.exact) {
      add(StaticMode::kOpen, c.open);
      add(StaticMode::kCurved, c.curved);
    }
    add(StaticMode::kExact, c.exact);
    f.panels.push_back(std::move(panel));
  }
  return DrawFigure(f);
}

std::string Frequencies(const AccuracyResults& r) {
  Figure f{"Error of the four lowest natural frequencies: the worst of them",
           "fixed-interface modes k",
           "error, %",
           {{0, "0"}, {2, "2"}, {4, "4"}, {6, "6"}, {8, "8"}, {10, "10"}, {12, "12"}},
           false,
           -4,
           3,
           1,
           {}};
  for (std::size_t i = 0; i + 1 < r.frequencies.size(); i += 2) {
    const FrequencyCurve& lowest = r.frequencies[i];
    FigurePanel panel{lowest.name, fmt::format("full: {:.3g} Hz", fmt::join(lowest.full_hz, ", ")), {}};
    for (std::size_t k = 0; k < 2; ++k) {
      FigureSeries s{k == 0 ? "lowest in frequency" : "largest contribution", k == 0 ? 0 : 1, {}};
      for (const auto& p : r.frequencies[i + k].points)
        if (s.points.empty() || s.points.back().first != p.modes) s.points.emplace_back(p.modes, Worst(p));
      panel.series.push_back(std::move(s));
    }
    f.panels.push_back(std::move(panel));
  }
  return DrawFigure(f);
}

std::string Transients(const AccuracyResults& r) {
  Figure f{"Error of a motion against the time step",
           "steps per second",
           "RMS error, % of the RMS displacement",
           {{60, "60"}, {120, "120"}, {240, "240"}, {480, "480"}, {960, "960"}},
           true,
           -4,
           2,
           1,
           {}};
  for (const TransientCurve& c : r.transients) {
    FigureSeries reduced{"reduced", 0, {}}, full{"full", 1, {}}, between{"reduced against full", 3, {}},
        two_stage{"reduced, two stages", 2, {}};
    for (const auto& p : c.points) {
      reduced.points.emplace_back(1 / p.dt_s, p.reduced_percent);
      full.points.emplace_back(1 / p.dt_s, p.full_percent);
      between.points.emplace_back(1 / p.dt_s, p.between_percent);
      two_stage.points.emplace_back(1 / p.dt_s, p.two_stage_percent);
    }
    f.panels.push_back({c.name,
                        fmt::format("moves by {:.{}f} mm RMS", c.motion_mm, c.motion_mm < 10 ? 1 : 0),
                        {reduced, full, between, two_stage}});
  }
  return DrawFigure(f);
}

// Of every scene the body that moves most, by implicit Euler.
std::string Estimates(const AccuracyResults& r) {
  Figure f{"Estimated and true error while a motion runs",
           "s",
           "error, % of the way so far",
           {{0, "0"}, {0.25, "0.25"}, {0.5, "0.5"}, {0.75, "0.75"}, {1, "1"}},
           false,
           -3,
           2,
           10,
           {}};
  for (const TransientCurve& c : r.transients) {
    const ErrorEstimateCurve* shown = nullptr;
    for (const ErrorEstimateCurve& e : r.estimates)
      if (e.name == c.name && e.integrator == Integrator::kEuler &&
          (!shown || e.points.back().motion_mm > shown->points.back().motion_mm))
        shown = &e;
    if (!shown) continue;
    FigureSeries truth{"true", 0, {}}, estimate{"estimated", 1, {}};
    for (std::size_t i = 2; i < shown->points.size(); i += 3) {
      const auto& p = shown->points[i];
      if (p.time_s > 1) break;
      truth.points.emplace_back(p.time_s, 100 * p.true_mm / p.motion_mm);
      estimate.points.emplace_back(p.time_s, 100 * p.shown_mm / p.motion_mm);
    }
    f.panels.push_back({c.name, shown->body, {truth, estimate}});
  }
  return DrawFigure(f);
}

// Rounding differs from machine to machine; 0 stands for all that is below 1e-9 %.
std::string Number(double v) { return std::isfinite(v) ? fmt::format("{:.4g}", v < 1e-9 ? 0 : v) : ""; }

}  // namespace

Expected<void> WriteAccuracyPlots(const AccuracyResults& results, const std::string& folder) {
  for (const auto& [name, text] : {std::pair{"statics", Statics(results)},
                                   {"gaps", Gaps(results)},
                                   {"frequencies", Frequencies(results)},
                                   {"transients", Transients(results)},
                                   {"estimates", Estimates(results)}})
    if (auto ok = WriteText(folder + "/" + name + ".svg", text); !ok) return ok;
  return {};
}

Expected<void> WriteAccuracyTables(const AccuracyResults& results, const std::string& folder) {
  std::string statics = "mechanism,mode,angle_deg,force_N,moved_mm,error_percent,loop_gap_mm\n";
  for (const StaticCurve& c : results.statics)
    for (std::size_t k = 0; k < c.modes.size(); ++k)
      for (const auto& p : c.points)
        statics +=
            fmt::format("{},\"{}\",{:.4g},{:.5g},{:.5g},{},{}\n", c.name, Name(c.modes[k]), p.angle_deg,
                        p.force_N, p.moved_mm, Number(p.percent[k]), Number(p.loop_gap_mm[k]));
  std::string gaps =
      "mechanism,angle_deg,twist_percent,second_order_percent,open_percent,curved_percent,exact_percent\n";
  for (const GapCurve& c : results.gaps)
    for (std::size_t i = 0; i < c.angles_deg.size(); ++i)
      gaps +=
          fmt::format("{},{:g},{},{},{},{},{}\n", c.name, c.angles_deg[i], Number(c.twist[i]),
                      Number(c.second_order[i]), Number(c.open[i]), Number(c.curved[i]), Number(c.exact[i]));
  std::string rests =
      "mechanism,load,angle_deg,load_size,coordinates_of_all_joints,reduced_coordinates,refreshes,"
      "interface_percent,inside_share\n";
  for (const RestCurve& c : results.rests)
    for (const auto& p : c.points)
      rests += fmt::format("{},{},{:.4g},{:.5g},{},{},{},{},{}\n", c.name, Name(c.load), p.angle_deg, p.load,
                           c.coordinates, p.size, p.refreshes, Number(p.interface_percent), Number(p.inside));
  std::string frequencies = "mechanism,choice,modes,reduced_coordinates,mode_number,full_hz,error_percent\n";
  for (const FrequencyCurve& c : results.frequencies)
    for (const auto& p : c.points)
      for (std::size_t i = 0; i < p.percent.size(); ++i)
        frequencies += fmt::format("{},{},{},{},{},{:.6g},{}\n", c.name, Name(c.choice), p.modes, p.size,
                                   i + 1, c.full_hz[i], Number(p.percent[i]));
  std::string transients =
      "scene,steps_per_second,motion_mm,reduced_percent,full_percent,reduced_against_full_percent,"
      "truth_percent,two_stage_percent\n";
  for (const TransientCurve& c : results.transients)
    for (const auto& p : c.points)
      transients += fmt::format("{},{:.0f},{:.5g},{},{},{},{},{}\n", c.name, 1 / p.dt_s, c.motion_mm,
                                Number(p.reduced_percent), Number(p.full_percent), Number(p.between_percent),
                                Number(c.truth_percent), Number(p.two_stage_percent));
  std::string estimates = "scene,body,integrator,time_s,estimated_mm,true_mm,motion_mm\n";
  for (const ErrorEstimateCurve& c : results.estimates)
    for (const auto& p : c.points)
      estimates += fmt::format("{},{},{},{:.4f},{},{},{}\n", c.name, c.body,
                               c.integrator == Integrator::kEuler ? "euler" : "two-stage", p.time_s,
                               Number(p.shown_mm), Number(p.true_mm), Number(p.motion_mm));
  for (const auto& [name, text] : {std::pair{"statics", statics},
                                   {"gaps", gaps},
                                   {"rests", rests},
                                   {"frequencies", frequencies},
                                   {"transients", transients},
                                   {"estimates", estimates}})
    if (auto ok = WriteText(folder + "/" + name + ".csv", text); !ok) return ok;
  return {};
}

}  // namespace fork1s::internal
