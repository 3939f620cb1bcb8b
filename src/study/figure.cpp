#include "figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "svg_plot.hpp"

namespace fork1s::internal {
namespace {

// Okabe and Ito's colours keep apart for all kinds of eyes; dash and marker tell the lines apart in print.
struct Style {
  const char *colour, *dash;
  char marker;
};
constexpr std::array<Style, 6> kStyles{{{"#D55E00", "none", 'c'},
                                        {"#0072B2", "7 4", 's'},
                                        {"#8A5A83", "2 3", 'd'},
                                        {"#007A5A", "none", 't'},
                                        {"#222222", "9 3 2 3", 'c'},
                                        {"#56B4E9", "none", 's'}}};
constexpr double kPanelWidth = 312, kPanelHeight = 268, kHeadHeight = 78, kMargin = 8;
// Of the plot in its panel.
constexpr double kPlotLeft = 58, kPlotRight = 300, kPlotTop = 44, kPlotBottom = 218;

std::string Marker(const Style& s, double x, double y, bool hollow) {
  const std::string paint =
      fmt::format("fill=\"{}\" stroke=\"{}\" stroke-width=\"1.5\"", hollow ? "#ffffff" : s.colour, s.colour);
  switch (s.marker) {
    case 's':
      return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"6.4\" height=\"6.4\" {}/>", x - 3.2,
                         y - 3.2, paint);
    case 'd':
      return fmt::format("<path d=\"M{:.1f} {:.1f}l4.2 4.2l-4.2 4.2l-4.2 -4.2z\" {}/>", x, y - 4.2, paint);
    case 't':
      return fmt::format("<path d=\"M{:.1f} {:.1f}l4 7h-8z\" {}/>", x, y - 4.2, paint);
    default:
      return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.4\" {}/>", x, y, paint);
  }
}

std::string Line(const Style& s, const std::string& points) {
  return fmt::format(
      "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"{}\"/>",
      points, s.colour, s.dash);
}

std::string Text(double x, double y, const char* anchor, const std::string& text, const char* more = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n", x, y, anchor, more,
                     EscapeHtml(text));
}

// 0.01, 1, 100 as they are, what is smaller as a power.
std::string DecadeLabel(int decade) {
  return decade < -3 ? fmt::format("1e{}", decade) : fmt::format("{:g}", std::pow(10.0, decade));
}

class PanelDrawer {
 public:
  PanelDrawer(const Figure& figure, double x0, double y0) : f_(figure), x0_(x0), y0_(y0) {}

  std::string Draw(const FigurePanel& panel) const {
    std::string svg = Text(x0_ + kPlotLeft, y0_ + 18, "start", panel.title, " font-weight=\"600\"");
    svg += Text(x0_ + kPlotLeft, y0_ + 35, "start", panel.note, " font-size=\"12\" fill=\"#4a5160\"");
    svg += Axes();
    for (const FigureSeries& s : panel.series) svg += DrawSeries(s);
    return svg;
  }

 private:
  double X(double value) const {
    auto scale = [&](double v) { return f_.log_x ? std::log(v) : v; };
    const double low = scale(f_.x_ticks.front().first), high = scale(f_.x_ticks.back().first);
    return x0_ + kPlotLeft + (scale(value) - low) / (high - low) * (kPlotRight - kPlotLeft);
  }
  double Y(double value) const {
    const double share = (std::log10(value) - f_.low_decade) / (f_.high_decade - f_.low_decade);
    return y0_ + kPlotBottom - std::max(0.0, share) * (kPlotBottom - kPlotTop);
  }
  bool IsBelow(double value) const { return value < std::pow(10.0, f_.low_decade); }

  std::string Grid(double x1, double y1, double x2, double y2, const char* colour) const {
    return fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"1\"/>\n",
        x1, y1, x2, y2, colour);
  }

  std::string Axes() const {
    std::string svg;
    const double left = x0_ + kPlotLeft, right = x0_ + kPlotRight;
    const double top = y0_ + kPlotTop, bottom = y0_ + kPlotBottom;
    for (const auto& [value, label] : f_.x_ticks) {
      svg += Grid(X(value), top, X(value), bottom, "#e3e6ea");
      svg += Text(X(value), bottom + 16, "middle", label);
    }
    const int step = std::max(1, (f_.high_decade - f_.low_decade + 4) / 7);
    for (int d = f_.high_decade; d >= f_.low_decade; d -= step) {
      const double y = Y(std::pow(10.0, d));
      svg += Grid(left, y, right, y, "#e3e6ea");
      svg += Text(left - 6, y + 4, "end", DecadeLabel(d));
    }
    svg += Grid(left, bottom, right, bottom, "#4a5160") + Grid(left, top, left, bottom, "#4a5160");
    if (f_.guide > 0) {
      svg += Grid(left, Y(f_.guide), right, Y(f_.guide), "#5b6270");
    }
    svg += Text(0.5 * (left + right), bottom + 34, "middle", f_.x_label, " fill=\"#4a5160\"");
    return svg;
  }

  std::string DrawSeries(const FigureSeries& s) const {
    const Style& style = kStyles[static_cast<std::size_t>(s.style) % kStyles.size()];
    std::string path, markers;
    for (const auto& [x, y] : s.points) {
      if (!std::isfinite(y) || y > std::pow(10.0, f_.high_decade)) continue;
      const double v = Y(std::max(y, 1e-300));
      path += fmt::format("{:.1f},{:.1f} ", X(x), v);
      markers += Marker(style, X(x), v, IsBelow(y)) + "\n";
    }
    return path.empty() ? "" : Line(style, path) + "\n" + markers;
  }

  const Figure& f_;
  double x0_, y0_;
};

