#include "point_output.hpp"

#include <fmt/format.h>

#include <cmath>

#include "model_arguments.hpp"
#include "output.hpp"

namespace fork1s::app {
namespace {

// null: rigid.
Json Along(const PointStiffness& at, const Vector3& direction_W) {
  const double k = at.Along(direction_W);
  return std::isfinite(k) ? Json(k) : Json(nullptr);
}

Json StiffnessJson(const PointStiffness& at, const std::optional<Vector3>& along) {
  Json out;
  out["compliance_world"] = ToJson(at.Compliance());
  out["stiffness_world"] = ToJson(at.Stiffness());
  out["stiffness_along_axes_N_per_m"] = Json::array();
  for (int i = 0; i < 3; ++i) out["stiffness_along_axes_N_per_m"].push_back(Along(at, Vector3::Unit(i)));
  if (along) out["stiffness_along_N_per_m"] = Along(at, *along);
  out["free_motions"] = at.free;
  return out;
}

std::string Value(const Json& k) {
  if (k.is_null()) return fmt::format("{:>12}", "rigid");
  return k.get<double>() == 0 ? fmt::format("{:>12}", "free") : fmt::format("{:>12.5g}", k.get<double>());
}

// A row of the table: along x, y, z and the direction asked for.
void PrintRow(const std::string& of_what, const Json& at) {
  PrintText("    {:<26}", of_what);
  for (const Json& k : at["stiffness_along_axes_N_per_m"]) PrintText("{}", Value(k));
  if (at.contains("stiffness_along_N_per_m")) PrintText("{}", Value(at["stiffness_along_N_per_m"]));
  PrintText("\n");
}

}  // namespace

void PointArguments::AddTo(CLI::App& command, const std::string& description) {
  command.add_option("--point", points, description)->take_all()->allow_extra_args(false);
  command.add_option("--along", along,
                     "x,y,z, world axes: a direction along which stiffness at the points is given besides");
}

Expected<std::optional<Vector3>> PointArguments::Direction() const {
  if (along.empty()) return std::nullopt;
  const auto direction = ParseVector(along, "--along");
  if (!direction) return tl::unexpected(direction.error());
  if (direction->norm() == 0) return Fail(ErrorCode::kUsage, "--along", "is no direction: its length is 0");
  return *direction;
}

Expected<std::vector<NamedPoint>> PointArguments::Points(const std::string& body) const {
  std::vector<NamedPoint> out;
  for (const std::string& text : points) {
    const std::size_t colon = text.rfind(':');  // names may have colons, numbers have none
    const bool is_named = colon != std::string::npos;
    const auto p_B = ParseVector(is_named ? text.substr(colon + 1) : text, "--point");
    if (!p_B) return tl::unexpected(p_B.error());
    if (!is_named && body.empty())
      return Fail(ErrorCode::kUsage, "--point", fmt::format("'{}' names no body: BODY:X,Y,Z", text));
    out.push_back({is_named ? text.substr(0, colon) : body, *p_B});
  }
  return out;
}

Json PointsJson(const std::vector<MeasuredPoint>& points, const std::optional<Vector3>& along) {
  Json all = Json::array();
  for (const MeasuredPoint& p : points) {
    Json one;
    one["body"] = p.point.body;
    one["point_m"] = ToJson(p.point.p_B);
    one["reference_position_m"] = ToJson(p.reference_W);
    if (along) one["along"] = ToJson(*along);
    one["springs"] = StiffnessJson(p.springs, along);
    one["loaded"] = p.loaded ? StiffnessJson(*p.loaded, along) : Json(nullptr);
    all.push_back(std::move(one));
  }
  return all;
}

void PrintPoints(const Json& points) {
  if (points.empty()) return;
  std::string besides;
  if (points[0].contains("along")) besides = " and along " + ToText(points[0]["along"]);
  PrintText("  stiffness of points along x, y, z{}, all else free [N/m]:\n", besides);
  for (const Json& p : points) {
    PrintText("    '{}' at {} m\n", p["body"].get<std::string>(), ToText(p["point_m"]));
    PrintRow("  of the springs alone", p["springs"]);
    if (!p["loaded"].is_null()) PrintRow("  about the equilibrium", p["loaded"]);
    const Json& at = p["loaded"].is_null() ? p["springs"] : p["loaded"];
    for (const Json& text : at["free_motions"]) PrintText("      {}\n", text.get<std::string>());
  }
}

}  // namespace fork1s::app
