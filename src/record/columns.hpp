// The arrays of a recording: one list for the writer, the reader and the checksum.
#pragma once

#include <bit>
#include <cstdint>
#include <fork1s/record/recording.hpp>
#include <string>
#include <type_traits>
#include <vector>

namespace fork1s::internal {

inline constexpr int kFormatVersion = 24;
// Values of sensors are recorded since this one.
inline constexpr int kVersionOfSensors = 20;
// The oldest version that is read, as are all up to kFormatVersion. Couplings have terms since 19, controls activations since
// 21, scenes adhesions since 22, switched closures since 23, surfaces that move and friction by direction since 24. Steps of version 17 differ as well and are not replayed:
// `theta` and stepping by twists were other integrators, `euler` had other rules.
inline constexpr int kVersionOfOtherSteps = 17;
inline constexpr const char* kFormatName = "fork1s recording";

/// Values per row.
struct Widths {
  int controls = 0, base_rates = 0, bodies = 0, coordinates = 0, sensors = 0, mechanisms = 0;
};

/// Of the columns of a recording (step_reader.cpp).
Widths WidthsOf(const RecordingHeader& header);

/// Rows of a column are steps, or those of a table of which a step has any number.
enum class Rows { kSteps, kReduced, kContacts, kWrenches, kPointSprings };
inline constexpr std::size_t kNumRows = 5;

struct Column {
  const char* name;  // path in the file
  Rows rows = Rows::kSteps;
  int width = 1;  // values per row; 0: the file has no such dataset
  int inner = 0;  // last dimension where a row has two: [width / inner][inner]
  const char* unit = "";
  const char* text = "";
};

/// Names of all values of the sensors of a scene, in their order: NAME where it has one value, else NAME.0, ...
inline std::vector<std::string> SensorValueNames(const Scene& scene) {
  std::vector<std::string> names;
  for (const SensorDef& sensor : scene.sensors)
    for (int k = 0; k < sensor.size; ++k)
      names.push_back(sensor.size == 1 ? sensor.name : sensor.name + "." + std::to_string(k));
  return names;
}

/// Calls f(column, values) for every column.
template <class Steps, class F>
void ForEachColumn(Steps& s, const Widths& n, F&& f) {
  constexpr auto kS = Rows::kSteps;
  f(Column{"steps/time", kS, 1, 0, "s", "time after the step"}, s.time);
  f(Column{"steps/hash", kS, 1, 0, "", "64-bit FNV-1a over the bits of the moving state after the step"},
    s.hash);
  f(Column{"steps/controls", kS, n.controls, 0, "rad, m, N or N m, as the control has it",
           "inputs of the step; columns: /names/controls"},
    s.controls);
  f(Column{"steps/controls_moved", kS, 1, 0, "",
           "1: controls moved within the step, from those of the step before to those of this one; 0: they "
           "were held"},
    s.controls_moved);
  f(
      Column{
          "steps/base_rates", kS, n.base_rates, 0, "m/s, or rad/s of the rotation vector",
          "rates of driven bases at the end of the step, NaN: not given; columns: the last of /names/controls"},
      s.base_rates);
  f(Column{"steps/poses", kS, 7 * n.bodies, 7, "m, 1",
           "x y z qw qx qy qz of every body in the world after the step; second dimension: /names/bodies"},
    s.poses);
  f(Column{"steps/coordinates", kS, n.coordinates, 0, "rad or m",
           "joint displacements from the reference after the step; columns: /names/coordinates"},
    s.coordinates);
  f(Column{"steps/sensors", kS, n.sensors, 0, "as docs/formats.md has it for each kind",
           "what sensors measured at the end of the step, NaN: no value; columns: /names/sensors"},
    s.sensors);
  f(Column{"steps/base_poses", kS, 7 * n.mechanisms, 7, "m, 1",
           "x y z qw qx qy qz of every mechanism's root frame"},
    s.base_poses);
  f(Column{"steps/base_twists", kS, 6 * n.mechanisms, 6, "rad/s, m/s",
           "twist of every mechanism's base in its root frame: angular, linear at the frame's origin"},
    s.base_twists);
  f(Column{"steps/reduced_sizes", kS, n.mechanisms, 0, "",
           "number of reduced coordinates of every mechanism"},
    s.reduced_sizes);
  f(Column{"steps/detail", kS, 1, 0, "",
           "level of the step: 0 what is held alone, 1 interface bodies, 2 and their parents, 3 all bodies"},
    s.detail);
  f(Column{"steps/modes", kS, 1, 0, "", "fixed-interface modes of the step, -1: as the mechanisms say"},
    s.modes);
  f(Column{"steps/recovery", kS, 1, 0, "", "recovery: 0 exact, 1 twist, 2 curved, 3 expanded"}, s.recovery);
  f(Column{"steps/kinetic_energy", kS, 1, 0, "J", ""}, s.kinetic_energy);
  f(Column{"steps/potential_energy", kS, 1, 0, "J", "springs, controls and gravity"}, s.potential_energy);
  f(Column{"steps/closure_gap", kS, 1, 0, "m", "largest opening of any loop"}, s.closure_gap);
  f(Column{"steps/residual", kS, 1, 0, "1", "of the contact solver, relative to what contact changes"},
    s.residual);
  f(Column{"steps/max_penetration", kS, 1, 0, "m", ""}, s.max_penetration);
  f(Column{"steps/contacts", kS, 1, 0, "", "contacts that carried force"}, s.contacts);
  f(Column{"steps/limits", kS, 1, 0, "", "joint limits that acted"}, s.limits);
  f(Column{"steps/newton_iterations", kS, 1, 0, "", "of the contact solver"}, s.newton_iterations);
  f(
      Column{
          "steps/contact_stage", kS, 1, 0, "",
          "what helped the contact solver: 0 nothing, 1 dilatancy, 2 frozen bounds of friction, 3 softer contact, 4 a path in "
          "friction; before version 24: 1 frozen bounds, 2 softer contact, 3 a path"},
      s.contact_stage);
  f(Column{"steps/refreshes", kS, 1, 0, "", "mechanisms whose reference was moved"}, s.refreshes);
  f(Column{"steps/failed_refreshes", kS, 1, 0, "", ""}, s.failed_refreshes);
  f(Column{"steps/converged", kS, 1, 0, "", "1: the contact solver reached its tolerance"}, s.converged);
  f(Column{"steps/contacts_dropped", kS, 1, 0, "", "1: the collision detector ran out of room"},
    s.contacts_dropped);
  f(Column{"steps/finite", kS, 1, 0, "", "0: the step was undone"}, s.finite);
  f(Column{"steps/reduced_end", kS, 1, 0, "", "row of /reduced after the last of the step"}, s.reduced_end);
  f(Column{"steps/contact_end", kS, 1, 0, "", "row of /contacts after the last of the step"}, s.contact_end);
  f(Column{"steps/wrench_end", kS, 1, 0, "", "row of /wrenches after the last of the step"}, s.wrench_end);
  f(Column{"steps/point_spring_end", kS, 1, 0, "", "row of /point_springs after the last of the step"},
    s.point_spring_end);
  f(Column{"steps/checksum", kS, 1, 0, "", "over all other values of the step"}, s.checksum);

  f(Column{"reduced/z", Rows::kReduced, 1, 0, "1", "reduced coordinates, mechanism after mechanism"}, s.z);
  f(Column{"reduced/w", Rows::kReduced, 1, 0, "1/s", "their rates"}, s.w);

  constexpr auto kC = Rows::kContacts;
  f(Column{"contacts/body_a", kC, 1, 0, "", "place in /names/bodies, -1: the still world"}, s.contact_body_a);
  f(Column{"contacts/body_b", kC, 1, 0, "", "place in /names/bodies, -1: the still world"}, s.contact_body_b);
  f(Column{"contacts/point", kC, 3, 0, "m", "midway between the surfaces, world"}, s.contact_point);
  f(Column{"contacts/normal", kC, 3, 0, "1", "from a to b, world axes"}, s.contact_normal);
  f(Column{"contacts/force", kC, 3, 0, "N", "on b with friction, mean over the step, world axes"},
    s.contact_force);
  f(Column{"contacts/gap", kC, 1, 0, "m", "negative in penetration"}, s.contact_gap);
  f(Column{"contacts/friction", kC, 1, 0, "1", "coefficient"}, s.contact_friction);

  f(Column{"wrenches/body", Rows::kWrenches, 1, 0, "", "place in /names/bodies"}, s.wrench_body);
  f(Column{"wrenches/wrench", Rows::kWrenches, 9, 0, "N, N m, m",
           "applied from outside: force, moment about the point, point; world axes"},
    s.wrench);

  f(Column{"point_springs/body", Rows::kPointSprings, 1, 0, "", "place in /names/bodies"},
    s.point_spring_body);
  f(Column{"point_springs/spring", Rows::kPointSprings, 11, 0, "m, N/m, N s/m",
           "point in the body, target at the start and at the end of the step in the world, stiffness, "
           "damping"},
    s.point_spring);
}

/// A 64-bit checksum of values by their bits.
class Checksum {
 public:
  template <class T>
  void Add(T value) {
    if constexpr (std::is_same_v<T, double>)
      Mix(std::bit_cast<std::uint64_t>(value));
    else if constexpr (std::is_same_v<T, float>)
      Mix(std::bit_cast<std::uint32_t>(value));
    else
      Mix(static_cast<std::uint64_t>(value));
  }
  void Add(const std::string& text) {
    Mix(text.size());
    for (char c : text) Mix(static_cast<unsigned char>(c));
  }
  std::uint64_t value() const { return hash_; }

