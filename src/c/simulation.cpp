#include "simulation.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/sim/queries.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>
#include <optional>
#include <utility>

#include "base/near_names.hpp"
#include "options.hpp"
#include "sim/point_springs.hpp"

namespace fork1s::c {

void ReadName(const std::vector<std::string>& names, const char* what, std::int32_t index,
              const char** name) {
  RequireGiven(name, "name");
  *name = names[RequireIndex(what, index, names.size())].c_str();
}

void RequireFinite(const double* numbers, std::size_t count, const char* argument) {
  for (std::size_t i = 0; i < count; ++i)
    if (!std::isfinite(numbers[i]))
      Misuse(std::string(argument) + " must be finite, and entry " + std::to_string(i) + " is " +
             std::to_string(numbers[i]));
}

Vector3 ReadVector(const double* numbers, const char* argument) {
  if (!numbers) return Vector3::Zero();
  RequireFinite(numbers, 3, argument);
  return Vector3(numbers[0], numbers[1], numbers[2]);
}

namespace {

SimulationOptions OptionsOf(const Model& model, const char* text) {
  RunOptions options = ReadRunOptions(text);
  options.simulation.initial_keyframe = model.imported.initial_keyframe;
  if (!options.keyframe) return options.simulation;
  std::vector<std::string> names;
  for (const KeyframeDef& key : model.imported.scene.keyframes) names.push_back(key.name);
  const auto at = std::find(names.begin(), names.end(), *options.keyframe);
  if (at == names.end())
    Misuse("option 'keyframe': there is no keyframe '" + *options.keyframe + "'" +
           Suggestion(*options.keyframe, names));
  options.simulation.initial_keyframe = static_cast<int>(at - names.begin());
  return options.simulation;
}

std::vector<SensorPlace> FindSensors(Run& run) {
  const Sensors& sensors = run.sensors.emplace(run.simulation);
  std::vector<SensorPlace> places;
  int first = 0;
  for (int i = 0; i < sensors.count(); ++i) {
    const auto count = static_cast<int>(sensors[i].size());
    places.push_back({sensors.definition(i).name, sensors.definition(i).reason, first, count});
    first += count;
  }
  return places;
}

fork1s_report Step(Run& run, int steps, bool move) {
  Simulation& simulation = run.simulation;
  const auto pushes = std::exchange(run.pushes, {});
  const internal::StepTotals all = internal::RunSteps(simulation, steps, move, [&](int) {
    for (const internal::BodyPush& p : pushes)
      simulation.ApplyWrench(p.body, p.force_W, p.moment_W, simulation.Pose(p.body) * p.point_B);
  });
  return {.steps = all.steps,
          .contacts = all.contacts,
          .limits = all.limits,
          .forces_at_bound = all.forces_at_bound,
          .unconverged = all.unconverged,
          .halved = all.halved,
          .refreshes = all.refreshes,
          .failed_refreshes = all.failed_refreshes,
          .contacts_dropped = all.contacts_dropped,
          .finite = all.finite,
          .max_penetration = all.max_penetration,
          .residual = all.residual,
          .stage_residual = all.stage_residual};
}

// Position [m], then the unit quaternion with w first and w >= 0.
void WritePose(const RigidTransform& X, double* out) {
  const Quaternion q = X.quaternion();
  const double sign = q.w() < 0 ? -1 : 1;
  const Vector3& p = X.translation();
  const double numbers[7] = {p.x(), p.y(), p.z(), sign * q.w(), sign * q.x(), sign * q.y(), sign * q.z()};
  std::copy(numbers, numbers + 7, out);
}

std::int32_t Count(std::size_t count) { return static_cast<std::int32_t>(count); }

}  // namespace
}  // namespace fork1s::c

using namespace fork1s::c;
using fork1s::Simulation;

