#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "model_arguments.hpp"
#include "output.hpp"
#include "point_output.hpp"
#include "print.hpp"
#include "study/deflection.hpp"

namespace fork1s::app {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

struct StaticsArguments {
  ModelArguments model;
  PointArguments points;
  std::string body, force = "0,0,0", torque = "0,0,0", gravity;
  bool lock_free = false;
  int buckling = 0;
};

Json DeflectionJson(const Deflection& d) {
  return {{"position_m", ToJson(d.position_W)},
          {"rotation_vector_rad", ToJson(d.rotation_W)},
          {"max_joint_rotation_deg", d.max_joint_rotation * kDegrees}};
}

Json BucklingJson(const LoadedBody& loaded) {
  Json all = Json::array();
  for (const BucklingMode& mode : loaded.buckling) {
    Json q = Json::object();
    for (std::size_t i = 0; i < loaded.coordinates.size(); ++i)
      q[loaded.coordinates[i]] = mode.q(static_cast<Eigen::Index>(i));
    all.push_back({{"factor", mode.factor}, {"mode", std::move(q)}});
  }
  return all;
}

void PrintBuckling(const LoadedBody& loaded) {
  if (loaded.buckling.empty()) PrintText("  no multiple of this load buckles it\n");
  for (const BucklingMode& mode : loaded.buckling) {
    std::string text;
    for (std::size_t i = 0; i < loaded.coordinates.size(); ++i)
      if (const double q = mode.q(static_cast<Eigen::Index>(i)); std::abs(q) > 1e-3)
        text += fmt::format("{}{} {:.3g}", text.empty() ? "" : ", ", loaded.coordinates[i], q);
    PrintText("  buckles at {:.6g} times the load; mode: {}\n", mode.factor, text);
  }
}

std::string HertzText(const std::vector<double>& hertz) {
  return hertz.empty() ? "none" : fmt::format("{:.5g}", fmt::join(hertz, ", "));
}

int Run(const StaticsArguments& args) {
  const bool json = args.model.json;
  auto force = ParseVector(args.force, "--force");
  auto torque = ParseVector(args.torque, "--torque");
  if (!force) return Report(force.error(), json);
  if (!torque) return Report(torque.error(), json);
  const auto along = args.points.Direction();
  if (!along) return Report(along.error(), json);
  auto points = args.points.Points(args.body);
  if (!points) return Report(points.error(), json);
  if (args.body.empty() && points->empty())
    return Report({ErrorCode::kUsage, "--body", "which body is loaded? --body or --point names it"}, json);
  // The load acts at the first point of the loaded body.
  NamedPoint at{args.body.empty() ? points->front().body : args.body};
  const auto first =
      std::find_if(points->begin(), points->end(), [&](const NamedPoint& p) { return p.body == at.body; });
  if (first != points->end()) {
    at = *first;
    points->erase(first);
  }
  auto imported = args.model.Load();
  if (!imported) return Report(imported.error(), json);
  Vector3 gravity_W = imported->scene.gravity;
  if (!args.gravity.empty()) {
    auto given = ParseVector(args.gravity, "--gravity");
    if (!given) return Report(given.error(), json);
    gravity_W = *given;
  }
  auto posed = PoseMechanisms(*imported);
  if (!posed) return Report(posed.error(), json);
  if (!json) PrintNotes(imported->report);
  const DeflectionOptions options{args.lock_free ? OnFreeMotion::kLock : OnFreeMotion::kRefuse, args.buckling,
                                  *points};
  const auto result = Deflect(*posed, {at.body, *force, *torque, at.p_B}, gravity_W, options);
  if (!result) {
    Error error = result.error();
    error.where = args.model.path + (error.where.empty() ? "" : ": " + error.where);
    const auto is_unknown = [&](const NamedPoint& p) { return !FindMechanism(*posed, p.body); };
    if (is_unknown(at) || std::any_of(points->begin(), points->end(), is_unknown)) {
      error.code = ErrorCode::kUsage;  // a word of the command line, not of the file
      error.where = args.model.path + (args.body.empty() || !is_unknown(at) ? ", --point" : ", --body");
    }
    return Report(error, json);
  }
  // Gravity and set-points move it too, far if the pose is none where servos hold it.
  const auto unloaded = Deflect(*posed, {at.body, Vector3::Zero(), Vector3::Zero(), at.p_B}, gravity_W,
                                {options.on_free, 0, {}});
  const Json measured = PointsJson(result->points, *along);

  if (json) {
    Json out = DeflectionJson(result->nonlinear);
    out["unloaded"] = unloaded ? DeflectionJson(unloaded->nonlinear) : Json(nullptr);
    out["linear"] = DeflectionJson(result->linear);
    out["body"] = at.body;
    out["point_m"] = ToJson(at.p_B);
    for (const char* key : {"compliance_world", "stiffness_world", "stiffness_along_axes_N_per_m"})
      out[key] = measured[0]["loaded"][key];
    out["points"] = measured;
    out["frequencies_hz"] = {{"springs", result->spring_frequencies_hz}, {"loaded", result->frequencies_hz}};
    if (args.buckling > 0) out["buckling"] = BucklingJson(*result);
    out["reference_position_m"] = ToJson(result->reference_position_W);
    out["iterations"] = result->iterations;
    out["residual"] = result->residual;
    out["stable"] = result->stable;
    out["lowest_stiffness_Nm"] = result->lowest_stiffness;
    out["branch"] = result->limit_shares.empty() ? "primary" : "beyond limit points";
    out["limit_shares"] = result->limit_shares;
    out["base_held"] = true;
    out["locked"] = result->locked;
    out["warnings"] = result->beyond_stops;
    out["notes"] = NotesJson(imported->report);
    PrintText("{}\n", ToText(out, 2));
    return kDone;
  }
  std::string held = result->floats ? ", base held" : "";
  for (const std::string& name : result->locked) held += fmt::format(", '{}' locked", name);
  PrintText("body '{}' under {} N, {} N m{}\n", at.body, args.force, args.torque, held);
  PrintText("  {:<10} {:>36} {:>36} {:>12}\n", "", "moved by mm", "turned by deg", "joints deg");
  std::vector<std::pair<const char*, Deflection>> rows = {{"linear", result->linear},
                                                          {"nonlinear", result->nonlinear}};
  if (unloaded) rows.emplace_back("unloaded", unloaded->nonlinear);
  for (const auto& [name, d] : rows) {
    const Vector3 mm = 1e3 * (d.position_W - result->reference_position_W), deg = kDegrees * d.rotation_W;
    PrintText("  {:<10} {:>11.4f} {:>11.4f} {:>11.4f}  {:>11.4f} {:>11.4f} {:>11.4f} {:>12.3f}\n", name,
              mm.x(), mm.y(), mm.z(), deg.x(), deg.y(), deg.z(), d.max_joint_rotation * kDegrees);
  }
  for (const std::string& sentence : result->beyond_stops) PrintText("  warning: {}\n", sentence);
  PrintText("  {} equilibrium, lowest eigenvalue of the tangent stiffness {:.4g} N m/rad\n",
            result->stable ? "stable" : "unstable", result->lowest_stiffness);
  PrintText("  frequencies [Hz] of the springs alone: {}; about this equilibrium{}: {}\n",
            HertzText(result->spring_frequencies_hz), held, HertzText(result->frequencies_hz));
  PrintPoints(measured);
  if (args.buckling > 0) PrintBuckling(*result);
  if (!result->limit_shares.empty()) {
    std::string shares;
    for (const double share : result->limit_shares)
      shares += fmt::format("{}{:.3g}", shares.empty() ? "" : ", ", share);
    PrintText(
        "  warning: beyond limit points at {} of the load: it snaps through, and 'run' shows where it ends\n",
        shares);
  }
  if (!result->stable)
    PrintText("  warning: this equilibrium is unstable; a slight push makes the mechanism leave it\n");
  return kDone;
}

}  // namespace

void AddStatics(CLI::App& app, Action& action) {
  auto* command =
      app.add_subcommand("statics", "deflection, stiffness, stability and buckling under a dead load");
  auto args = std::make_shared<StaticsArguments>();
  args->model.AddTo(*command);
  command->add_option("--body", args->body, "body that is loaded (default: that of the first --point)");
  command->add_option("--force", args->force, "x,y,z in N, world axes, fixed in direction");
  command->add_option("--torque", args->torque, "x,y,z in N m, world axes, fixed in direction");
  args->points.AddTo(
      *command,
      "[BODY:]x,y,z in m from the body's origin (default: the loaded body's), in its axes: the "
      "load acts and moves at the first one of its body, at each stiffness is measured; may be "
      "repeated");
  command
      ->add_option("--buckling", args->buckling,
                   "so many lowest multiples of the load at which it buckles (linear), with their modes")
      ->check(CLI::Range(1, 1000));
  command->add_option("--gravity", args->gravity, "x,y,z in m/s^2 instead of the file's");
  command->add_flag("--lock-free", args->lock_free, "lock a joint of each motion that no spring resists");
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
