// The gait of scenes/beam_walkers.xml. Feet stand where they were put down; trunks go ahead evenly, rise and
// lean with the ground below them; joints follow by inverse kinematics. The machines know where the step is,
// and nothing of the beam.
#include <cmath>
#include <numbers>

#include "motions.hpp"

namespace fork1s::examples {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kStart = 1.5, kPeriod = 1, kCycles = 11;  // s
constexpr double kAdvance = 0.12;                          // m a cycle
constexpr double kEdge = 0.35, kStepHeight = 0.025;        // m
constexpr double kClear = 0.03;                            // m that feet rise, and keep off the edge
constexpr double kFootRadius = 0.012, kRideHeight = 0.092, kOutward = 0.12;

// m that a trunk has gone after `cycles`; it starts and stops within half a cycle.
double Gone(double cycles) {
  const double c = std::clamp(cycles, 0.0, kCycles), fade = 0.5;
  if (c < fade) return kAdvance * c * c / (2 * fade);
  const double left = kCycles - c;
  if (left < fade) return kAdvance * (kCycles - fade - left * left / (2 * fade));
  return kAdvance * (c - fade / 2);
}

struct Foothold {
  double x, z;
};

Foothold At(double x) {
  if (std::abs(x - kEdge) < kClear) x = kEdge + (x >= kEdge ? kClear : -kClear);
  return {x, x > kEdge ? kStepHeight : 0};
}

// Where the foot stands, or is on its way, `phase` of a cycle after it was lifted.
Foothold Foot(Foothold from, Foothold to, double phase) {
  if (phase >= 0.5) return to;
  if (to.x - from.x < 1e-9) return from;
  const double s = 2 * phase, up = to.z - from.z, lift = std::sin(kPi * s);
  return {from.x + (to.x - from.x) * Ramp(s, 0.2, 0.85),
          from.z + up * (up > 0 ? Ramp(s, 0, 0.45) : Ramp(s, 0.55, 1)) + kClear * lift * lift};
}

void Walk(double t, const std::string& machine, double start, Row& row) {
  const struct {
    const char* name;
    double x, y, azimuth;
    int tripod;
  } legs[] = {{"front_left", 0.12, 0.05, kPi / 4, 0},     {"middle_left", 0, 0.06, kPi / 2, 1},
              {"rear_left", -0.12, 0.05, 3 * kPi / 4, 0}, {"front_right", 0.12, -0.05, -kPi / 4, 1},
              {"middle_right", 0, -0.06, -kPi / 2, 0},    {"rear_right", -0.12, -0.05, -3 * kPi / 4, 1}};
  const double cycles = (t - kStart) / kPeriod, x = start + Gone(cycles);
  const auto below = [](double at) { return kStepHeight * Ramp(at, kEdge - 0.06, kEdge + 0.1); };
  const double front = below(x + 0.15), rear = below(x - 0.15);
  const double z = kRideHeight + 0.5 * (front + rear), lean = std::atan2(front - rear, 0.3);
  for (const auto& leg : legs) {
    const double outward_x = std::cos(leg.azimuth), outward_y = std::sin(leg.azimuth);
    const double home = start + leg.x + kOutward * outward_x, shift = 0.5 * leg.tripod;
    const double whole = std::floor(cycles + shift), phase = cycles + shift - whole;
    // A foot stands for half a cycle, and is below its hip as drawn in the middle of that.
    const Foothold from = At(home + Gone(whole - 0.25 - shift)), to = At(home + Gone(whole + 0.75 - shift));
    const Foothold foot = cycles > 0 ? Foot(from, to, phase) : from;
    const double ahead = foot.x - x, up = foot.z + kFootRadius - z;
    const double from_hip_x = std::cos(lean) * ahead + std::sin(lean) * up - leg.x,
                 from_hip_y = kOutward * outward_y, from_hip_z = std::cos(lean) * up - std::sin(lean) * ahead;
    const LegAngles q = Reach(outward_x * from_hip_x + outward_y * from_hip_y,
                              outward_x * from_hip_y - outward_y * from_hip_x, from_hip_z);
    const std::string name = machine + "_" + leg.name;
    row[name + "_yaw"] = q.yaw;
    row[name + "_hip"] = q.hip;
    row[name + "_knee"] = q.knee;
  }
}

}  // namespace

Row CarryBeam(double t) {
  Row row;
  Walk(t, "lead", 0, row);
  Walk(t, "tail", -0.6, row);
  return row;
}

}  // namespace fork1s::examples
