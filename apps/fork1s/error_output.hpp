// The error figure of a run as JSON and text.
#pragma once

#include "output.hpp"
#include "sim/error_figure.hpp"

namespace fork1s::app {

/// `error_estimate_mm` and `error_estimate_percent`.
void AddErrorFigure(const internal::ErrorFigure& figure, Json& summary);

/// The lines that `run` prints for these keys.
void PrintErrorFigure(const Json& summary);

}  // namespace fork1s::app
