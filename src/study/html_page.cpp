#include "html_page.hpp"

#include <cmath>

#include <fmt/format.h>

#include "svg_plot.hpp"

namespace fork1s::internal {

std::string Cell(const std::string& text) { return "<td>" + EscapeHtml(text) + "</td>"; }
std::string Cell(double value) {
  return std::isnan(value) ? Cell(std::string("-")) : fmt::format("<td>{:.4g}</td>", value);
}

std::string Table(const std::string& title, const std::vector<std::string>& head,
                  const std::vector<std::string>& rows) {
  if (rows.empty()) return "";
  std::string out = "<section><h2>" + EscapeHtml(title) + "</h2><table><tr>";
  for (const std::string& h : head) out += "<th>" + EscapeHtml(h) + "</th>";
  out += "</tr>\n";
  for (const std::string& row : rows) out += "<tr>" + row + "</tr>\n";
  return out + "</table></section>\n";
}

}  // namespace fork1s::internal
