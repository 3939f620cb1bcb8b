// The static correction q_perp = C_perp g knows linear springs alone. With e the arms of a length ℓ, its part of ℓ is
//     δ = e·C_perp g = c·g,   c = C_perp e
// and under the loads τ_j of weight (three axes, g = 9.81 m/s² in the worst direction) and of actuators at the ends of
// their ranges it is between
//     c·τ_s - W + Σ min(c·τ_u),   c·τ_s + W + Σ max(c·τ_u),   W = |c·τ_weight| + Σ |c_i τ_weight,i|
// with τ_s the springs at q_ref and i the joints with stops, whose reactions are local loads as large as the weight that
// they hold. A stop acts on condensed DOFs where the correction passes it by more than kShare of its range, a servo's
// bound where the servo's spring changes its force by more than kShare of the bound, dry friction F where what it holds
// of the load f on ℓ moves ℓ by (c·e) min(F, f) of more than kShare rad (or lengths of the mechanism).
#include "interior_stops.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s::internal {
namespace {

constexpr double kShare = 0.01;    // of a range, a bound, a radian: what is neglected
constexpr double kGravity = 9.81;  // m/s²

VectorX ArmsOf(const Mechanism& mechanism, const Mechanism::Length& length, const Kinematics& kinematics) {
  VectorX arms = VectorX::Zero(mechanism.num_coordinates());
  ForEachArm(length, kinematics.paths, [&](int i, double c) { arms(i) += c; });
  return arms;
}

const Mechanism::Length& LengthOfStop(const Mechanism& m, int stop) {
  auto at = static_cast<std::size_t>(stop);
  if (at < m.length_limits().size()) return m.length_limits()[at].length;
  at -= m.length_limits().size();
  if (at < m.force_limits().size()) return m.force_limits()[at].length;
  return m.frictions()[at - m.force_limits().size()].length;
}

struct Range {
  double lower = 0, upper = 0;

  void Add(double a, double b) {
    lower += std::min({a, b, 0.0});
    upper += std::max({a, b, 0.0});
  }
  double Largest() const { return std::max(-lower, upper); }
};

// Loads at q_ref (n x .): weight along three axes, springs, controls at the ends of what they may be.
struct Loads {
  MatrixX weight, lowest, highest;
  VectorX springs;
  VectorX stops;  // bounds of the reactions of stops
};

// Ends of gain u; a force limit on the control alone bounds it further. Unbounded controls count as none.
std::pair<double, double> ForceRange(const Mechanism& m, std::size_t control) {
  const Mechanism::Control& c = m.controls()[control];
  double a = std::isfinite(c.lower) ? c.gain * c.lower : 0, b = std::isfinite(c.upper) ? c.gain * c.upper : 0;
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    const bool alone = limit.inputs.size() == 1 && limit.inputs[0].first == static_cast<int>(control);
    if (!alone || limit.stiffness > 0 || !std::isfinite(limit.lower) || !std::isfinite(limit.upper)) continue;
    if (!std::isfinite(c.lower) || !std::isfinite(c.upper)) return {limit.lower, limit.upper};
    a = std::clamp(a, limit.lower, limit.upper);
    b = std::clamp(b, limit.lower, limit.upper);
  }
  return {a, b};
}

Loads LoadsAt(const ReducedModel& model, const Kinematics& kinematics) {
  const Mechanism& m = *model.mechanism;
  const int n = m.num_coordinates();
  Loads loads;
  loads.weight.resize(n, 3);
  Matrix6X F(6, m.num_bodies());
  VectorX tau(n);
  for (int axis = 0; axis < 3; ++axis) {
    F.setZero();
    tau.setZero();
    AddGravityWrenches(m, kinematics, kGravity * Vector3::Unit(axis), F);
    AccumulateGeneralizedForce(m, kinematics.S, F, tau);
    loads.weight.col(axis) = tau;
  }
  SpringForce(m, kinematics, model.q_ref, loads.springs);
  loads.stops = VectorX::Zero(n);
  for (const Mechanism::LengthLimit& limit : m.length_limits())
    if (limit.length.is_single()) {
      const int i = limit.length.terms[0].first;
      loads.stops(i) = loads.weight.row(i).norm();
    }
  const auto controls = static_cast<Eigen::Index>(m.controls().size());
  loads.lowest.resize(n, controls);
  loads.highest.resize(n, controls);
  for (Eigen::Index k = 0; k < controls; ++k) {
    const VectorX arms = ArmsOf(m, m.controls()[static_cast<std::size_t>(k)].length, kinematics);
    const auto [a, b] = ForceRange(m, static_cast<std::size_t>(k));
    loads.lowest.col(k) = a * arms;
    loads.highest.col(k) = b * arms;
  }
  return loads;
}

