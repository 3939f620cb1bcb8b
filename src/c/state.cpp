// State of joints, sensors, contacts and moments to come back to.
#include <algorithm>
#include <cmath>
#include <fork1s/importer/file_state.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <span>
#include <sstream>
#include <utility>

#include "base/near_names.hpp"
#include "sim/point_springs.hpp"
#include "sim/restart.hpp"
#include "simulation.hpp"

namespace fork1s::c {

Moment Save(const Run& run) {
  return {run.model,       run.simulation.Save(), run.simulation.dt(),
          run.time_before, run.state_change,      run.pushes};
}

namespace {

void Restore(const Moment& moment, Run& run) {
  if (moment.model != run.model)
    Misuse("the snapshot is of another model; restore those of simulations of this fork1s_model");
  if (moment.dt != run.simulation.dt()) {
    std::ostringstream text;
    text << "the snapshot is of another dt, " << moment.dt << " s, than this simulation, "
         << run.simulation.dt() << " s; make a simulation of that dt";
    Misuse(text.str());
  }
  ValueOrThrow(run.simulation.Restore(moment.simulation), run.model->origin);
  run.time_before = moment.time_before;
  run.state_change = moment.state_change;
  run.pushes = moment.pushes;
}

FileState StateOf(const Run& run) {
  return ComputeFileState(run.model->joints, run.model->imported.scene, run.simulation.State());
}

// Values of `joints` before that of `index`, or of all.
int CountBefore(const std::vector<FileJoint>& joints, std::size_t index, int (FileJoint::*count)() const) {
  int sum = 0;
  for (std::size_t i = 0; i < index; ++i) sum += (joints[i].*count)();
  return sum;
}

void CopyTo(const VectorX& from, double* to, std::size_t length, const char* argument) {
  RequireLength(to, length, static_cast<std::size_t>(from.size()), argument);
  std::copy(from.data(), from.data() + from.size(), to);
}

// Numbers that are given take the place of those in `state`.
void Replace(const double* given, std::size_t length, const char* argument, VectorX& state) {
  if (!given && length == 0) return;
  RequireLength(given, length, static_cast<std::size_t>(state.size()), argument);
  RequireFinite(given, length, argument);
  std::copy(given, given + length, state.data());
}

template <class Element>
std::int32_t FindNamed(const std::vector<Element>& all, const char* what, const std::string& name) {
  std::vector<std::string> names;
  for (const Element& element : all) names.push_back(element.name);
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end())
    Misuse(std::string("there is no ") + what + " '" + name + "'" + Suggestion(name, names));
  return static_cast<std::int32_t>(at - names.begin());
}

int NumSensorValues(const Run& run) {
  return run.sensor_places.empty() ? 0 : run.sensor_places.back().first + run.sensor_places.back().count;
}

void ReadSensors(const Run& run, double* values) {
  if (run.sensors)
    run.sensors->Update(run.simulation);
  else
    run.sensors.emplace(run.simulation);
  const VectorX& all = run.sensors->values();
  std::copy(all.data(), all.data() + all.size(), values);
  // Since the simulation was made, also where a state was set in between.
  for (int i = 0; i < run.sensors->count(); ++i)
    if (const SensorDef& sensor = run.sensors->definition(i); sensor.kind == SensorKind::kTime)
      values[run.sensor_places[static_cast<std::size_t>(i)].first] =
          std::clamp(run.time(), sensor.clip_lower, sensor.clip_upper);
}

fork1s_contact ToRow(const BodyContact& contact) {
  fork1s_contact row{};
  row.body_a = contact.body_a;
  row.body_b = contact.body_b;
  Eigen::Map<Vector3>(row.point) = contact.point_W;
  Eigen::Map<Vector3>(row.normal) = contact.normal_W;
  Eigen::Map<Vector3>(row.force) = contact.force_W;
  Eigen::Map<Vector3>(row.torque) = contact.moment_W;
  row.gap = contact.gap;
  row.friction = contact.friction;
  return row;
}

// A number that is one of the run's.
template <class F>
fork1s_status GuardNumber(const char* function, const fork1s_simulation* simulation, void* out,
                          const char* argument, const F& write) noexcept {
  return GuardRun(function, simulation, [&](const Run& run) {
    RequireGiven(out, argument);
    write(run);
  });
}

}  // namespace
}  // namespace fork1s::c

