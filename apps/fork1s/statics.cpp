#include <fmt/format.h>
#include <cmath>
#include <fork1s/reduction/statics.hpp>
#include <memory>
#include <numbers>

#include "model_arguments.hpp"
#include "output.hpp"

namespace fork1s::app {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

struct StaticsArguments {
  ModelArguments model;
  std::string body, force = "0,0,0", torque = "0,0,0", gravity;
};

struct Deflection {
  Vector3 position, rotation;
  double max_joint_rotation = 0;
};

Json DeflectionJson(const Deflection& d) {
  return {{"position_m", ToJson(d.position)},
          {"rotation_vector_rad", ToJson(d.rotation)},
          {"max_joint_rotation_deg", d.max_joint_rotation * kDegrees}};
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
  const PosedMechanism* at = nullptr;
  BodyIndex body;
  for (const PosedMechanism& p : *posed)
    if (BodyIndex b = p.mechanism->FindBody(args.body); b.valid()) {
      at = &p;
      body = b;
    }
  if (!at) {
    std::string names;
    for (const PosedMechanism& p : *posed)
      for (const auto& b : p.mechanism->bodies()) names += (names.empty() ? "" : ", ") + b.name;
    return Report({ErrorCode::kModel, args.model.path,
                   fmt::format("no mechanism has a body '{}'; there are: {}", args.body, names)},
                  json);
  }
  if (!json) PrintNotes(imported->report);
  const Mechanism& m = *at->mechanism;
  const RigidTransform X_WR = m.definition().X_WR;
  const Matrix3 R_RW = X_WR.rotation().transpose();
  StaticsOptions options;
  options.gravity_R = R_RW * gravity_W;
  options.controls.resize(static_cast<Eigen::Index>(m.controls().size()));
  for (std::size_t i = 0; i < m.controls().size(); ++i)
    options.controls(static_cast<Eigen::Index>(i)) = m.controls()[i].initial;
  const std::vector<DeadLoad> loads{{body, R_RW * *force, R_RW * *torque}};

  Kinematics reference(m);
  ComputeKinematics(m, at->q, reference);
  const RigidTransform X_ref = X_WR * reference.X_RB[body.u()];

  auto refuse = [&](Error error) {
    error.where = args.model.path + ": " + error.where;
    return Report(error, json);
  };
  auto linear_q = LinearDeflection(m, at->q, loads, options);
  if (!linear_q) return refuse(linear_q.error());
  const Vector6 V = BodyJacobian(m, reference, body) * (*linear_q - at->q);
  Deflection linear;
  linear.rotation = X_WR.rotation() * V.head<3>();
  linear.position =
      X_ref.translation() +
      X_WR.rotation() * (V.tail<3>() + V.head<3>().cross(reference.X_RB[body.u()].translation()));
  linear.max_joint_rotation = MaxJointRotation(m, at->q, *linear_q);

  const StaticsResult result = SolveStatics(m, at->q, loads, options);
  if (!result.converged)
    return refuse(
        {ErrorCode::kNumerics, fmt::format("mechanism '{}'", m.name()),
         fmt::format("found no equilibrium under this load after {} Newton steps (residual {:.2g} of the "
                     "forces): it may buckle; lower the load or stiffen the joints",
                     result.iterations, result.residual)});
  Kinematics loaded(m);
  ComputeKinematics(m, result.q, loaded);
  const RigidTransform X = X_WR * loaded.X_RB[body.u()];
  Deflection nonlinear;
  nonlinear.position = X.translation();
  nonlinear.rotation = LogRotation(X.rotation() * X_ref.rotation().transpose());
  nonlinear.max_joint_rotation = MaxJointRotation(m, at->q, result.q);

  if (json) {
    Json out = DeflectionJson(nonlinear);
    out["linear"] = DeflectionJson(linear);
    out["body"] = args.body;
    out["reference_position_m"] = ToJson(X_ref.translation());
    out["iterations"] = result.iterations;
    out["residual"] = result.residual;
    out["stable"] = result.stable;
    out["base_held"] = true;
    out["notes"] = NotesJson(imported->report);
    fmt::print("{}\n", ToText(out, 2));
    return kDone;
  }
  fmt::print("body '{}' under {} N, {} N m{}\n", args.body, args.force, args.torque,
             m.base() == BaseKind::kFloating ? ", base held" : "");
  fmt::print("  {:<10} {:>36} {:>36} {:>12}\n", "", "moved by mm", "turned by deg", "joints deg");
  for (const auto& [name, d] : {std::pair{"linear", linear}, {"nonlinear", nonlinear}}) {
    const Vector3 mm = 1e3 * (d.position - X_ref.translation()), deg = kDegrees * d.rotation;
    fmt::print("  {:<10} {:>11.4f} {:>11.4f} {:>11.4f}  {:>11.4f} {:>11.4f} {:>11.4f} {:>12.3f}\n", name,
               mm.x(), mm.y(), mm.z(), deg.x(), deg.y(), deg.z(), d.max_joint_rotation * kDegrees);
  }
  if (!result.stable)
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
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
