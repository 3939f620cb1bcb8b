#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "model_arguments.hpp"
#include "output.hpp"
#include "print.hpp"
#include "study/deflection.hpp"

namespace fork1s::app {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

struct StaticsArguments {
  ModelArguments model;
  std::string body, force = "0,0,0", torque = "0,0,0", point = "0,0,0", gravity;
  bool lock_free = false;
  int buckling = 0;
};

Json DeflectionJson(const Deflection& d) {
  return {{"position_m", ToJson(d.position_W)},
          {"rotation_vector_rad", ToJson(d.rotation_W)},
          {"max_joint_rotation_deg", d.max_joint_rotation * kDegrees}};
}

bool Has(const std::vector<PosedMechanism>& mechanisms, const std::string& body) {
  return std::any_of(mechanisms.begin(), mechanisms.end(),
                     [&](const PosedMechanism& p) { return p.mechanism->FindBody(body).valid(); });
}

// Force along an axis per displacement along it, the other axes and rotations free: null where the point is
// rigid.
Json StiffnessAlongAxes(const MatrixX& C) {
  if (C.size() == 0) return nullptr;
  constexpr double kRounding = 1e-12;
  const double largest = C.diagonal().tail<3>().cwiseAbs().maxCoeff();
  Json all = Json::array();
  for (int i = 3; i < 6; ++i)
    all.push_back(std::abs(C(i, i)) > kRounding * largest ? Json(1 / C(i, i)) : Json(nullptr));
  return all;
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

int Run(const StaticsArguments& args) {
  const bool json = args.model.json;
  auto force = ParseVector(args.force, "--force");
  auto torque = ParseVector(args.torque, "--torque");
  if (!force) return Report(force.error(), json);
  if (!torque) return Report(torque.error(), json);
  auto point = ParseVector(args.point, "--point");
  if (!point) return Report(point.error(), json);
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
  const OnFreeMotion on_free = args.lock_free ? OnFreeMotion::kLock : OnFreeMotion::kRefuse;
  const auto result =
      Deflect(*posed, {args.body, *force, *torque, *point}, gravity_W, on_free, args.buckling);
  if (!result) {
    Error error = result.error();
    error.where = args.model.path + (error.where.empty() ? "" : ": " + error.where);
    if (!Has(*posed, args.body)) {  // a word of the command line, not of the file
      error.code = ErrorCode::kUsage;
      error.where = args.model.path + ", --body";
    }
    return Report(error, json);
  }
  // Gravity and set-points move it too, far if the pose is none where servos hold it.
  const auto unloaded =
      Deflect(*posed, {args.body, Vector3::Zero(), Vector3::Zero(), *point}, gravity_W, on_free);

  if (json) {
    Json out = DeflectionJson(result->nonlinear);
    out["unloaded"] = unloaded ? DeflectionJson(unloaded->nonlinear) : Json(nullptr);
    out["linear"] = DeflectionJson(result->linear);
    out["body"] = args.body;
    out["point_m"] = ToJson(*point);
    out["compliance_world"] = ToJson(result->compliance.C);
    out["stiffness_world"] = ToJson(result->stiffness);
    out["stiffness_along_axes_N_per_m"] = StiffnessAlongAxes(result->compliance.C);
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
  PrintText("body '{}' under {} N, {} N m{}\n", args.body, args.force, args.torque, held);
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
  PrintText("  {} equilibrium, lowest eigenvalue of the tangent stiffness {:.4g} N m\n",
            result->stable ? "stable" : "unstable", result->lowest_stiffness);
  const Json along = StiffnessAlongAxes(result->compliance.C);
  if (!along.is_null()) {
    std::string text;
    for (const Json& k : along) text += k.is_null() ? "  rigid" : fmt::format("  {:.5g}", k.get<double>());
    PrintText("  stiffness about it along x, y, z [N/m]:{}\n", text);
  }
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
  command->add_option("--body", args->body, "body that is loaded")->required();
  command->add_option("--force", args->force, "x,y,z in N, world axes, fixed in direction");
  command->add_option("--torque", args->torque, "x,y,z in N m, world axes, fixed in direction");
  command->add_option(
      "--point", args->point,
      "x,y,z in m from the body's origin, in its axes: where the load acts, moves and stiffness "
      "are measured");
  command
      ->add_option("--buckling", args->buckling,
                   "so many lowest multiples of the load at which it buckles (linear), with their modes")
      ->check(CLI::Range(1, 1000));
  command->add_option("--gravity", args->gravity, "x,y,z in m/s^2 instead of the file's");
  command->add_flag("--lock-free", args->lock_free, "lock a joint of each motion that no spring resists");
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
