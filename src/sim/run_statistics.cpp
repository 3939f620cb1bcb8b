#include <fork1s/sim/run_statistics.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>

namespace fork1s {
namespace {

constexpr double kAtCone = 0.99;  // share of the friction from which a contact may slide
// Way in a step, as a share of the smaller shape's radius, from which a contact slides: the solution of a step is known
// to less.
constexpr double kSlides = 1e-5;

void Count(EndReached& end, double time, bool upper) {
  if (end.steps == 0) end.first = time;
  ++end.steps;
  end.last = time;
  (upper ? end.upper : end.lower) = true;
}

std::vector<EndReached> Longest(const std::map<std::pair<int, std::size_t>, EndReached>& all) {
  std::vector<EndReached> out;
  for (const auto& [key, end] : all) out.push_back(end);
  std::stable_sort(out.begin(), out.end(),
                   [](const EndReached& a, const EndReached& b) { return a.steps > b.steps; });
  return out;
}

ContactLoad LoadOf(const Vector3& force_W, const Vector3& moment_W, double normal, double tangential,
                   double friction) {
  return {force_W, moment_W, normal, friction > 0 ? tangential : 0, friction > 0 ? friction * normal : 0};
}

// Of a body that moves by V, at a place that is that far from its origin.
Vector3 VelocityAt(const Vector6& V, const Vector3& arm) { return V.tail<3>() + V.head<3>().cross(arm); }

struct BeyondStop {
  double distance = 0, share = 0;  // rad or m, and of the range; at most 0 inside
  bool turns = false, upper = false;
};

BeyondStop BeyondStopOf(const MechanismDynamics& m, const Mechanism::LengthLimit& limit) {
  const double length = m.Length(limit.length), above = length - limit.upper, below = limit.lower - length;
  const bool turns = m.mechanism().IsAngle(limit.length);
  const double range = limit.upper - limit.lower, whole = std::isfinite(range) && range > 0 ? range
                                                          : turns                           ? 1
                                                                  : m.mechanism().length_scale();
  const double beyond = std::max(above, below);
  return {beyond, beyond / whole, turns, above > below};
}

}  // namespace

void AddRelinearizations(const StepReport& report, const World& world, RelinearizationTotals& totals) {
  for (std::size_t i = 0; i < totals.size(); ++i) {
    const Relinearizations& more = report.refreshes_by_cause[i];
    totals[i].count += more.count;
    if (!(more.largest.share > totals[i].largest.share)) continue;
    totals[i].largest = more.largest;
    totals[i].of = world.NameOf(more.of);
  }
}

ContactLoad ContactLoad::OfContact(const Vector3& force_W, const Vector3& normal_W, double friction) {
  const double normal = normal_W.dot(force_W);
  return LoadOf(force_W, Vector3::Zero(), normal, (force_W - normal * normal_W).norm(), friction);
}

ContactLoad& ContactLoad::Add(const ContactLoad& other, double weight) {
  force_W += weight * other.force_W;
  moment_W += weight * other.moment_W;
  normal += weight * other.normal;
  tangential += weight * other.tangential;
  friction_limit += weight * other.friction_limit;
  return *this;
}

PairLoad& RunStatistics::Pair(int a, int b) {
  PairLoad& pair = pairs_[{a, b}];
  pair.body_a = a;
  pair.body_b = b;
  return pair;
}

void RunStatistics::Begin(const Simulation& simulation) {
  velocity_.assign(simulation.bodies().size(), Vector6::Zero());
  for (std::size_t c = 1; c < simulation.world().collision_bodies().size(); ++c) {
    const int body = simulation.BodyOfCollisionBody(static_cast<int>(c));
    if (body >= 0) velocity_[static_cast<std::size_t>(body)] = simulation.Velocity(body);
  }
  const auto& mechanisms = simulation.world().mechanisms();
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const auto& limits = mechanisms[i].length_limits();
    for (std::size_t k = 0; k < limits.size(); ++k)
      if (const double share = BeyondStopOf(mechanisms[i], limits[k]).share; share > 0)
        outside_at_start_[{static_cast<int>(i), k}] = share;
  }
}

