#include <fork1s/sim/sanity_monitor.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>

namespace fork1s {
namespace {

// What is still taken for plausible.
constexpr double kDeepest = 0.25;  // of the radius of the smaller body
constexpr double kSunken = 1e-3;   // of the diameter of the smaller body, where it lasts
// Of the radius of the smallest body that touches: by less poses are off without harm.
constexpr double kNegligibleResidual = 1e-5;
constexpr double kLasting = 0.1;  // s
constexpr double kOpen = 0.01;    // of the size of the mechanism
constexpr double kRise = 0.1;     // of the largest kinetic energy so far
constexpr double kWedged = 1e6;   // of the weight of all that moves
constexpr double kHalfTurn = 3.141592653589793;

std::string Print(const char* format, double a, double b, double c) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

// A remedy, where there is one.
std::string TryStep(double dt) { return dt > 1e-9 ? Print("; try a time step of %.1g s", dt, 0, 0) : ""; }

double Reach(const RigidTransform& X, const std::vector<GeometryDef>& geometries) {
  double radius = 0;
  for (const GeometryDef& g : geometries)
    if (g.Collides()) radius = std::max(radius, (X * g.X_BG).translation().norm() + BoundingRadius(g.shape));
  return radius;
}

// Of a sphere about the body that names a collision body, which holds all its shapes.
double RadiusOf(const Simulation& simulation, int collision_body) {
  const CollisionBody& c = simulation.world().collision_bodies()[static_cast<std::size_t>(collision_body)];
  const auto index = static_cast<std::size_t>(c.index);
  if (c.kind == CollisionBody::Kind::kFreeBody)
    return Reach(RigidTransform(), simulation.present_scene().free_bodies[index].geometries);
  const MechanismDynamics& m = simulation.world().mechanisms()[index];
  const int last_joint = m.groups()[static_cast<std::size_t>(c.group)].last_joint;
  const SceneBody& named =
      simulation.bodies()[static_cast<std::size_t>(simulation.BodyOfCollisionBody(collision_body))];
  const RigidTransform X_BR = m.mechanism().body(BodyIndex(named.index)).X_RB0.inverse();
  double radius = 0;
  for (std::size_t b = 0; b < m.mechanism().bodies().size(); ++b)
    if (const Mechanism::Body& part = m.mechanism().bodies()[b]; part.last_joint == last_joint)
      radius = std::max(radius, Reach(X_BR * part.X_RB0, m.mechanism().definition().bodies[b].geometries));
  return radius;
}

double SizeOf(const MechanismDynamics& m) {
  double size = 0;
  const Vector3 base = m.BodyPose(BodyIndex(0)).translation();
  for (int b = 1; b < m.mechanism().num_bodies(); ++b)
    size = std::max(size, (m.BodyPose(BodyIndex(b)).translation() - base).norm());
  return size;
}

std::string Quoted(const Simulation& simulation, int body) {
  return body < 0 ? "the world" : "'" + simulation.bodies()[static_cast<std::size_t>(body)].name + "'";
}

constexpr int kWorld = 0;  // the collision body of the still world

// `shape`: index among those of the still world, where it is that; -1: not known.
std::string NameOf(const Simulation& simulation, int collision_body, int shape) {
  const int body = simulation.BodyOfCollisionBody(collision_body);
  const CollisionBody& c = simulation.world().collision_bodies()[static_cast<std::size_t>(collision_body)];
  if (body >= 0 || c.kind != CollisionBody::Kind::kWorld) return Quoted(simulation, body);
  if (c.name != "world") return "'" + c.name + "'";  // a fixed base
  const auto& shapes = simulation.present_scene().world;
  if (collision_body != kWorld || shape < 0) return Quoted(simulation, body);
  return "the world (shape '" + shapes[static_cast<std::size_t>(shape)].name + "')";
}

// Index of the mechanism whose driven base presses a collision body against another; -1 for none. Of `wedged` ones no
// joint gives way, so that each of its bodies goes where the base does.
int DrivenMechanism(const Simulation& simulation, int body, int other, bool wedged) {
  const auto& bodies = simulation.world().collision_bodies();
  const CollisionBody &c = bodies[static_cast<std::size_t>(body)],
                      &o = bodies[static_cast<std::size_t>(other)];
  if (c.kind != CollisionBody::Kind::kGroup) return -1;
  const MechanismDynamics& m = simulation.world().mechanisms()[static_cast<std::size_t>(c.index)];
  if (m.mechanism().base() != BaseKind::kDriven) return -1;
  const bool is_base = m.groups()[static_cast<std::size_t>(c.group)].last_joint < 0;
  const bool within = o.kind == CollisionBody::Kind::kGroup && o.index == c.index;
  return is_base || (wedged && !within) ? c.index : -1;
}

// What helps where one of two is pressed into the other: a driven base goes where its controls say.
std::string RemedyFor(const Simulation& simulation, int a, int b, bool wedged, const char* otherwise) {
  int driven = DrivenMechanism(simulation, b, a, wedged);
  if (driven < 0) driven = DrivenMechanism(simulation, a, b, wedged);
  if (driven < 0) return otherwise;
  const Mechanism& mechanism = simulation.world().mechanisms()[static_cast<std::size_t>(driven)].mechanism();
  return "its controls drive '" + mechanism.body(BodyIndex(0)).name +
         "', which no contact stops; let them end before the contact, make the base floating, or press by a servo "
         "with a bound";
}

constexpr const char* kStartApart = "place them apart at the start, or exclude the pair";

// Activations of the controls of mechanisms, or the controls themselves where they have no dynamics, then all controls.
VectorX InputsOf(const Simulation& simulation) {
  VectorX inputs(2 * simulation.controls().size());
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < simulation.scene().mechanisms.size(); ++i) {
    const MechanismPlace& at = simulation.place(static_cast<int>(i));
    const MechanismDynamics& m = simulation.world().mechanisms()[static_cast<std::size_t>(at.mechanism)];
    const std::size_t count = simulation.given_mechanism(static_cast<int>(i)).controls().size();
    for (std::size_t k = 0; k < count; ++k, ++next)
      inputs(next) = m.HasDynamics(at.first_control + static_cast<Eigen::Index>(k))
                         ? m.activation()(at.first_control + static_cast<Eigen::Index>(k))
                         : simulation.controls()(next);
  }
  const Eigen::Index bases = simulation.controls().size() - next;
  inputs.segment(next, bases) = simulation.controls().tail(bases);
  inputs.tail(simulation.controls().size()) = simulation.controls();
  return inputs;
}

}  // namespace

