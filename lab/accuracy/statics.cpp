#include <algorithm>
#include <cmath>
#include <fork1s/reduction/statics.hpp>
#include <lab/accuracy.hpp>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "equilibrium.hpp"

namespace fork1s {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

internal::FullEquilibrium Solve(const StaticCase& c, double force_N) {
  return internal::SolveFull(*c.mechanism, c.q0, {{c.body, force_N * c.direction_R}}, {});
}

}  // namespace

namespace internal {

FullEquilibrium SolveFull(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                          const StaticsOptions& options) {
  FullEquilibrium full;
  full.result = SolveStatics(mechanism, q0, loads, options);
  if (full.result.converged)
    full.angle_deg = kDegreesPerRadian * MaxJointRotation(mechanism, q0, full.result.q);
  return full;
}

// Rotation grows with the load, slower and slower as the mechanism aligns with it: bracket by growth, then
// bisect by secants.
bool RaiseToAngle(const std::function<FullEquilibrium(double)>& solve, double angle_deg, double& load,
                  FullEquilibrium& out) {
  const auto stands = [](const FullEquilibrium& f) {
    return f.result.converged && f.result.tangent.IsStable();
  };
  double low = 0, low_angle = 0, high = load;
  FullEquilibrium at = solve(high);
  for (int i = 0; i < 12 && stands(at) && at.angle_deg < angle_deg; ++i) {
    low = high;
    low_angle = at.angle_deg;
    high *= std::clamp(1.2 * angle_deg / at.angle_deg, 1.1, 4.0);
    at = solve(high);
  }
  if (!stands(at) || at.angle_deg < angle_deg) return false;
  double high_angle = at.angle_deg;
  for (int i = 0; i < 60 && std::abs(at.angle_deg - angle_deg) > 1e-6 * angle_deg; ++i) {
    double share = (angle_deg - low_angle) / (high_angle - low_angle);
    if (i % 3 == 2) share = 0.5;  // a secant alone may keep one end for ever
    const double middle = low + share * (high - low);
    at = solve(middle);
    if (!stands(at)) return false;
    load = middle;
    (at.angle_deg < angle_deg ? low : high) = middle;
    (at.angle_deg < angle_deg ? low_angle : high_angle) = at.angle_deg;
  }
  out = at;
  return true;
}

}  // namespace internal

const char* Name(StaticMode mode) {
  switch (mode) {
    case StaticMode::kTwist:
      return "twist";
    case StaticMode::kSecondOrder:
      return "second order";
    case StaticMode::kOpen:
      return "exact, loops open";
    case StaticMode::kExact:
      return "exact";
    case StaticMode::kRefreshed:
      return "exact, refreshed";
    case StaticMode::kCurved:
      return "curved";
  }
  return "";
}

Expected<StaticCurve> MeasureStatics(const StaticCase& c, const std::vector<double>& angles_deg,
                                     const std::vector<StaticMode>& modes) {
  StaticCurve curve;
  curve.name = c.name;
  curve.modes = modes;
  std::vector<internal::ReducedEquilibrium> reduced;
  for (StaticMode mode : modes) {
    auto made = internal::ReducedEquilibrium::Create(c, mode);
    if (!made) return tl::unexpected(made.error());
    reduced.push_back(std::move(*made));
  }
  const std::vector<DeadLoad> newton{{c.body, c.direction_R}};
  auto linear = LinearDeflection(*c.mechanism, c.q0, newton);
  if (!linear) return tl::unexpected(linear.error());
  const double per_newton = kDegreesPerRadian * MaxJointRotation(*c.mechanism, c.q0, *linear);
  Kinematics kinematics(*c.mechanism);
  ComputeKinematics(*c.mechanism, c.q0, kinematics);
  const Vector3 start = kinematics.X_RB[c.body.u()].translation();
  double force = 0, last = 0;
  for (double angle : angles_deg) {
    force = last > 0 ? force * angle / last : angle / per_newton;
    internal::FullEquilibrium truth;
    if (!internal::RaiseToAngle([&](double f) { return Solve(c, f); }, angle, force, truth)) {
      curve.end = fmt::format("no force bends it stably by {:g} degrees", angle);
      break;
    }
    last = angle;
    ComputeKinematics(*c.mechanism, truth.result.q, kinematics);
    const Vector3 p = kinematics.X_RB[c.body.u()].translation();
    StaticCurve::Point point{truth.angle_deg, force, 1e3 * (p - start).norm(), {}, {}};
    for (auto& r : reduced) {
      const bool stands = r.Raise(force);
      constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
      point.percent.push_back(stands ? 1e5 * (r.Position() - p).norm() / point.moved_mm : kNone);
      point.loop_gap_mm.push_back(stands ? 1e3 * r.LoopGap() : kNone);
    }
    curve.points.push_back(std::move(point));
  }
  return curve;
}

double DeflectionAtError(const StaticCurve& curve, std::size_t mode, double percent) {
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const double y = curve.points[i].percent[mode], x = curve.points[i].angle_deg;
    if (y < percent) continue;
    if (!std::isfinite(y) || i == 0) return x;
    const double y0 = curve.points[i - 1].percent[mode], x0 = curve.points[i - 1].angle_deg;
    if (!(y0 > 0)) return x;
    return x0 * std::pow(x / x0, std::log(percent / y0) / std::log(y / y0));
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace fork1s
