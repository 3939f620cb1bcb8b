// The set-points of scenes/excavator.xml. The edge of the bucket goes along a way; how far each cylinder is
// out follows from the pins' places. Side view: x ahead, z up, angles from x up; lengths as the file has
// them.
#include <cmath>
#include <iterator>
#include <numbers>

#include "motions.hpp"

namespace fork1s::examples {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kBoom = 2.8, kStick = 1.5, kBucket = 0.9, kRocker = 0.395, kLink = 0.32;

struct Point {
  double x, z;
};
Point operator+(Point a, Point b) { return {a.x + b.x, a.z + b.z}; }
Point operator-(Point a, Point b) { return {a.x - b.x, a.z - b.z}; }
double Length(Point a) { return std::hypot(a.x, a.z); }
double Angle(Point a) { return std::atan2(a.z, a.x); }
Point Turned(double angle, Point a) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * a.x - s * a.z, s * a.x + c * a.z};
}

/// Of boom, stick and bucket.
struct Angles {
  double boom, stick, bucket;
};
struct Lengths {
  double boom, stick, bucket;
};

constexpr Point kFoot{0.2, 1.2};  // of the boom
constexpr Angles kDrawn{40 * kDegree, -50 * kDegree, -80 * kDegree};

Lengths Cylinders(const Angles& at) {
  const Point stick = kFoot + Turned(at.boom, {kBoom, 0}), bucket = stick + Turned(at.stick, {kStick, 0});
  const Point rocker = stick + Turned(at.stick, {1.28, -0.035}),
              ear = bucket + Turned(at.bucket, {-0.205, 0.13});
  // The pin between rocker and link, above the line from one's foot to the other's.
  const Point across = ear - rocker;
  const double d = Length(across),
               apart = std::acos((kRocker * kRocker + d * d - kLink * kLink) / (2 * kRocker * d));
  const Point pin = rocker + Turned(Angle(across) + apart, {kRocker, 0});
  return {Length(kFoot + Turned(at.boom, {1.35, -0.02}) - Point{0.65, 0.85}),
          Length(stick + Turned(at.stick, {-0.42, 0.16}) - kFoot - Turned(at.boom, {1.15, 0.42})),
          Length(pin - stick - Turned(at.stick, {0.16, 0.23}))};
}

Angles Reaching(Point edge, double attitude) {
  const Point pin = edge - Turned(attitude, {kBucket, 0}), to_pin = pin - kFoot;
  const double d = Length(to_pin),
               boom = Angle(to_pin) + std::acos((kBoom * kBoom + d * d - kStick * kStick) / (2 * kBoom * d));
  return {boom, Angle(pin - kFoot - Turned(boom, {kBoom, 0})), attitude};
}

struct Place {
  double time;      // s
  Point edge;       // m, while the house looks ahead
  double attitude;  // degrees, from the bucket's pin to its edge: -90 hangs down, -180 mouth up
  double swing;     // degrees
};

constexpr Place kWay[] = {{1, {3.465, 0.964}, -80, 0},  // as drawn, while what lies in the bay settles
                          {3, {3.75, 0.72}, -75, 0},    // out
                          {4.5, {3.65, 0.05}, -95, 0},  // down behind the heap
                          {7, {2.85, 0.03}, -128, 0},   // through it along the ground
                          {9, {2.7, 0.5}, -175, 0},     // mouth up
                          {10.7, {2.6, 1.5}, -190, 0},  // lift
                          {13, {2.8, 1.7}, -190, 90},   // swing
                          {15, {3.8, 1.7}, -75, 90},    // let fall
                          {16, {3.8, 1.7}, -75, 90},   {18.5, {3.465, 0.964}, -80, 0}};  // back

}  // namespace

Row Dig(double t) {
  std::size_t next = 1;
  while (next + 1 < std::size(kWay) && t > kWay[next].time) ++next;
  const Place &from = kWay[next - 1], &to = kWay[next];
  const double s = Ramp(t, from.time, to.time);
  const auto between = [s](double a, double b) { return a + (b - a) * s; };
  const Lengths out = Cylinders(Reaching({between(from.edge.x, to.edge.x), between(from.edge.z, to.edge.z)},
                                         kDegree * between(from.attitude, to.attitude))),
                drawn = Cylinders(kDrawn);
  return {{"swing", kDegree * between(from.swing, to.swing)},
          {"boom", out.boom - drawn.boom},
          {"stick", out.stick - drawn.stick},
          {"bucket", out.bucket - drawn.bucket}};
}

}  // namespace fork1s::examples
