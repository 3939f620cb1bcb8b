// The comparison as one HTML page.
#include <algorithm>
#include <cmath>
#include <fork1s/study/compare.hpp>

#include <fmt/format.h>

#include "html_page.hpp"
#include "record/output_file.hpp"
#include "svg_plot.hpp"

namespace fork1s {
namespace {

using internal::Cell;
using internal::DrawPlot;
using internal::EscapeHtml;
using internal::Plot;
using internal::PlotLine;
using internal::Table;

// The body that strays most, and the one that is pressed most.
template <class Size>
const ComparedTrace* Largest(const std::vector<ComparedTrace>& traces, Size size) {
  const ComparedTrace* best = nullptr;
  double most = -1;
  for (const ComparedTrace& t : traces)
    if (const double s = size(t); s > most) {
      most = s;
      best = &t;
    }
  return best;
}

double LargestNorm(const std::vector<Vector3>& v) {
  double largest = 0;
  for (const Vector3& x : v) largest = std::max(largest, x.norm());
  return largest;
}

std::string Plots(const Comparison& c) {
  std::string out = "<div class=\"plots\">\n";
  auto series = [&](const std::string& label, const char* css, auto value) {
    PlotLine line{label, css, {}};
    for (std::size_t i = 0; i < c.times_s.size(); ++i) line.points.emplace_back(c.times_s[i], value(i));
    return line;
  };
  const ComparedTrace* path = Largest(c.traces, [](const ComparedTrace& t) {
    double off = 0;
    for (std::size_t i = 0; i < t.reduced_m.size(); ++i)
      off = std::max(off, (t.reduced_m[i] - t.other_m[i]).norm());
    return off;
  });
  if (path) {
    const ComparedTrace& t = *path;
    out += DrawPlot(
        {"Path of " + t.body,
         "time, s",
         "moved from the start, mm",
         false,
         false,
         {series("reduced", "a",
                 [&](std::size_t i) { return 1e3 * (t.reduced_m[i] - t.reduced_m[0]).norm(); }),
          series(c.other, "b", [&](std::size_t i) { return 1e3 * (t.other_m[i] - t.other_m[0]).norm(); })}});
    out += DrawPlot({"Difference of " + t.body + ", the body that strays most",
                     "time, s",
                     "mm",
                     false,
                     false,
                     {series("reduced - " + c.other, "c",
                             [&](std::size_t i) { return 1e3 * (t.reduced_m[i] - t.other_m[i]).norm(); })}});
  }
  if (const ComparedTrace* force = Largest(c.traces,
                                           [](const ComparedTrace& t) {
                                             return LargestNorm(t.force_reduced_N) +
                                                    LargestNorm(t.force_other_N);
                                           });
      force && LargestNorm(force->force_reduced_N) + LargestNorm(force->force_other_N) > 0) {
    out += DrawPlot({"Contact force on " + force->body,
                     "time, s",
                     "N",
                     false,
                     false,
                     {series("reduced", "a", [&](std::size_t i) { return force->force_reduced_N[i].norm(); }),
                      series(c.other, "b", [&](std::size_t i) { return force->force_other_N[i].norm(); })}});
  }
  out += DrawPlot({"Largest joint gap",
                   "time, s",
                   "mm",
                   false,
                   true,
                   {series("reduced", "a", [&](std::size_t i) { return c.gap_reduced_mm[i]; }),
                    series(c.other, "b", [&](std::size_t i) { return c.gap_other_mm[i]; })}});
  Plot cost{"Error against cost, by time step",
            "wall time, s",
            "RMS error, mm",
            true,
            true,
            {{"reduced", "a", {}, true}, {c.other, "b", {}, true}}};
  for (const CostPoint& p : c.costs) {
    PlotLine& line = cost.lines[p.simulator == "reduced" ? 0 : 1];
    line.points.emplace_back(p.wall_s, p.rms_mm);
    line.labels.push_back(fmt::format("{:.3g} ms", 1e3 * p.dt_s));
  }
  out += DrawPlot(cost);
  return out + "</div>\n";
}

std::string Tables(const Comparison& c) {
  std::string out = "<div class=\"tables\">\n";
  std::vector<std::string> rows;
  for (const auto* list : {&c.interface, &c.free_bodies})
    for (const BodyDifference& b : *list)
      rows.push_back(Cell(b.body) + Cell(b.rms_mm) + Cell(b.max_mm) + Cell(b.rms_deg) + Cell(b.max_deg));
  out += Table("Bodies", {"body", "RMS mm", "max mm", "RMS deg", "max deg"}, rows);

  rows = {Cell("contact force, RMS difference N") + Cell(c.force_rms_N),
          Cell("contact force, share %") + Cell(c.force_rms_percent),
          Cell("joint gap, reduced mm") + Cell(c.gap_max_mm),
          Cell("energy first, reduced J") + Cell(c.energy_reduced.first_J),
          Cell("energy last, reduced J") + Cell(c.energy_reduced.last_J),
          Cell("energy last, " + c.other + " J") + Cell(c.energy_other.last_J),
          Cell("wall time, reduced s") + Cell(c.wall_reduced_s),
          Cell("wall time, " + c.other + " s") + Cell(c.wall_other_s),
          Cell("wall time, ratio") + Cell(c.wall_ratio)};
  out += Table("Run", {"", ""}, rows);

  rows.clear();
  for (std::size_t i = 0; i < std::max(c.frequencies_full_hz.size(), c.frequencies_reduced_hz.size()); ++i) {
    auto at = [&](const std::vector<double>& f) {
      return i < f.size() ? Cell(f[i]) : Cell(std::string("-"));
    };
    rows.push_back(Cell(std::to_string(i + 1)) + at(c.frequencies_reduced_hz) + at(c.frequencies_full_hz));
  }
  out += Table("Natural frequencies", {"", "reduced Hz", "full Hz"}, rows);

  rows.clear();
  for (const EqualStep& e : c.equal_steps)
    rows.push_back(Cell(1e3 * e.dt_s) + Cell(e.rms_mm) + Cell(e.max_mm) + Cell(e.wall_reduced_s) +
                   Cell(e.wall_other_s));
  out += Table("At equal steps", {"dt ms", "RMS mm", "max mm", "reduced s", c.other + " s"}, rows);

  rows.clear();
  for (const CostPoint& p : c.costs)
    rows.push_back(Cell(p.simulator) + Cell(1e3 * p.dt_s) + Cell(p.wall_s) + Cell(p.rms_mm) + Cell(p.max_mm));
  out +=
      Table("Against " + c.other + " at its finest step", {"", "dt ms", "wall s", "RMS mm", "max mm"}, rows);
  return out + "</div>\n";
}

}  // namespace

Expected<void> WriteComparisonReport(const Comparison& c, const std::string& path) {
  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{0}: reduced and "
      "{1}</title>\n"
      "<style>{2}</style></head><body>\n<h1>{0}: reduced model and {1}</h1>\n"
      "<p>{3:.4g} s at steps of {4:.4g} ms{5}; {6}. RMS over samples every step; forces are means over a "
      "step.</p>\n",
      EscapeHtml(c.scene), EscapeHtml(c.other), internal::kPageStyle, c.time_s, 1e3 * c.dt_s,
      c.other_dt_s != c.dt_s ? fmt::format(", {} at {:.4g} ms", c.other, 1e3 * c.other_dt_s) : "",
      IntegratorsText(c));
  for (const std::string& w : c.warnings) page += "<p>Warning: " + EscapeHtml(w) + "</p>\n";
  for (const std::string& line : DifferenceLines(c)) page += "<p>" + EscapeHtml(line) + "</p>\n";
  page += Plots(c) + Tables(c) + "</body></html>\n";
  return WriteFile(path, kHtmlFile, page);
}

}  // namespace fork1s