using namespace fork1s::c;
using fork1s::FileJoint;

fork1s_status fork1s_simulation_num_joints(const fork1s_simulation* simulation, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count",
                     [&](const Run& run) { *count = static_cast<int32_t>(run.model->joints.size()); });
}

fork1s_status fork1s_simulation_joint(const fork1s_simulation* simulation, int32_t index,
                                      fork1s_joint* joint) {
  return GuardNumber(__func__, simulation, joint, "joint", [&](const Run& run) {
    const std::vector<FileJoint>& joints = run.model->joints;
    const std::size_t at = RequireIndex("joint", index, joints.size());
    joint->name = joints[at].name.c_str();
    constexpr int32_t kKinds[] = {FORK1S_JOINT_FREE, FORK1S_JOINT_BALL, FORK1S_JOINT_SLIDE,
                                  FORK1S_JOINT_HINGE};
    joint->kind = kKinds[static_cast<int>(joints[at].kind)];
    joint->first_position = CountBefore(joints, at, &FileJoint::num_positions);
    joint->num_positions = joints[at].num_positions();
    joint->first_velocity = CountBefore(joints, at, &FileJoint::num_velocities);
    joint->num_velocities = joints[at].num_velocities();
  });
}

fork1s_status fork1s_simulation_find_joint(const fork1s_simulation* simulation, const char* name,
                                           int32_t* index) {
  return GuardNumber(__func__, simulation, index, "index", [&](const Run& run) {
    RequireGiven(name, "name");
    *index = FindNamed(run.model->joints, "joint that moves", name);
  });
}

fork1s_status fork1s_simulation_num_joint_positions(const fork1s_simulation* simulation, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count", [&](const Run& run) {
    *count = CountBefore(run.model->joints, run.model->joints.size(), &FileJoint::num_positions);
  });
}

fork1s_status fork1s_simulation_num_joint_velocities(const fork1s_simulation* simulation, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count", [&](const Run& run) {
    *count = CountBefore(run.model->joints, run.model->joints.size(), &FileJoint::num_velocities);
  });
}

fork1s_status fork1s_simulation_joint_positions(const fork1s_simulation* simulation, double* positions,
                                                size_t length) {
  return GuardRun(__func__, simulation,
                  [&](const Run& run) { CopyTo(StateOf(run).positions, positions, length, "positions"); });
}

fork1s_status fork1s_simulation_joint_velocities(const fork1s_simulation* simulation, double* velocities,
                                                 size_t length) {
  return GuardRun(__func__, simulation,
                  [&](const Run& run) { CopyTo(StateOf(run).velocities, velocities, length, "velocities"); });
}

fork1s_status fork1s_simulation_set_joint_state(fork1s_simulation* simulation, const double* positions,
                                                size_t num_positions, const double* velocities,
                                                size_t num_velocities) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    const fork1s::Scene& scene = run.model->imported.scene;
    fork1s::KeyframeDef state = run.simulation.State();
    fork1s::FileState file = StateOf(run);
    Replace(positions, num_positions, "positions", file.positions);
    Replace(velocities, num_velocities, "velocities", file.velocities);
    ValueOrThrow(fork1s::ApplyFileState(run.model->joints, scene, file, state));
    auto next = ValueOrThrow(fork1s::internal::RestartAt(run.simulation, state, scene.keyframes.size()),
                             run.model->origin);
    fork1s::internal::SetPointSprings(fork1s::internal::PointSprings(run.simulation), next.simulation);
    run.time_before = run.time();
    run.simulation = std::move(next.simulation);
    run.sensors.reset();
    run.state_change = next.change;
  });
}

fork1s_status fork1s_simulation_state_change(const fork1s_simulation* simulation, double* change) {
  return GuardNumber(__func__, simulation, change, "change",
                     [&](const Run& run) { *change = run.state_change; });
}

fork1s_status fork1s_simulation_num_sensors(const fork1s_simulation* simulation, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count",
                     [&](const Run& run) { *count = static_cast<int32_t>(run.sensor_places.size()); });
}

fork1s_status fork1s_simulation_sensor(const fork1s_simulation* simulation, int32_t index,
                                       fork1s_sensor* sensor) {
  return GuardNumber(__func__, simulation, sensor, "sensor", [&](const Run& run) {
    const SensorPlace& place = run.sensor_places[RequireIndex("sensor", index, run.sensor_places.size())];
    *sensor = {place.name.c_str(), place.reason.c_str(), place.first, place.count};
  });
}