void RunStatistics::UpdateContacts(const Simulation& simulation) {
  const double h = simulation.dt();
  struct Sliding {
    double relative = 0, a = 0, b = 0;  // m/s
  };
  std::map<std::pair<int, int>, Sliding> fastest;  // of contacts that slide
  const bool begins = velocity_.size() != simulation.bodies().size();
  last_velocity_ = velocity_;
  Begin(simulation);
  if (begins) last_velocity_ = velocity_;
  const auto now = [&](int body) {
    return body < 0 ? Vector6(Vector6::Zero()) : velocity_[static_cast<std::size_t>(body)];
  };
  // An impulse takes as much energy as it bears against the mean of the velocities before and after it.
  const auto mean = [&](int body) {
    return body < 0 ? Vector6(Vector6::Zero())
                    : Vector6(0.5 * (now(body) + last_velocity_[static_cast<std::size_t>(body)]));
  };
  for (const ContactRecord& c : simulation.world().contacts()) {
    if (!(c.impulse(0) > 0)) continue;
    int a = simulation.BodyOfCollisionBody(c.point.body_a),
        b = simulation.BodyOfCollisionBody(c.point.body_b);
    // Arms at the poses that the point was found at: what rolls fast is elsewhere by the end of the step.
    const auto arm = [&](int collision_body) {
      return Vector3(c.point.point - simulation.world().PoseAtDetection(collision_body).translation());
    };
    Vector3 arm_a = arm(c.point.body_a), arm_b = arm(c.point.body_b);
    const double sign = a <= b ? 1 : -1;  // contacts act on their b
    if (a > b) {
      std::swap(a, b);
      std::swap(arm_a, arm_b);
    }
    PairLoad& pair = Pair(a, b);
    const Vector3 force = sign * (c.point.frame.transpose() * c.impulse) / h;
    const Vector3 moment =
        sign * (c.point.frame.transpose() * c.moment) / h + (b < 0 ? c.point.point : arm_b).cross(force);
    pair.last.Add(LoadOf(force, moment, c.normal_sum / h, c.tangential_sum / h, c.friction), 1);
    const Vector6 V_a = mean(a), V_b = mean(b);
    const Vector3 spin = c.point.frame * Vector3(V_b.head<3>() - V_a.head<3>());
    pair.friction_loss -= sign * c.moment.dot(spin) + c.moment[0] * c.point.surface_velocity[0];
    if (!(c.friction > 0) || c.tangential_sum < kAtCone * c.friction * c.normal_sum) continue;
    const Vector3 slides = VelocityAt(V_b, arm_b) - VelocityAt(V_a, arm_a);
    const auto tangents = c.point.frame.bottomRows<2>();
    const Vector2 of_surfaces = sign * c.point.surface_velocity.tail<2>();
    pair.friction_loss -= sign * c.impulse.tail<2>().dot(tangents * slides + of_surfaces);
    const Vector3 of_a = VelocityAt(now(a), arm_a), of_b = VelocityAt(now(b), arm_b);
    const double speed = (tangents * (of_b - of_a) + of_surfaces).norm();
    if (!(speed * h > kSlides * simulation.world().PairSize(c.point))) continue;
    Sliding& most = fastest[{a, b}];
    if (speed > most.relative) most = {speed, (tangents * of_a).norm(), (tangents * of_b).norm()};
  }
  for (const auto& [key, speed] : fastest) {
    PairLoad& pair = pairs_[key];
    if (pair.slip_first < 0) pair.slip_first = simulation.time();
    pair.slip_last = simulation.time();
    pair.slip += speed.relative * h;
    pair.way_a += speed.a * h;
    pair.way_b += speed.b * h;
    pair.slip_s += h;
  }
}

void RunStatistics::UpdateFrozenContacts(const Simulation& simulation) {
  for (const FrozenContactForce& f : simulation.FrozenContactForces()) {
    const bool swapped = f.body > f.held;
    PairLoad& pair = Pair(std::min(f.body, f.held), std::max(f.body, f.held));
    const Vector3 force = swapped ? Vector3(-f.force_W) : f.force_W;
    ContactLoad load = ContactLoad::OfContact(force, swapped ? Vector3(-f.normal_W) : f.normal_W, f.friction);
    load.moment_W = Vector3(f.point_W - simulation.Pose(pair.body_b).translation()).cross(force);
    pair.last.Add(load, 1);
  }
}

void RunStatistics::UpdateBodyFriction(const Simulation& simulation) {
  constexpr std::size_t kMaxMoments = 500;  // as many as a plot has columns; beyond, neighbours are joined
  std::map<int, ContactLoad> loads;
  for (const auto& [key, pair] : pairs_)
    for (const int body : {key.first, key.second})
      if (body >= 0) loads[body].Add(pair.last, 1);
  for (const auto& [body, load] : loads) {
    if (!(load.friction_limit > 0)) continue;
    const SceneBody& of = simulation.bodies()[static_cast<std::size_t>(body)];
    const bool is_base =
        of.mechanism >= 0 && of.index == 0 &&
        simulation.world().mechanisms()[static_cast<std::size_t>(of.mechanism)].mechanism().base() ==
            BaseKind::kFloating;
    if (of.given >= 0 && !is_base) continue;
    BodyCourse& course = bodies_[body];
    BodyFriction& f = course.friction;
    const double use = load.FrictionUse();
    f.body = body;
    f.use_mean += use * simulation.dt();  // divided by touched_s in BodyFrictions
    f.touched_s += simulation.dt();
    if (use > f.use_max) {
      f.use_max = use;
      f.use_max_s = simulation.time();
    }
    if (course.in_last > 0 && course.in_last < course.stride) {
      ++course.in_last;
      if (use > f.course.back().use) f.course.back() = {simulation.time(), use};
      continue;
    }
    if (f.course.size() >= kMaxMoments) {
      for (std::size_t i = 0; 2 * i + 1 < f.course.size(); ++i)
        f.course[i] = f.course[2 * i].use > f.course[2 * i + 1].use ? f.course[2 * i] : f.course[2 * i + 1];
      f.course.resize(f.course.size() / 2);
      course.stride *= 2;
    }
    f.course.push_back({simulation.time(), use});
    course.in_last = 1;
  }
}

