#include "signals.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "body_order.hpp"

namespace fork1s::internal {
namespace {

constexpr int kMost = 300;

struct JointLoads {
  VectorX tau;       // n, of springs, dampers, servos and motors
  VectorX actuator;  // one a control, along its length
};

double RateOf(const MechanismDynamics& m, const Mechanism::Length& length, const VectorX& q_dot) {
  double rate = 0;
  ForEachArm(length, m.configuration().kinematics.paths, [&](int i, double c) { rate += c * q_dot(i); });
  return rate;
}

JointLoads LoadsOf(const Simulation& simulation, const MechanismDynamics& m, int mechanism,
                   const std::vector<ServoShare>& servos) {
  const Mechanism& def = m.mechanism();
  const VectorX& q = m.configuration().q;
  const VectorX q_dot = m.configuration().Q_now * m.state().w;
  JointLoads out;
  out.tau = -def.stiffness().cwiseProduct(q - def.rest()) - def.damping().cwiseProduct(q_dot);
  for (const Mechanism::Spring& s : def.springs()) {
    const double rate = RateOf(m, s.length, q_dot);
    m.AddLengthForce(s.length, s.Force(m.Length(s.length)) - s.DampingAt(rate) * rate, out.tau);
  }
  const auto& controls = def.controls();
  out.actuator.resize(static_cast<Eigen::Index>(controls.size()));
  for (std::size_t k = 0; k < controls.size(); ++k) {
    const Mechanism::Control& c = controls[k];
    const auto i = static_cast<Eigen::Index>(k);
    const double push = c.gain * m.ActivationOf(i);
    m.AddLengthForce(c.length, push, out.tau);
    out.actuator(i) = push;
    const auto share = std::find_if(servos.begin(), servos.end(), [&](const ServoShare& s) {
      return simulation.place(s.mechanism).mechanism == mechanism && s.control == c.name;
    });
    if (share == servos.end()) continue;
    if (!(share->stiffness > 0)) out.actuator(i) += share->bias;
    out.actuator(i) -=
        share->stiffness * (m.Length(c.length) - share->Rest()) + share->damping * RateOf(m, c.length, q_dot);
  }
  for (const Mechanism::Muscle& muscle : def.muscles()) {
    const double pull = m.ActivationOf(muscle.control) *
                        muscle.Force(m.Length(muscle.length), RateOf(m, muscle.length, q_dot));
    m.AddLengthForce(muscle.length, pull, out.tau);
    out.actuator(muscle.control) += pull;
  }
  for (const Mechanism::ForceLimit& f : def.force_limits()) {
    double force = -f.stiffness * (m.Length(f.length) - f.rest) - f.damping * RateOf(m, f.length, q_dot);
    for (const auto& [input, gain] : f.inputs) force += gain * m.ActivationOf(input);
    const double given = std::clamp(force, f.lower, f.upper);
    m.AddLengthForce(f.length, given - force, out.tau);
    for (std::size_t k = 0; k < controls.size(); ++k)
      if (controls[k].name == f.name) out.actuator(static_cast<Eigen::Index>(k)) = given;
  }
  return out;
}

// Interface bodies, then free ones; what is held is neither.
std::vector<int> ErrorBodies(const Simulation& simulation) {
  std::vector<int> bodies;
  for (std::size_t b = 0; b < simulation.bodies().size() && bodies.size() < kMost; ++b)
    if (simulation.bodies()[b].is_interface || simulation.bodies()[b].mechanism < 0)
      bodies.push_back(static_cast<int>(b));
  return bodies;
}

}  // namespace

std::vector<SignalInfo> ListSignals(const Simulation& simulation) {
  const BodyOrder order(simulation);
  std::vector<SignalInfo> positions, forces, actuators;
  int number = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    const Mechanism& def = m.mechanism();
    for (int i = 0; i < def.num_coordinates() && static_cast<int>(positions.size()) < kMost; ++i) {
      const bool turns = def.Turns(i);
      const int body = order.OnWire(number, def.joint(def.CoordinateJoint(i)).body.value());
      positions.push_back({def.CoordinateName(i), "position", turns ? "rad" : "m", body});
      forces.push_back({def.CoordinateName(i), "joint_force", turns ? "N·m" : "N", body});
    }
    for (const Mechanism::Control& c : def.controls())
      if (static_cast<int>(actuators.size()) < kMost) {
        actuators.push_back({c.name, "actuator", def.IsAngle(c.length) ? "N·m" : "N", -1});
      }
    ++number;
  }
  std::vector<SignalInfo> all = std::move(positions);
  all.insert(all.end(), forces.begin(), forces.end());
  all.insert(all.end(), actuators.begin(), actuators.end());
  for (int b : ErrorBodies(simulation))
    all.push_back({simulation.bodies()[static_cast<std::size_t>(b)].name, "error", "mm", order.OnWire(b)});
  return all;
}

void MeasureSignals(const Simulation& simulation, const std::vector<ServoShare>& servos,
                    const ErrorEstimate* error, std::vector<double>& out) {
  out.clear();
  std::vector<double> forces, actuators;
  int number = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    if (out.size() >= kMost && actuators.size() >= kMost) break;
    const JointLoads loads = LoadsOf(simulation, m, number++, servos);
    for (Eigen::Index i = 0; i < loads.tau.size() && out.size() < kMost; ++i) {
      out.push_back(m.configuration().q(i));
      forces.push_back(loads.tau(i));
    }
    for (Eigen::Index i = 0; i < loads.actuator.size() && actuators.size() < kMost; ++i)
      actuators.push_back(loads.actuator(i));
  }
  out.insert(out.end(), forces.begin(), forces.end());
  out.insert(out.end(), actuators.begin(), actuators.end());
  for (int b : ErrorBodies(simulation)) {
    const SceneBody& body = simulation.bodies()[static_cast<std::size_t>(b)];
    double shown = std::nan("");
    if (error)
      for (const BodyError& e : error->bodies())
        if (e.mechanism == body.mechanism && e.index == body.index) shown = 1e3 * e.shown;
    out.push_back(shown);
  }
}

}  // namespace fork1s::internal
