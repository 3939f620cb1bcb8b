#include "svg_plot.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace fork1s::internal {
namespace {

constexpr double kLeft = 70, kRight = 590, kTop = 34, kBottom = 250;

// One axis: a linear or logarithmic range, and where its ticks stand.
struct Axis {
  bool log = false;
  double low = std::numeric_limits<double>::infinity(), high = -low;

  bool Shows(double v) const { return std::isfinite(v) && (!log || v > 0); }
  double Scale(double v) const { return log ? std::log10(v) : v; }
  void Include(double v) {
    low = std::min(low, Scale(v));
    high = std::max(high, Scale(v));
  }
  void RoundLimits() {
    if (log) {
      low = std::floor(low);
      high = std::max(std::ceil(high), low + 1);
    } else {
      if (!(high > low)) {
        const double room = std::max(1e-12, 0.5 * std::abs(high));
        low -= room;
        high += room;
      }
      const double step = Step();
      low = step * std::floor(low / step + 1e-9);
      high = step * std::ceil(high / step - 1e-9);
    }
  }
  double Step() const {
    if (log) return std::max(1.0, std::ceil((high - low) / 6));
    const double raw = (high - low) / 5, size = std::pow(10, std::floor(std::log10(raw)));
    for (double factor : {1.0, 2.0, 5.0})
      if (raw <= factor * size) return factor * size;
    return 10 * size;
  }
  double Share(double v) const { return (Scale(v) - low) / (high - low); }
  std::vector<std::pair<double, std::string>> Ticks() const {
    std::vector<std::pair<double, std::string>> ticks;
    const double step = Step();
    for (int i = 0; i <= 12; ++i) {
      const double at = low + i * step;
      if (at > high + 1e-9 * step) break;
      const double value = std::abs(at) < 1e-9 * step ? 0 : at;
      ticks.emplace_back((at - low) / (high - low),
                         log && std::abs(value) > 3
                             ? fmt::format("1e{:.0f}", value)
                             : fmt::format("{:.4g}", log ? std::pow(10, value) : value));
    }
    return ticks;
  }
};

}  // namespace

std::string EscapeHtml(const std::string& text) {
  std::string out;
  for (char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string DrawPlot(const Plot& plot) {
  Axis x{plot.log_x}, y{plot.log_y};
  std::vector<PlotLine> lines;
  for (const PlotLine& line : plot.lines) {
    PlotLine kept = line;
    kept.points.clear();
    kept.labels.clear();
    for (std::size_t i = 0; i < line.points.size(); ++i) {
      const auto [u, v] = line.points[i];
      if (!x.Shows(u) || !y.Shows(v)) continue;
      kept.points.emplace_back(u, v);
      if (i < line.labels.size()) kept.labels.push_back(line.labels[i]);
      x.Include(u);
      y.Include(v);
    }
    if (!kept.points.empty()) lines.push_back(std::move(kept));
  }
  std::string svg = fmt::format(
      "<figure><svg viewBox=\"0 0 600 300\" role=\"img\" aria-label=\"{0}\">\n"
      "<text class=\"title\" x=\"{1}\" y=\"18\">{0}</text>\n",
      EscapeHtml(plot.title), kLeft);
  if (lines.empty())
    return svg +
           "<text x=\"330\" y=\"150\" text-anchor=\"middle\">nothing to show: all values are "
           "0</text></svg></figure>\n";
  x.RoundLimits();
  y.RoundLimits();
  auto at_x = [&](double share) { return kLeft + share * (kRight - kLeft); };
  auto at_y = [&](double share) { return kBottom - share * (kBottom - kTop); };
  for (const auto& [share, label] : x.Ticks())
    svg += fmt::format(
        "<line class=\"grid\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\"/>"
        "<text x=\"{0:.1f}\" y=\"{3}\" text-anchor=\"middle\">{4}</text>\n",
        at_x(share), kTop, kBottom, kBottom + 16, label);
  for (const auto& [share, label] : y.Ticks())
    svg += fmt::format(
        "<line class=\"grid\" x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/>"
        "<text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5}</text>\n",
        kLeft, kRight, at_y(share), kLeft - 6, at_y(share) + 4, label);
  svg += fmt::format(
      "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>\n"
      "<text transform=\"translate(14 {:.0f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
      at_x(0.5), kBottom + 34, EscapeHtml(plot.x_label), at_y(0.5), EscapeHtml(plot.y_label));
  double legend = kRight;
  for (auto line = lines.rbegin(); line != lines.rend(); ++line) {
    legend -= 28 + 7.0 * static_cast<double>(line->label.size());
    svg += fmt::format(
        "<line class=\"{0}\" x1=\"{1:.0f}\" x2=\"{2:.0f}\" y1=\"14\" y2=\"14\"/><text x=\"{3:.0f}\" "
        "y=\"18\">{4}</text>\n",
        line->css, legend, legend + 16, legend + 20, EscapeHtml(line->label));
  }
  for (const PlotLine& line : lines) {
    svg += fmt::format("<polyline class=\"{}\" points=\"", line.css);
    // More points than pixels only make the page large.
    const std::size_t stride = std::max<std::size_t>(1, line.points.size() / 1200);
    for (std::size_t i = 0; i < line.points.size(); i += stride)
      svg += fmt::format("{:.1f},{:.1f} ", at_x(x.Share(line.points[i].first)),
                         at_y(y.Share(line.points[i].second)));
    svg += "\"/>\n";
    if (!line.markers) continue;
    for (std::size_t i = 0; i < line.points.size(); ++i) {
      const double u = at_x(x.Share(line.points[i].first)), v = at_y(y.Share(line.points[i].second));
      svg += fmt::format("<circle class=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\"/>\n", line.css, u, v);
      if (i >= line.labels.size()) continue;
      const bool left = u > 0.8 * kRight;  // there is no room on the right
      svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n",
                         u + (left ? -8 : 8), v - 5, left ? "end" : "start", EscapeHtml(line.labels[i]));
    }
  }
  return svg + "</svg></figure>\n";
}

}  // namespace fork1s::internal