Range StaticRange(const VectorX& c, const Loads& loads) {
  const double springs = c.dot(loads.springs),
               weight = (loads.weight.transpose() * c).norm() + c.cwiseAbs().dot(loads.stops);
  Range range{springs - weight, springs + weight};
  for (Eigen::Index k = 0; k < loads.lowest.cols(); ++k)
    range.Add(c.dot(loads.lowest.col(k)), c.dot(loads.highest.col(k)));
  return range;
}

// Of all loads on a length with arms e, f = e·τ / e·e.
double LoadOn(const VectorX& e, const Loads& loads) {
  double load = std::abs(e.dot(loads.springs)) + (loads.weight.transpose() * e).norm();
  for (Eigen::Index k = 0; k < loads.lowest.cols(); ++k)
    load += std::max(std::abs(e.dot(loads.lowest.col(k))), std::abs(e.dot(loads.highest.col(k))));
  return load / std::max(e.squaredNorm(), std::numeric_limits<double>::min());
}

}  // namespace

std::vector<int> FindInteriorStops(const ReducedModel& model, const Kinematics& kinematics) {
  const Mechanism& m = *model.mechanism;
  std::vector<int> found;
  if (!model.has_complement || m.length_limits().size() + m.force_limits().size() + m.frictions().size() == 0)
    return found;
  const Loads loads = LoadsAt(model, kinematics);
  const int limits = static_cast<int>(m.length_limits().size()),
            servos = static_cast<int>(m.force_limits().size()),
            all = limits + servos + static_cast<int>(m.frictions().size());
  VectorX c(m.num_coordinates());
  for (int stop = 0; stop < all; ++stop) {
    const Mechanism::Length& length = LengthOfStop(m, stop);
    const VectorX arms = ArmsOf(m, length, kinematics);
    ApplyComplement(model, arms, c);
    const Range range = StaticRange(c, loads);
    // Of a coordinate a radian or a length of the mechanism, of other lengths what a radian makes of them.
    double unit = 0;
    for (int i = 0; i < arms.size(); ++i)
      unit = std::max(unit, std::abs(arms(i)) * (m.Turns(i) ? 1 : m.length_scale()));
    bool acts = false;
    if (stop < limits) {
      const Mechanism::LengthLimit& limit = m.length_limits()[static_cast<std::size_t>(stop)];
      const double at = LengthOf(m, length, kinematics, model.q_ref), whole = limit.upper - limit.lower,
                   tolerance = kShare * (std::isfinite(whole) ? whole : unit);
      acts = at + range.upper > limit.upper + tolerance || at + range.lower < limit.lower - tolerance;
    } else if (stop < limits + servos) {
      const Mechanism::ForceLimit& servo = m.force_limits()[static_cast<std::size_t>(stop - limits)];
      const double bound = std::min(std::abs(servo.lower), std::abs(servo.upper));
      acts = servo.stiffness * range.Largest() > kShare * bound;
    } else {
      const double force = m.frictions()[static_cast<std::size_t>(stop - limits - servos)].force;
      acts = std::min(force, LoadOn(arms, loads)) * arms.dot(c) > kShare * unit;
    }
    if (acts) found.push_back(stop);
  }
  return found;
}

std::vector<char> PartsOfStops(const Mechanism& mechanism, const Kinematics& kinematics,
                               const ElasticBasis& basis, const std::vector<int>& stops) {
  std::vector<char> parts(basis.parts.size(), 0);
  for (const int stop : stops) {
    const VectorX moved =
        basis.ApplyVTransposed(ArmsOf(mechanism, LengthOfStop(mechanism, stop), kinematics));
    for (std::size_t p = 0; p < parts.size(); ++p)
      if (!moved.segment(basis.parts[p].elastic, basis.parts[p].num_elastic).isZero(0)) parts[p] = 1;
  }
  return parts;
}

std::string NameOfStop(const Mechanism& m, int stop) {
  auto at = static_cast<std::size_t>(stop);
  if (at < m.length_limits().size()) return m.length_limits()[at].WhatAndName();
  at -= m.length_limits().size();
  if (at < m.force_limits().size()) return "actuator '" + m.force_limits()[at].name + "'";
  return "dry friction '" + m.frictions()[at - m.force_limits().size()].name + "'";
}

}  // namespace fork1s::internal