constexpr double kLegendLeft = 26;
double LegendWidth(const std::string& label) { return 60 + 7.2 * static_cast<double>(label.size()); }

std::vector<std::string> LabelsOf(const Figure& figure) {
  std::vector<std::string> labels;
  for (const FigurePanel& panel : figure.panels)
    for (const FigureSeries& s : panel.series)
      if (std::find(labels.begin(), labels.end(), s.label) == labels.end()) labels.push_back(s.label);
  return labels;
}

}  // namespace

std::vector<std::pair<double, std::string>> DecadeTicks(double low, double high) {
  std::vector<std::pair<double, std::string>> ticks;
  const int first = static_cast<int>(std::floor(std::log10(low)));
  const int last = std::max(first + 1, static_cast<int>(std::ceil(std::log10(high))));
  for (int d = first; d <= last; ++d)
    ticks.emplace_back(std::pow(10.0, d),
                       d < -3 || d > 3 ? fmt::format("1e{}", d) : fmt::format("{:g}", std::pow(10.0, d)));
  return ticks;
}

std::string DrawFigure(const Figure& figure) {
  const int panels = static_cast<int>(figure.panels.size());
  const int columns = panels == 4 ? 2 : std::min(panels, 3), rows = (panels + columns - 1) / columns;
  double legend = kLegendLeft;  // where it ends
  for (const std::string& label : LabelsOf(figure)) legend += LegendWidth(label);
  const double width = std::max(legend, std::max(2, columns) * kPanelWidth + 2 * kMargin + 14);
  const double height = kHeadHeight + rows * kPanelHeight + kMargin;
  // Its own ground, so that it reads the same on a light and on a dark page.
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" role=\"img\" aria-label=\"{2}\" font-family=\"system-ui, sans-serif\" "
      "font-size=\"13\" fill=\"#1c1e21\">\n"
      "<rect width=\"100%\" height=\"100%\" rx=\"8\" fill=\"#ffffff\"/>\n",
      width, height, EscapeHtml(figure.title));
  svg += Text(22, 28, "start", figure.title, " font-size=\"16\" font-weight=\"600\"");
  double at = kLegendLeft;
  bool hollow = false;
  std::vector<std::string> shown;
  for (const FigurePanel& panel : figure.panels)
    for (const FigureSeries& s : panel.series) {
      if (std::find(shown.begin(), shown.end(), s.label) != shown.end()) continue;
      shown.push_back(s.label);
      const Style& style = kStyles[static_cast<std::size_t>(s.style) % kStyles.size()];
      svg += Line(style, fmt::format("{:.0f},52 {:.0f},52", at, at + 30)) + Marker(style, at + 15, 52, false);
      svg += Text(at + 37, 56.5, "start", s.label);
      at += LegendWidth(s.label);
    }
  const double floor = std::pow(10.0, figure.low_decade);
  for (const FigurePanel& panel : figure.panels)
    for (const FigureSeries& s : panel.series)
      for (const auto& [x, y] : s.points) hollow = hollow || y < floor;
  if (hollow) svg += Text(at, 56.5, "start", "hollow: below", " fill=\"#4a5160\"");
  svg += fmt::format(
      "<text transform=\"translate(18 {:.0f}) rotate(-90)\" text-anchor=\"middle\" "
      "fill=\"#4a5160\">{}</text>\n",
      kHeadHeight + 0.5 * rows * kPanelHeight, EscapeHtml(figure.y_label));
  for (int i = 0; i < panels; ++i)
    svg += PanelDrawer(figure, kMargin + 14 + (i % columns) * kPanelWidth,
                       kHeadHeight + (i / columns) * kPanelHeight)
               .Draw(figure.panels[static_cast<std::size_t>(i)]);
  return svg + "</svg>\n";
}

}  // namespace fork1s::internal