SanityMonitor::SanityMonitor(const Simulation& simulation) { Changed(simulation); }

void SanityMonitor::Changed(const Simulation& simulation) {
  const World& world = simulation.world();
  radii_.assign(world.collision_bodies().size(), std::numeric_limits<double>::infinity());
  for (std::size_t c = 0; c < radii_.size(); ++c)
    if (world.collision_bodies()[c].kind != CollisionBody::Kind::kWorld &&
        simulation.BodyOfCollisionBody(static_cast<int>(c)) >= 0)
      radii_[c] = RadiusOf(simulation, static_cast<int>(c));
  pairs_.clear();
  starts_ = true;
  const double g = simulation.step_options().gravity.norm();
  double mass = 0;
  for (const MechanismDynamics& m : world.mechanisms()) mass += m.mechanism().total_mass();
  for (const FreeBodyDef& b : simulation.scene().free_bodies) mass += b.inertia.mass;
  weight_ = mass * (g > 0 ? g : 9.81);
  size_ = std::numeric_limits<double>::infinity();
  is_setpoint_.clear();
  for (const MechanismDynamics& m : world.mechanisms())
    if (const double size = SizeOf(m); size > 0) size_ = std::min(size_, size);
  for (std::size_t i = 0; i < simulation.scene().mechanisms.size(); ++i)
    for (const ControlDef& c : simulation.given_mechanism(static_cast<int>(i)).definition().controls)
      is_setpoint_.push_back(c.is_setpoint);
  controls_ = InputsOf(simulation);
  driven_before_ = true;
  energy_ = simulation.Energy();
  kinetic_ = std::max(kinetic_, simulation.KineticEnergy());
}

