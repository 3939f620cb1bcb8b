#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <fork1s/study/deflection.hpp>
#include <memory>
#include <numbers>
#include <vector>

#include "model_arguments.hpp"
#include "output.hpp"

namespace fork1s::app {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

struct StaticsArguments {
  ModelArguments model;
  std::string body, force = "0,0,0", torque = "0,0,0", gravity;
  bool lock_free = false;
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

int Run(const StaticsArguments& args) {
  const bool json = args.model.json;
  auto force = ParseVector(args.force, "--force");
  auto torque = ParseVector(args.torque, "--torque");
  if (!force) return Report(force.error(), json);
  if (!torque) return Report(torque.error(), json);
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
  const auto result = Deflect(*posed, {args.body, *force, *torque}, gravity_W, on_free);
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
  const auto unloaded = Deflect(*posed, {args.body, Vector3::Zero(), Vector3::Zero()}, gravity_W, on_free);

  if (json) {
    Json out = DeflectionJson(result->nonlinear);
    out["unloaded"] = unloaded ? DeflectionJson(unloaded->nonlinear) : Json(nullptr);
    out["linear"] = DeflectionJson(result->linear);
    out["body"] = args.body;
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
    fmt::print("{}\n", ToText(out, 2));
    return kDone;
  }
  std::string held = result->floats ? ", base held" : "";
  for (const std::string& name : result->locked) held += fmt::format(", '{}' locked", name);
  fmt::print("body '{}' under {} N, {} N m{}\n", args.body, args.force, args.torque, held);
  fmt::print("  {:<10} {:>36} {:>36} {:>12}\n", "", "moved by mm", "turned by deg", "joints deg");
  std::vector<std::pair<const char*, Deflection>> rows = {{"linear", result->linear},
                                                          {"nonlinear", result->nonlinear}};
  if (unloaded) rows.emplace_back("unloaded", unloaded->nonlinear);
  for (const auto& [name, d] : rows) {
    const Vector3 mm = 1e3 * (d.position_W - result->reference_position_W), deg = kDegrees * d.rotation_W;
    fmt::print("  {:<10} {:>11.4f} {:>11.4f} {:>11.4f}  {:>11.4f} {:>11.4f} {:>11.4f} {:>12.3f}\n", name,
               mm.x(), mm.y(), mm.z(), deg.x(), deg.y(), deg.z(), d.max_joint_rotation * kDegrees);
  }
  for (const std::string& sentence : result->beyond_stops) fmt::print("  warning: {}\n", sentence);
  fmt::print("  {} equilibrium, lowest eigenvalue of the tangent stiffness {:.4g} N m\n",
             result->stable ? "stable" : "unstable", result->lowest_stiffness);
  if (!result->limit_shares.empty()) {
    std::string shares;
    for (const double share : result->limit_shares)
      shares += fmt::format("{}{:.3g}", shares.empty() ? "" : ", ", share);
    fmt::print(
        "  warning: beyond limit points at {} of the load: it snaps through, and 'run' shows where it ends\n",
        shares);
  }
  if (!result->stable)
    fmt::print("  warning: this equilibrium is unstable; a slight push makes the mechanism leave it\n");
  return kDone;
}

}  // namespace

void AddStatics(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("statics", "linear and nonlinear deflection under a dead load");
  auto args = std::make_shared<StaticsArguments>();
  args->model.AddTo(*command);
  command->add_option("--body", args->body, "body that is loaded, at its origin")->required();
  command->add_option("--force", args->force, "x,y,z in N, world axes, fixed in direction");
  command->add_option("--torque", args->torque, "x,y,z in N m, world axes, fixed in direction");
  command->add_option("--gravity", args->gravity, "x,y,z in m/s^2 instead of the file's");
  command->add_flag("--lock-free", args->lock_free, "lock a joint of each motion that no spring resists");
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
