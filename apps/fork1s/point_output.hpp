// --point and --along: points of bodies at which compliance and stiffness are measured.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "print.hpp"
#include "study/deflection.hpp"

namespace fork1s::app {

struct PointArguments {
  std::vector<std::string> points;  // "[BODY:]X,Y,Z"
  std::string along;                // "X,Y,Z"

  void AddTo(CLI::App& command, const std::string& description);
  /// The direction of --along. Errors: kUsage.
  Expected<std::optional<Vector3>> Direction() const;
  /// In their order; `body` where none is named. Errors: kUsage.
  Expected<std::vector<NamedPoint>> Points(const std::string& body) const;
};

Json PointsJson(const std::vector<MeasuredPoint>& points, const std::optional<Vector3>& along);
/// Table of what PointsJson made.
void PrintPoints(const Json& points);

}  // namespace fork1s::app