fork1s_status fork1s_simulation_find_sensor(const fork1s_simulation* simulation, const char* name,
                                            int32_t* index) {
  return GuardNumber(__func__, simulation, index, "index", [&](const Run& run) {
    RequireGiven(name, "name");
    *index = FindNamed(run.sensor_places, "sensor", name);
  });
}

fork1s_status fork1s_simulation_num_sensor_values(const fork1s_simulation* simulation, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count",
                     [&](const Run& run) { *count = NumSensorValues(run); });
}

fork1s_status fork1s_simulation_sensor_values(const fork1s_simulation* simulation, double* values,
                                              size_t length) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireLength(values, length, static_cast<std::size_t>(NumSensorValues(run)), "values");
    ReadSensors(run, values);
  });
}

fork1s_status fork1s_simulation_num_contacts(const fork1s_simulation* simulation, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count", [&](const Run& run) {
    *count = static_cast<int32_t>(fork1s::Contacts(run.simulation).size());
  });
}

fork1s_status fork1s_simulation_contacts(const fork1s_simulation* simulation, fork1s_contact* contacts,
                                         size_t length, int32_t* count) {
  return GuardNumber(__func__, simulation, count, "count", [&](const Run& run) {
    const auto all = fork1s::Contacts(run.simulation);
    if (length < all.size())
      Misuse("contacts has length " + std::to_string(length) + " and needs " + std::to_string(all.size()));
    if (!all.empty()) RequireGiven(contacts, "contacts");
    std::transform(all.begin(), all.end(), contacts, ToRow);
    *count = static_cast<int32_t>(all.size());
  });
}

fork1s_status fork1s_simulation_friction_uses(const fork1s_simulation* simulation, double* uses,
                                              size_t length) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    const auto all = fork1s::Contacts(run.simulation);
    RequireLength(uses, length, all.size(), "uses");
    std::transform(all.begin(), all.end(), uses, [](const fork1s::BodyContact& c) {
      return fork1s::ContactLoad::OfContact(c.force_W, c.normal_W, c.friction).FrictionUse();
    });
  });
}

fork1s_status fork1s_simulation_ray(const fork1s_simulation* simulation, const double origin[3],
                                    const double direction[3], double reach, int32_t* found,
                                    fork1s_ray_hit* hit) {
  return GuardRun(__func__, simulation, [&](const Run& run) {
    RequireGiven(origin, "origin");
    RequireGiven(direction, "direction");
    RequireGiven(found, "found");
    RequireGiven(hit, "hit");
    const fork1s::Vector3 from = ReadVector(origin, "origin"), along = ReadVector(direction, "direction");
    if (!(along.norm() > 0) || !std::isfinite(along.norm()))
      Misuse("direction must not be zero, nor so long that its square is infinite");
    if (!(reach >= 0)) Misuse("reach must be 0 m or more");
    if (!run.rays) run.rays = ValueOrThrow(fork1s::RayCaster::Create(run.simulation), run.model->origin);
    const auto met = run.rays->Cast(run.simulation, from, along, reach);
    *found = met ? 1 : 0;
    if (!met) return;
    hit->body = met->body;
    hit->distance = met->distance;
    Eigen::Map<fork1s::Vector3>(hit->point) = met->point_W;
    Eigen::Map<fork1s::Vector3>(hit->normal) = met->normal_W;
  });
}

fork1s_status fork1s_simulation_save(const fork1s_simulation* simulation, fork1s_snapshot** snapshot) {
  return GuardNumber(__func__, simulation, snapshot, "snapshot",
                     [&](const Run& run) { *snapshot = new fork1s_snapshot{Save(run)}; });
}

fork1s_status fork1s_simulation_restore(fork1s_simulation* simulation, const fork1s_snapshot* snapshot) {
  return GuardRun(__func__, simulation, [&](Run& run) {
    RequireGiven(snapshot, "snapshot");
    Restore(snapshot->moment, run);
  });
}

void fork1s_snapshot_free(fork1s_snapshot* snapshot) { delete snapshot; }

fork1s_status fork1s_simulation_reset(fork1s_simulation* simulation) {
  return GuardRun(__func__, simulation, [&](Run& run) { Restore(Moment(run.start), run); });
}
