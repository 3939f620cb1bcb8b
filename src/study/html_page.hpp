// What the pages that this room writes share: how they look, and tables.
#pragma once

#include <string>
#include <vector>

namespace fork1s::internal {

// Text, ground, grid; blue and orange keep apart for all kinds of eyes, on white and on black.
inline constexpr const char* kPageStyle = R"(
:root { color-scheme: light dark; --text: #1c1e21; --ground: #ffffff; --grid: #d9dce1; --soft: #5b6270;
        --a: #0b62c4; --b: #c2570c; --c: #60626b; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e8e9ec; --ground: #16181c; --grid: #353941; --soft: #a4aab6; --a: #6db3ff; --b: #ffa654; --c: #b3b6bf; }
}
body { margin: 1.5rem auto; max-width: 1200px; padding: 0 1.25rem; font: 15px/1.45 system-ui, sans-serif;
       color: var(--text); background: var(--ground); }
h1 { font-size: 1.4rem; margin: 0 0 .25rem; } h2 { font-size: 1.05rem; margin: 1.5rem 0 .5rem; }
p { margin: .25rem 0; color: var(--soft); }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(480px, 1fr)); gap: 1rem; margin-top: 1rem; }
figure { margin: 0; } svg { width: 100%; height: auto; }
svg text { font: 13px system-ui, sans-serif; fill: var(--soft); } svg .title { font-weight: 600; fill: var(--text); }
.grid { stroke: var(--grid); stroke-width: 1; }
line.a, polyline.a { stroke: var(--a); } line.b, polyline.b { stroke: var(--b); } line.c, polyline.c { stroke: var(--c); }
line.a, line.b, line.c, polyline { stroke-width: 2; fill: none; } line.b, polyline.b { stroke-dasharray: 7 4; }
circle.a { fill: var(--a); } circle.b { fill: var(--b); }
.tables { display: flex; flex-wrap: wrap; gap: 0 3rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .75rem .2rem 0; text-align: right; border-bottom: 1px solid var(--grid); }
th:first-child, td:first-child { text-align: left; } th { font-weight: 600; }
)";

/// A cell of a table; "-" for a number that is none.
std::string Cell(const std::string& text);
std::string Cell(double value);

/// Rows are the cells of one line each; nothing where there are none.
std::string Table(const std::string& title, const std::vector<std::string>& head,
                  const std::vector<std::string>& rows);

}  // namespace fork1s::internal
