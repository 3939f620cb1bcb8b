// Small multiples as an SVG file of its own: one panel a mechanism, one legend for all.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace fork1s::internal {

struct FigureSeries {
  std::string label;  // the same in every panel where the series occurs
  int style = 0;      // colour, dash and marker
  std::vector<std::pair<double, double>> points;
};

struct FigurePanel {
  std::string title;
  std::string note;  // below the title
  std::vector<FigureSeries> series;
};

struct Figure {
  std::string title, x_label, y_label;
  std::vector<std::pair<double, std::string>> x_ticks;  // the first and the last are the ends of the axis
  bool log_x = true;
  int low_decade = -4, high_decade = 2;  // of y
  double guide = 0;                      // a line across at this y; 0: none
  std::vector<FigurePanel> panels;
};

/// For Figure::x_ticks: the decades that hold all values from `low` to `high`, both above 0; one decade at least.
std::vector<std::pair<double, std::string>> DecadeTicks(double low, double high);

/// The whole file. Values below the axis stand on its lower edge with a hollow marker, a line ends where it
/// leaves above; what is not finite is left out.
std::string DrawFigure(const Figure& figure);

}  // namespace fork1s::internal