void RunStatistics::UpdatePassedStops(const Simulation& simulation) {
  const auto& mechanisms = simulation.world().mechanisms();
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const MechanismDynamics& m = mechanisms[i];
    for (std::size_t k = 0; k < m.length_limits().size(); ++k) {
      const Mechanism::LengthLimit& limit = m.length_limits()[k];
      const BeyondStop beyond = BeyondStopOf(m, limit);
      const std::pair key(static_cast<int>(i), k);
      if (beyond.distance <= 0) outside_at_start_.erase(key);
      const auto start = outside_at_start_.find(key);
      const double allowed = start == outside_at_start_.end() ? 0 : start->second;
      if (beyond.share <= allowed + StopPassed::kShareBeyond) continue;
      auto& [most, stop] = passed_[key];
      if (stop.name.empty()) stop.first = simulation.time();
      if (beyond.share <= most) continue;
      most = beyond.share;
      stop.name = limit.WhatAndName();
      stop.turns = beyond.turns;
      stop.beyond = beyond.distance;
      stop.when = simulation.time();
      stop.upper = beyond.upper;
    }
  }
}

void RunStatistics::Update(const Simulation& simulation) {
  for (auto& [key, pair] : pairs_) pair.last = {};
  UpdateContacts(simulation);
  UpdateFrozenContacts(simulation);
  UpdateBodyFriction(simulation);
  for (auto& [key, pair] : pairs_) {
    const double force = pair.last.force_W.norm();
    if (!(force > 0)) continue;
    if (pair.touched_s == 0) pair.touched_first = simulation.time();
    pair.touched_last = simulation.time();
    pair.touched_s += simulation.dt();
    pair.mean.Add(pair.last, simulation.dt());  // divided by touched_s in Pairs
    if (const double use = pair.last.FrictionUse(); use > pair.use_max) {
      pair.use_max = use;
      pair.use_max_s = simulation.time();
    }
    if (pair.last.normal > pair.normal_max) {
      pair.normal_max = pair.last.normal;
      pair.normal_max_s = simulation.time();
    }
    if (pair.last.tangential > pair.tangential_max) {
      pair.tangential_max = pair.last.tangential;
      pair.tangential_max_s = simulation.time();
    }
    if (force <= pair.peak.force_W.norm()) continue;
    pair.peak = pair.last;
    pair.peak_s = simulation.time();
  }
  UpdatePassedStops(simulation);
  const auto& mechanisms = simulation.world().mechanisms();
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const MechanismDynamics& m = mechanisms[i];
    const std::vector<double>& impulses = simulation.world().StopImpulses(static_cast<int>(i));
    for (std::size_t at = 0; at < impulses.size(); ++at) {
      if (!(impulses[at] > 0)) continue;
      EndReached& end = stops_[{static_cast<int>(i), at / 2}];
      end.name = m.length_limits()[at / 2].WhatAndName();
      Count(end, simulation.time(), at % 2 == 1);
    }
    if (m.NumForcesAtBound() == 0) continue;
    MechanismState state;
    m.Save(state);
    const auto& limits = m.mechanism().force_limits();
    for (std::size_t k = 0; k < state.at_bound.size() && k < limits.size(); ++k) {
      if (state.at_bound[k] == 0) continue;
      EndReached& end = servos_[{static_cast<int>(i), k}];
      end.name = "actuator '" + limits[k].name + "'";
      Count(end, simulation.time(), state.at_bound[k] > 0);
    }
  }
}

std::vector<PairLoad> RunStatistics::Pairs() const {
  std::vector<PairLoad> out;
  for (const auto& [key, pair] : pairs_) {
    out.push_back(pair);
    if (pair.touched_s > 0) out.back().mean = ContactLoad().Add(pair.mean, 1 / pair.touched_s);
  }
  std::stable_sort(out.begin(), out.end(), [](const PairLoad& a, const PairLoad& b) {
    return a.peak.force_W.norm() > b.peak.force_W.norm();
  });
  return out;
}

std::vector<BodyFriction> RunStatistics::BodyFrictions() const {
  std::vector<BodyFriction> out;
  for (const auto& [body, course] : bodies_) {
    out.push_back(course.friction);
    out.back().use_mean /= course.friction.touched_s;
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const BodyFriction& a, const BodyFriction& b) { return a.use_max > b.use_max; });
  return out;
}

double RunStatistics::FrictionLoss() const {
  double sum = 0;
  for (const auto& [key, pair] : pairs_) sum += pair.friction_loss;
  return sum;
}

std::vector<StopPassed> RunStatistics::PassedStops() const {
  std::vector<std::pair<double, StopPassed>> all;
  for (const auto& [key, stop] : passed_) all.push_back(stop);
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<StopPassed> out;
  for (auto& [share, stop] : all) out.push_back(std::move(stop));
  return out;
}

std::vector<EndReached> RunStatistics::Stops() const { return Longest(stops_); }
std::vector<EndReached> RunStatistics::Servos() const { return Longest(servos_); }

}  // namespace fork1s