template <class Sentence>
void SanityMonitor::Note(Kind kind, double times, const Sentence& sentence) {
  Worst& worst = worst_[kind];
  if (!(times > 1) || !(times > worst.times)) return;
  worst.times = times;
  worst.sentence = sentence();
}

void SanityMonitor::CheckSpeeds(const Simulation& simulation) {
  const double h = simulation.dt(), t = simulation.time();
  for (std::size_t c = 0; c < radii_.size(); ++c) {
    if (!std::isfinite(radii_[c])) continue;
    const int body = simulation.BodyOfCollisionBody(static_cast<int>(c));
    if (body < 0) continue;
    const Vector6 V = simulation.Velocity(body);
    const double turn = V.head<3>().norm() * h, way = V.tail<3>().norm() * h;
    const double seen = simulation.options().collision.margin + 2 * radii_[c];
    Note(kFast, way / seen, [&] {
      return "at " + Print("%.4g s ", t, 0, 0) + Quoted(simulation, body) +
             Print(
                 " moves %.3g m in a step, and contact is looked for %.3g m ahead: it may pass through what "
                 "is in its way or get far into it",
                 way, seen, 0) +
             TryStep(h * seen / way);
    });
    Note(kSpins, turn / kHalfTurn, [&] {
      return "at " + Print("%.4g s ", t, 0, 0) + Quoted(simulation, body) +
             Print(
                 " turns by %.3g rad in a step; from half a turn on no step knows which way it turns, and "
                 "what it hits may give it energy",
                 turn, 0, 0) +
             TryStep(h / turn);
    });
  }
}

void SanityMonitor::UpdatePairs(const Simulation& simulation) {
  std::map<BodyPair, PairContact> pairs;
  for (const ContactRecord& c : simulation.world().contacts()) {
    const BodyPair key = std::minmax(c.point.body_a, c.point.body_b);
    PairContact& pair = pairs[key];
    const double sign = c.point.body_a == key.first ? 1 : -1;
    pair.force_W += sign / simulation.dt() * (c.point.frame.transpose() * c.impulse);
    if (key.first == kWorld && (pair.still_shape < 0 || -c.point.gap > pair.depth))
      pair.still_shape = sign > 0 ? c.point.geometry_a : c.point.geometry_b;
    pair.depth = std::max(pair.depth, -c.point.gap);
    pair.gives_way = pair.gives_way || c.gives_way;
  }
  for (auto& [key, pair] : pairs) {
    const auto before = pairs_.find(key);
    if (before != pairs_.end() && pair.depth > 0) {
      pair.overlap = before->second.overlap;
      pair.was_wedged = before->second.was_wedged;
    }
    pair.was_wedged |= pair.gives_way;
    if (!(pair.depth > kSunken * DiameterOf(key))) continue;
    pair.sunk_since = simulation.time();
    if (before != pairs_.end() && before->second.sunk_since) pair.sunk_since = before->second.sunk_since;
  }
  if (starts_)
    for (const ContactPoint& p : simulation.world().start_points())
      if (const auto pair = pairs.find(std::minmax(p.body_a, p.body_b));
          pair != pairs.end() && pair->second.depth > 0)
        pair->second.overlap = std::max(pair->second.overlap, -p.gap);
  starts_ = false;
  pairs_ = std::move(pairs);
}

// Diameter [m] of the smaller of two.
double SanityMonitor::DiameterOf(const BodyPair& pair) const {
  return 2 * std::min(radii_[static_cast<std::size_t>(pair.first)],
                      radii_[static_cast<std::size_t>(pair.second)]);
}

void SanityMonitor::CheckDepths(const Simulation& simulation) {
  for (const auto& [key, pair] : pairs_) {
    const double radius = 0.5 * DiameterOf(key);
    Note(kDeep, pair.depth / (kDeepest * radius), [&, a = key.first, b = key.second, &pair = pair] {
      return "at " + Print("%.4g s ", simulation.time(), 0, 0) + NameOf(simulation, b, pair.still_shape) +
             " is " + Print("%.3g mm deep in ", 1e3 * pair.depth, 0, 0) +
             NameOf(simulation, a, pair.still_shape) +
             Print(", and the smaller of the two has a radius of %.3g mm; ", 1e3 * radius, 0, 0) +
             RemedyFor(simulation, a, b, pair.was_wedged,
                       "try a smaller time step, or place them apart at the start");
    });
  }
}