fork1s_status fork1s_simulation_create(const fork1s_model* model, const char* options,
                                       fork1s_simulation** simulation) {
  return Guard(__func__, [&] {
    RequireGiven(model, "model");
    RequireGiven(simulation, "simulation");
    const Model& from = *model->model;
    Simulation made =
        ValueOrThrow(Simulation::Create(from.imported.scene, OptionsOf(from, options)), from.origin);
    Run run(model->model, std::move(made));
    for (const fork1s::SceneBody& body : run.simulation.bodies()) run.body_names.push_back(body.name);
    run.control_names = run.simulation.control_names();
    run.warnings = run.simulation.warnings();
    run.sensor_places = FindSensors(run);
    run.start = Save(run);
    *simulation = new fork1s_simulation{std::move(run)};
  });
}

void fork1s_simulation_free(fork1s_simulation* simulation) { delete simulation; }

fork1s_status fork1s_simulation_num_warnings(const fork1s_simulation* simulation, int32_t* count) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(count, "count");
    *count = Count(run.warnings.size());
  });
}

fork1s_status fork1s_simulation_warning(const fork1s_simulation* simulation, int32_t index,
                                        const char** text) {
  return GuardRun(__func__, simulation,
                  [&](const Run& run) { ReadName(run.warnings, "warning", index, text); });
}

fork1s_status fork1s_simulation_step(fork1s_simulation* simulation, int32_t steps, int32_t controls,
                                     fork1s_report* report) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    if (steps < 0) Misuse("steps is " + std::to_string(steps) + "; give 0 or more");
    if (controls != FORK1S_HOLD && controls != FORK1S_MOVE)
      Misuse("controls is " + std::to_string(controls) + "; give FORK1S_HOLD or FORK1S_MOVE");
    const fork1s_report made = Step(run, steps, controls == FORK1S_MOVE);
    if (report) *report = made;
    if (made.finite == 0)
      throw Refused{
          {fork1s::ErrorCode::kNumerics, "step " + std::to_string(made.steps + 1),
           "could not be solved even in its shortest parts and was undone; take a smaller dt, or look for "
           "forces and stiffnesses that are too large"}};
  });
}

fork1s_status fork1s_simulation_time(const fork1s_simulation* simulation, double* time) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(time, "time");
    *time = run.time();
  });
}

fork1s_status fork1s_simulation_dt(const fork1s_simulation* simulation, double* dt) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(dt, "dt");
    *dt = run.simulation.dt();
  });
}

fork1s_status fork1s_simulation_energy(const fork1s_simulation* simulation, double* kinetic,
                                       double* potential) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    if (kinetic) *kinetic = run.simulation.KineticEnergy();
    if (potential) *potential = run.simulation.PotentialEnergy();
  });
}

fork1s_status fork1s_simulation_hash(const fork1s_simulation* simulation, uint64_t* hash) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(hash, "hash");
    *hash = run.simulation.HashState();
  });
}

fork1s_status fork1s_simulation_num_controls(const fork1s_simulation* simulation, int32_t* count) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(count, "count");
    *count = Count(run.control_names.size());
  });
}

fork1s_status fork1s_simulation_control_name(const fork1s_simulation* simulation, int32_t control,
                                             const char** name) {
  return GuardRun(__func__, simulation,
                  [&](const Run& run) { ReadName(run.control_names, "control", control, name); });
}

fork1s_status fork1s_simulation_find_control(const fork1s_simulation* simulation, const char* name,
                                             int32_t* control) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(name, "name");
    RequireGiven(control, "control");
    *control = ValueOrThrow(fork1s::ControlNamed(run.simulation, name));
  });
}

fork1s_status fork1s_simulation_control_range(const fork1s_simulation* simulation, int32_t control,
                                              double* lower, double* upper) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(lower, "lower");
    RequireGiven(upper, "upper");
    const std::size_t at = RequireIndex("control", control, run.simulation.control_names().size());
    *lower = run.simulation.control_lower()(static_cast<Eigen::Index>(at));
    *upper = run.simulation.control_upper()(static_cast<Eigen::Index>(at));
  });
}

fork1s_status fork1s_simulation_controls(const fork1s_simulation* simulation, double* values, size_t length) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    const fork1s::VectorX& set = run.simulation.controls();
    RequireLength(values, length, static_cast<std::size_t>(set.size()), "values");
    std::copy(set.data(), set.data() + set.size(), values);
  });
}