 private:
  void Mix(std::uint64_t bits) {
    hash_ = (hash_ ^ bits) * 0x9E3779B97F4A7C15ull;
    hash_ ^= hash_ >> 32;
  }
  std::uint64_t hash_ = 0x243F6A8885A308D3ull;
};

/// Rows [first, last) of each kind that belong to one step.
struct StepRows {
  std::size_t first[kNumRows] = {}, last[kNumRows] = {};
};

inline std::uint64_t StepChecksum(const RecordedSteps& steps, const Widths& widths, const StepRows& rows) {
  Checksum sum;
  ForEachColumn(steps, widths, [&](const Column& column, const auto& values) {
    if (&values == static_cast<const void*>(&steps.checksum)) return;
    const auto kind = static_cast<std::size_t>(column.rows);
    const auto width = static_cast<std::size_t>(column.width);
    for (std::size_t i = rows.first[kind] * width; i < rows.last[kind] * width; ++i) sum.Add(values[i]);
  });
  return sum.value();
}

/// Pose as it stands in a row.
inline void AddPose(const RigidTransform& X, std::vector<double>& out) {
  const Quaternion q = X.quaternion();
  for (double v : {X.translation().x(), X.translation().y(), X.translation().z(), q.w(), q.x(), q.y(), q.z()})
    out.push_back(v);
}

}  // namespace fork1s::internal
