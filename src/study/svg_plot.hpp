// Line plots as inline SVG; colours come from the page's CSS.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace fork1s::internal {

struct PlotLine {
  std::string label;
  std::string css;  // class: "a" the reduced model, "b" the other, "c" the difference
  std::vector<std::pair<double, double>> points;
  bool markers = false;
  std::vector<std::string> labels = {};  // beside the markers, one a point
};

struct Plot {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;  // points that are not positive are left out
  std::vector<PlotLine> lines;
};

/// 600 x 300 units, scaled by the page. A plot without points says so.
std::string DrawPlot(const Plot& plot);
/// <, >, & and quotes as entities.
std::string EscapeHtml(const std::string& text);

}  // namespace fork1s::internal