fork1s_status fork1s_simulation_set_control(fork1s_simulation* simulation, int32_t control, double value) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    RequireIndex("control", control, run.control_names.size());
    run.simulation.SetControl(control, value);
  });
}

fork1s_status fork1s_simulation_set_controls(fork1s_simulation* simulation, const double* values,
                                             size_t length) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    RequireLength(values, length, run.control_names.size(), "values");
    run.simulation.SetControls(Eigen::Map<const fork1s::VectorX>(values, static_cast<Eigen::Index>(length)));
  });
}

fork1s_status fork1s_simulation_set_control_rate(fork1s_simulation* simulation, int32_t control,
                                                 double rate) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    RequireIndex("control", control, run.control_names.size());
    run.simulation.SetBaseRate(control, rate);
  });
}

fork1s_status fork1s_simulation_start_from_controls(fork1s_simulation* simulation) {
  return GuardRun(__func__, simulation, [&](Run& run) { run.simulation.StartFromControls(); });
}

fork1s_status fork1s_simulation_num_bodies(const fork1s_simulation* simulation, int32_t* count) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(count, "count");
    *count = Count(run.body_names.size());
  });
}

fork1s_status fork1s_simulation_body_name(const fork1s_simulation* simulation, int32_t body,
                                          const char** name) {
  return GuardRun(__func__, simulation,
                  [&](const Run& run) { ReadName(run.body_names, "body", body, name); });
}

fork1s_status fork1s_simulation_find_body(const fork1s_simulation* simulation, const char* name,
                                          int32_t* body) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(name, "name");
    RequireGiven(body, "body");
    *body = ValueOrThrow(fork1s::BodyNamed(run.simulation, name));
  });
}

fork1s_status fork1s_simulation_poses(const fork1s_simulation* simulation, double* poses, size_t length) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireLength(poses, length, 7 * run.body_names.size(), "poses");
    std::vector<fork1s::RigidTransform> X_WB;
    run.simulation.Poses(X_WB);
    for (std::size_t i = 0; i < X_WB.size(); ++i) WritePose(X_WB[i], poses + 7 * i);
  });
}

fork1s_status fork1s_simulation_pose(const fork1s_simulation* simulation, int32_t body, double pose[7]) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireIndex("body", body, run.body_names.size());
    RequireGiven(pose, "pose");
    WritePose(run.simulation.Pose(body), pose);
  });
}

fork1s_status fork1s_simulation_velocities(const fork1s_simulation* simulation, double* velocities,
                                           size_t length) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireLength(velocities, length, 6 * run.body_names.size(), "velocities");
    for (std::size_t i = 0; i < run.body_names.size(); ++i) {
      const fork1s::Vector6 V = run.simulation.Velocity(static_cast<int>(i));
      std::copy(V.data(), V.data() + 6, velocities + 6 * i);
    }
  });
}

fork1s_status fork1s_simulation_push(fork1s_simulation* simulation, int32_t body, const double force[3],
                                     const double torque[3], const double point[3]) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    RequireIndex("body", body, run.body_names.size());
    fork1s::internal::BodyPush push{body, ReadVector(force, "force"), ReadVector(torque, "torque"),
                                    fork1s::Vector3::Zero()};
    if (point) push.point_B = run.simulation.Pose(body).inverse() * ReadVector(point, "point");
    run.pushes.push_back(push);
  });
}

fork1s_status fork1s_simulation_pull(fork1s_simulation* simulation, int32_t body, const double point[3],
                                     const double target[3], double stiffness, double damping) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    RequireIndex("body", body, run.body_names.size());
    RequireGiven(target, "target");
    const auto point_W = point ? std::optional(ReadVector(point, "point")) : std::nullopt;
    // A NaN is refused as such.
    const auto given = damping < 0 ? std::nullopt : std::optional(damping);
    ValueOrThrow(fork1s::internal::Pull(body, point_W, ReadVector(target, "target"), stiffness, given,
                                        run.simulation));
  });
}

fork1s_status fork1s_simulation_release(fork1s_simulation* simulation, int32_t body) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    if (body == -1) return run.simulation.ClearPointSprings();
    RequireIndex("body", body, run.body_names.size());
    fork1s::internal::Release(body, run.simulation);
  });
}