// An impact may press in for a step; what rests, even under a large mass, does not stay pressed in.
void SanityMonitor::CheckSinking(const Simulation& simulation) {
  for (const auto& [key, pair] : pairs_) {
    if (!pair.sunk_since || simulation.time() - *pair.sunk_since < kLasting) continue;
    const double size = DiameterOf(key);
    Note(kSunk, pair.depth / (kSunken * size), [&, a = key.first, b = key.second, &pair = pair] {
      const std::string remedy =
          pair.overlap > kSunken * size
              ? Print(
                    "they overlap by %.3g mm at the start; place them apart at the start, or exclude the pair",
                    1e3 * pair.overlap, 0, 0)
              : "the contact does not carry what presses on it; bring their masses closer together, or press "
                "less";
      return "at " + Print("%.4g s ", simulation.time(), 0, 0) + NameOf(simulation, b, pair.still_shape) +
             " is " + Print("%.3g mm into ", 1e3 * pair.depth, 0, 0) +
             NameOf(simulation, a, pair.still_shape) +
             Print(", for %.2g s, and the smaller of the two has a size of %.3g mm: ",
                   simulation.time() - *pair.sunk_since, 1e3 * size, 0) +
             RemedyFor(simulation, a, b, pair.was_wedged, remedy.c_str());
    });
  }
}

void SanityMonitor::CheckForces(const Simulation& simulation, const Seen& seen) {
  BodyPair strongest;
  double most = 0;
  for (const auto& [key, pair] : pairs_) {
    const double force = pair.force_W.norm();
    if (force > most) most = force, strongest = key;
    if (pair.gives_way)
      Note(kForce, 2 + force / weight_, [&] {
        return Print("at %.4g s ", simulation.time(), 0, 0) +
               NameOf(simulation, key.first, pair.still_shape) + " and " +
               NameOf(simulation, key.second, pair.still_shape) +
               Print(" are wedged: no force keeps them apart, and their contact gives way under %.3g N; ",
                     force, 0, 0) +
               RemedyFor(simulation, key.first, key.second, true, kStartApart);
      });
  }
  const auto names = [&] {
    const int shape = pairs_.at(strongest).still_shape;
    return NameOf(simulation, strongest.first, shape) + " and " + NameOf(simulation, strongest.second, shape);
  };
  Note(kForce, most / (kWedged * weight_), [&] {
    return Print("at %.4g s the contact of ", simulation.time(), 0, 0) + names() +
           Print(" bears %.3g N, %.2g times the weight of all that moves: they are wedged", most,
                 most / weight_, 0) +
           "; " + RemedyFor(simulation, strongest.first, strongest.second, true, kStartApart);
  });
  constexpr const char* kShorterStep = "try a smaller time step";
  const auto where = [&] {
    return !(most > 0) ? "; " + std::string(kShorterStep)
                       : Print(", with %.3g N between ", most, 0, 0) + names() + "; " +
                             RemedyFor(simulation, strongest.first, strongest.second,
                                       pairs_.at(strongest).was_wedged, kShorterStep);
  };
  const auto step = [&] { return Print("the step to %.4g s did not converge", simulation.time(), 0, 0); };
  if (!seen.converged && !(seen.residual > 0))
    Note(kContactsUnsolved, 2 + most / weight_, [&] { return step() + where(); });
  if (seen.converged || !(seen.residual > 0)) return;
  double size = std::numeric_limits<double>::infinity();
  for (const double radius : radii_) size = std::min(size, radius);
  const double off = seen.residual / (kNegligibleResidual * (std::isfinite(size) ? size : 1));
  Note(kUnconverged, 2 + off, [&] {
    const std::string told = step() + Print(" to better than %.2g mm", 1e3 * seen.residual, 0, 0);
    return off < 1 ? told + ": poses are off by no more, forces of contacts and stops may be"
                   : told + where();
  });
}

std::optional<SanityMonitor::BodyPair> SanityMonitor::PushedApart(double rise) const {
  std::optional<BodyPair> found;
  double most = 0, sum = 0;
  for (const auto& [key, pair] : pairs_) {
    const double work = pair.overlap * pair.force_W.norm();
    sum += work;
    if (work > most) most = work, found = key;
  }
  return rise < sum ? found : std::nullopt;
}

// Whether something outside may have done work: an input that moved, now or a step ago, or a motor.
bool SanityMonitor::IsDriven(const Simulation& simulation, const Seen& seen) {
  const VectorX controls = InputsOf(simulation);
  bool driven = seen.pushed || controls.size() != controls_.size() || controls != controls_;
  for (std::size_t i = 0; i < is_setpoint_.size() && static_cast<int>(i) < controls.size(); ++i)
    driven |= !is_setpoint_[i] && controls(static_cast<int>(i)) != 0;
  controls_ = controls;
  return driven;
}

void SanityMonitor::CheckEnergy(const Simulation& simulation, const Seen& seen) {
  const bool driven = IsDriven(simulation, seen);
  const double rise = seen.energy - energy_;
  const double rounding = 1e-6 * std::max(std::abs(seen.energy), std::abs(energy_));
  // What contacts hold that are pressed in by the depth of the material is no part of the energy.
  double held = 0;
  for (const auto& [key, pair] : pairs_)
    held += pair.force_W.norm() * simulation.step_options().material.depth;
  // Stops that bring inside what started beyond them do work.
  const auto& mechanisms = simulation.world().mechanisms();
  beyond_stops_.resize(mechanisms.size());
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const std::vector<double>& impulses = simulation.world().StopImpulses(static_cast<int>(i));
    std::vector<double>& beyond = beyond_stops_[i];
    beyond.resize(impulses.size(), 0.0);
    for (std::size_t at = 0; at < impulses.size(); ++at) {
      held += impulses[at] / simulation.dt() * std::max(0.0, beyond[at]);
      const Mechanism::LengthLimit& limit = mechanisms[i].length_limits()[at / 2];
      const double length = mechanisms[i].Length(limit.length);
      beyond[at] = at % 2 == 1 ? length - limit.upper : limit.lower - length;
    }
  }
  if (!driven && !driven_before_ && rise > rounding)
    Note(kEnergy, rise / (kRise * kinetic_ + held), [&] {
      if (const auto pair = PushedApart(rise))
        return NameOf(simulation, pair->first, pairs_.at(*pair).still_shape) + " and " +
               NameOf(simulation, pair->second, pairs_.at(*pair).still_shape) +
               Print(
                   " overlap by %.3g mm at the start, and pushing them apart adds energy, %.3g J in the step "
                   "to %.4g s",
                   1e3 * pairs_.at(*pair).overlap, rise, simulation.time()) +
               "; place them apart";
      return Print("in the step to %.4g s energy rises by %.3g J to %.4g J, and no input did work: ",
                   simulation.time(), rise, seen.energy) +
             "the motion is not to be trusted; try a smaller time step";
    });
  driven_before_ = driven;
  energy_ = seen.energy;
  kinetic_ = std::max(kinetic_, seen.kinetic);
}

void SanityMonitor::Update(const Simulation& simulation, const Seen& seen) {
  UpdatePairs(simulation);
  CheckSpeeds(simulation);
  CheckDepths(simulation);
  CheckSinking(simulation);
  Note(kApart, seen.gap / (kOpen * size_), [&] {
    return Print("at %.4g s a joint or loop is %.3g mm apart, in a mechanism of %.3g m: ", simulation.time(),
                 1e3 * seen.gap, size_) +
           "forces or speeds are beyond what a step holds together; try exact recovery, a smaller time step "
           "or "
           "gentler inputs";
  });
  CheckForces(simulation, seen);
  CheckEnergy(simulation, seen);
}

std::vector<std::string> SanityMonitor::Sentences() const {
  std::vector<std::string> out;
  for (const Worst& worst : worst_)
    if (worst.times > 1) out.push_back(worst.sentence);
  return out;
}

}  // namespace fork1s
