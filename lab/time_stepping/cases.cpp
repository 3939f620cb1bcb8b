#include "cases.hpp"

#include <cmath>
#include <numbers>
#include <random>

#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s::lab {

namespace {

constexpr double kGravity = 9.81;
VectorX Still(const System& s) { return VectorX::Zero(6 * static_cast<Eigen::Index>(s.bodies.size())); }

std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

Body Rod(double mass, double length) {
  const double I = mass * length * length / 12;
  return {mass, Vector3(I + 1e-4 * mass, I + 1e-4 * mass, 2e-4 * mass)};
}

Matrix3 AboutY(double angle) { return ExpRotation(Vector3(0, angle, 0)); }

Vector3 BoxInertia(double mass, const Vector3& s) {
  return mass / 12 *
         Vector3(s.y() * s.y() + s.z() * s.z(), s.x() * s.x() + s.z() * s.z(), s.x() * s.x() + s.y() * s.y());
}

}  // namespace

// 0.5 kg on a spring of 0.5 m, let go at rest under the load of its weight along the spring.
Case Bob(double k, double amplitude) {
  Case c{"bob", "k=" + Text(k) + " a=" + Text(amplitude), {}, {}, 10, 0, {}};
  const double m = 0.5, L = 0.5;
  c.system.size = L;
  c.system.bodies = {{m, Vector3::Constant(0.01)}};
  c.system.springs = {{0, -1, Vector3::Zero(), Vector3::Zero(), k, L, 0}};
  const double r = L + m * kGravity * std::cos(amplitude) / k;
  c.start =
      MakeState(c.system, {{r * Vector3(std::sin(amplitude), 0, -std::cos(amplitude)), Matrix3::Identity()}},
                Still(c.system));
  const double stretch = m * kGravity / k;
  c.lowest_energy = 0.5 * k * stretch * stretch - m * kGravity * (L + stretch);
  return c;
}

// A plate of 2 kg on two links of 0.4 m and 0.5 m.
Case Tray(double k) {
  Case c{"tray", "k=" + Text(k), {}, {}, 10, 0, {}};
  System& s = c.system;
  const double m = 2, L = 0.4;
  s.size = L;
  s.bodies = {{m, BoxInertia(m, Vector3(0.3, 0.2, 0.05))}};
  // A third and fourth link of the same kind at y = ±0.1 keep it from turning about x and z.
  for (const double y : {-0.1, 0.1})
    for (const double x : {-0.15, 0.15}) s.springs.push_back({0, -1, {x, y, 0.02}, {x, y, 0}, k / 2, L, 0});
  const double stretch = m * kGravity / (2 * k);
  c.lowest_energy = 0.5 * 2 * k * stretch * stretch - m * kGravity * (L + 0.02 + stretch);
  const double a = 0.3, r = L + stretch * std::cos(a);
  c.start =
      MakeState(s, {{Vector3(r * std::sin(a), 0, -r * std::cos(a) - 0.02), Matrix3::Identity()}}, Still(s));
  return c;
}

// A rod of 1 kg and 0.5 m on a rigid hinge.
Case Pendulum(double amplitude) {
  Case c{"pendulum", "a=" + Text(amplitude), {}, {}, 10, 0, {}};
  System& s = c.system;
  s.size = 0.5;
  s.bodies = {Rod(1, 0.5)};
  s.AddHinge(0, -1, {0, 0, 0.25}, Vector3::Zero(), Vector3::UnitY());
  const Matrix3 R = AboutY(amplitude);
  c.start = MakeState(s, {{-(R * Vector3(0, 0, 0.25)), R}}, Still(s));
  c.lowest_energy = -kGravity * 0.25;
  return c;
}

Case DoublePendulum() {
  Case c{"double_pendulum", "", {}, {}, 5, 0, {}};
  System& s = c.system;
  s.size = 0.5;
  s.bodies = {Rod(1, 0.5), Rod(1, 0.5)};
  s.AddHinge(0, -1, {0, 0, 0.25}, Vector3::Zero(), Vector3::UnitY());
  s.AddHinge(1, 0, {0, 0, 0.25}, {0, 0, -0.25}, Vector3::UnitY());
  const Matrix3 R = AboutY(0.8), Q = AboutY(0.3);
  const Vector3 first = -(R * Vector3(0, 0, 0.25)), second = 2 * first - Q * Vector3(0, 0, 0.25);
  c.start = MakeState(s, {{first, R}, {second, Q}}, Still(s));
  c.lowest_energy = -kGravity * (0.25 + 0.75);
  return c;
}

// Crank 0.2 m, coupler 0.5 m, rocker 0.4 m on pivots 0.45 m apart, hanging; the crank turns at 6 rad/s.
Case FourBar() {
  Case c{"four_bar", "", {}, {}, 3, 0, {}};
  System& s = c.system;
  s.size = 0.5;
  const double a = 0.2, b = 0.5, d = 0.4, g = 0.45;
  s.bodies = {Rod(0.5, a), Rod(1, b), Rod(0.8, d)};
  // Bodies' z axes point from the far to the near end.
  const auto place = [](const Vector3& from, const Vector3& to) {
    const Vector3 along = (from - to).normalized();
    return Pose{0.5 * (from + to), AboutY(std::atan2(along.x(), along.z()))};
  };
  const double crank = 0.7;
  const Vector3 A = a * Vector3(std::sin(crank), 0, -std::cos(crank)), O(g, 0, 0);
  const Vector3 AO = O - A;
  const double l = AO.norm(), x = (b * b - d * d + l * l) / (2 * l), y = std::sqrt(b * b - x * x);
  const Vector3 e = AO / l, B = A + x * e + y * Vector3(e.z(), 0, -e.x());
  const Vector3 below = B.z() < A.z() ? B : Vector3(A + x * e - y * Vector3(e.z(), 0, -e.x()));
  s.AddHinge(0, -1, {0, 0, a / 2}, Vector3::Zero(), Vector3::UnitY());
  s.AddHinge(1, 0, {0, 0, b / 2}, {0, 0, -a / 2}, Vector3::UnitY());
  s.AddHinge(2, -1, {0, 0, d / 2}, O, Vector3::UnitY());
  s.points.push_back({1, 2, {0, 0, -b / 2}, {0, 0, -d / 2}, {true, false, true}});
  VectorX V = Still(s);
  V(1) = 6;
  V.segment<3>(3) = Vector3(0, 6, 0).cross(Vector3(0.5 * A));
  c.start = MakeState(s, {place(Vector3::Zero(), A), place(A, below), place(O, below)}, V);
  // Scaled so that the crank turns at 6 rad/s.
  c.start = MakeState(s, c.start.poses, 6 / c.start.V(1) * c.start.V);
  c.lowest_energy = Energy(s, c.start) - 2 * KineticEnergy(s, c.start);
  return c;
}

// A foot of 1 kg with four corners on the floor, an elastic ankle, a mast of 3 kg that sways about the
// vertical by `amplitude`. It starts upright with the loads of its contacts in balance; the foot rocks from
// 0.14 rad on.
Case StandingLeg(double amplitude) {
  Case c{"standing_leg", "a=" + Text(amplitude), {}, {}, 3, 0, {}};
  System& s = c.system;
  s.size = 0.5;
  s.bodies = {{1, BoxInertia(1, Vector3(0.3, 0.2, 0.04))}, Rod(3, 0.5)};
  for (const double x : {-0.15, 0.15})
    for (const double y : {-0.1, 0.1})
      s.contacts.push_back({0, -1, {x, y, -0.02}, 0, Vector3::Zero(), Vector3::UnitZ(), 0.8, 0});
  s.AddHinge(1, 0, {0, 0, -0.25}, {0, 0, 0.02}, Vector3::UnitY());
  s.torsions = {{1, 0, Vector3::UnitY(), 40, 0, 0}};
  const double inertia = s.bodies[1].inertia.y() + 3 * 0.25 * 0.25;
  const double rate = amplitude * std::sqrt((40 - 3 * kGravity * 0.25) / inertia);
  const double sunk = (4 * kGravity - 3 * rate * rate * 0.25) / (4 * s.contact_stiffness);
  VectorX V = Still(s);
  V(7) = rate;
  V(9) = 0.25 * rate;
  c.start = MakeState(
      s,
      {{{0, 0, 0.02 - sunk}, Matrix3::Identity()}, {Vector3(0, 0, 0.04 + 0.25 - sunk), Matrix3::Identity()}},
      V);
  c.start.closed.assign(4, 1);
  for (Vector3& phi : c.start.phi) phi = Vector3(0, 0, s.contact_stiffness * sunk);
  c.lowest_energy = PotentialEnergy(s, c.start);
  return c;
}

// The leg at rest, but started `depth` inside the floor.
Case Overlap(double depth) {
  Case c = StandingLeg(0);
  c.name = "overlap";
  c.parameter = "depth=" + Text(depth);
  c.duration = 1;
  for (Pose& X : c.start.poses) X.x.z() -= depth;
  c.start.phi.assign(4, Vector3::Zero());
  c.lowest_energy = Energy(c.system, c.start) - 2 * c.system.contact_stiffness * depth * depth;
  return c;
}

// A mass on a spring at rest length zero.
Case Oscillator(double frequency) {
  Case c{"oscillator", "Hz=" + Text(frequency), {}, {}, 3, 0, {}};
  c.system.gravity.setZero();
  c.system.bodies = {{1, Vector3::Constant(0.01)}};
  c.system.springs = {
      {0, -1, Vector3::Zero(), Vector3::Zero(), std::pow(2 * std::numbers::pi * frequency, 2), 0, 0}};
  c.start = MakeState(c.system, {{Vector3(0.1, 0, 0), Matrix3::Identity()}}, Still(c.system));
  return c;
}

Case BouncingBall() {
  Case c{"bouncing_ball", "", {}, {}, 2, 0, {}};
  System& s = c.system;
  const double m = 0.2, r = 0.05;
  s.size = r;
  s.bodies = {{m, Vector3::Constant(0.4 * m * r * r)}};
  s.contacts = {{0, -1, Vector3::Zero(), r, Vector3::Zero(), Vector3::UnitZ(), 0.3, 0.8}};
  VectorX V = Still(s);
  V(3) = 0.5;
  c.start = MakeState(s, {{{0, 0, 1 + r}, Matrix3::Identity()}}, V);
  c.start.closed = {0};
  c.lowest_energy = m * kGravity * r;
  return c;
}

// Slides at 1.5 m/s, spins at 30 rad/s about the vertical.
Case SlidingBall() {
  Case c{"sliding_ball", "", {}, {}, 0.6, 0, {}};
  System& s = c.system;
  const double m = 0.5, r = 0.05;
  s.size = r;
  s.bodies = {{m, Vector3::Constant(0.4 * m * r * r)}};
  s.contacts = {{0, -1, Vector3::Zero(), r, Vector3::Zero(), Vector3::UnitZ(), 0.1, 0}};
  VectorX V = Still(s);
  V(2) = 30;
  V(3) = 1.5;
  c.start = MakeState(s, {{{0, 0, r - m * kGravity / s.contact_stiffness}, Matrix3::Identity()}}, V);
  c.start.xi[0] = Vector3(0.1 * m * kGravity / s.contact_stiffness, 0, 0);
  c.start.closed = {1};
  return c;
}

// An egg-shaped load in a sphere: the ball rolls with its centre of mass off its centre, so that it rocks.
Case RollingBall() {
  Case c{"rolling_ball", "", {}, {}, 2, 0, {}};
  System& s = c.system;
  const double m = 0.5, r = 0.05;
  s.size = r;
  s.bodies = {{m, m * r * r * Vector3(0.35, 0.4, 0.45)}};
  s.contacts = {{0, -1, Vector3(0, 0, 0.3 * r), r, Vector3::Zero(), Vector3::UnitZ(), 0.8, 0}};
  VectorX V = Still(s);
  // Rolls without slip: v = −ω × (contact − center of mass)
  const Vector3 omega(0.5, 8, 0.5);
  V.head<3>() = omega;
  V.segment<3>(3) = -omega.cross(Vector3(0, 0, -0.7 * r));
  c.start = MakeState(s, {{{0, 0, 0.7 * r - m * kGravity / s.contact_stiffness}, Matrix3::Identity()}}, V);
  c.start.closed = {1};
  c.lowest_energy = Energy(s, c.start) - KineticEnergy(s, c.start);
  return c;
}

Case Stack() {
  Case c{"stack", "", {}, {}, 5, 0, {}};
  System& s = c.system;
  s.size = 0.2;
  const Vector3 box(0.2, 0.2, 0.2);
  std::vector<Pose> poses;
  for (int i = 0; i < 3; ++i) {
    s.bodies.push_back({1, BoxInertia(1, box)});
    for (const double x : {-0.1, 0.1})
      for (const double y : {-0.1, 0.1})
        s.contacts.push_back({i, i - 1, {x, y, -0.1}, 0, {0, 0, i > 0 ? 0.1 : 0.}, Vector3::UnitZ(), 0.5, 0});
    poses.push_back({{0.01 * i, -0.015 * i, 0.1 + 0.2 * i}, Matrix3::Identity()});
  }
  c.start = MakeState(s, poses, Still(s));
  return c;
}

// A box of 1 kg between two pads that springs press on it with 2 % more than its weight needs.
Case Grasp() {
  Case c{"grasp", "", {}, {}, 5, 0, {}};
  System& s = c.system;
  s.size = 0.1;
  const double m = 1, mu = 0.5, squeeze = 1.02 * m * kGravity / (2 * mu), k = 2e3, edge = 0.05;
  s.bodies = {{m, BoxInertia(m, Vector3::Constant(2 * edge))},
              {0.2, Vector3::Constant(1e-4)},
              {0.2, Vector3::Constant(1e-4)}};
  const double sunk = squeeze / 4 / s.contact_stiffness, hold = squeeze / k;
  for (int side = 0; side < 2; ++side) {
    const double out = side == 0 ? -1 : 1;
    const int pad = 1 + side;
    for (const double y : {-edge, edge})
      for (const double z : {-edge, edge})
        s.contacts.push_back(
            {0, pad, {out * edge, y, z}, 0, {-out * 0.01, 0, 0}, Vector3(-out, 0, 0), mu, 0});
    const double x = out * (edge + 0.01 - sunk);
    s.points.push_back({pad, -1, Vector3::Zero(), {x, 0, 0}, {false, true, true}});
    s.AddLockedRotation(pad, -1);
    s.springs.push_back({pad, -1, Vector3::Zero(), {x - out * hold, 0, 0}, k, 0, 0});
  }
  std::vector<Pose> poses = {{},
                             {{-(edge + 0.01 - sunk), 0, 0}, Matrix3::Identity()},
                             {{edge + 0.01 - sunk, 0, 0}, Matrix3::Identity()}};
  c.start = MakeState(s, poses, Still(s));
  c.start.closed.assign(8, 1);
  for (Vector3& xi : c.start.xi) xi = Vector3(0, 0, -m * kGravity / 8 / s.contact_stiffness);
  // φ on the box: its part of the weight and of the squeeze
  for (std::size_t i = 0; i < 8; ++i)
    c.start.phi[i] = Vector3((i < 4 ? 1 : -1) * squeeze / 4, 0, m * kGravity / 8);
  return c;
}

// A free body that spins about its middle axis.
Case Tumbling() {
  Case c{"tumbling", "", {}, {}, 5, 0, {}};
  c.system.gravity.setZero();
  c.system.bodies = {{1, Vector3(0.01, 0.02, 0.03)}};
  c.system.size = 0.2;
  VectorX V = Still(c.system);
  V.head<3>() = Vector3(0.1, 5, 0.1);
  c.start = MakeState(c.system, {{}}, V);
  return c;
}

// A rod on a servo whose target jumps every quarter of a second; damping ratio 1 of the servo alone.
Case Servo(double k) {
  Case c{"servo", "k=" + Text(k), {}, {}, 2, 0, {}};
  System& s = c.system;
  s.size = 0.5;
  s.bodies = {Rod(1, 0.5)};
  s.AddHinge(0, -1, {0, 0, 0.25}, Vector3::Zero(), Vector3::UnitY());
  const double inertia = 1. / 3 * 0.25;
  s.torsions = {{0, -1, Vector3::UnitY(), k, 2 * std::sqrt(k * inertia), 0}};
  c.start = MakeState(s, {{{0, 0, -0.25}, Matrix3::Identity()}}, Still(s));
  c.lowest_energy = Energy(s, c.start) - 0.5 * k * 0.16;  // in shares of what a jump brings
  c.input = [](double time, System& system) {
    system.torsions[0].target = 0.4 * (static_cast<int>(std::floor(time * 4 + 1e-6)) % 2);
  };
  return c;
}

// A block on a vertical elastic leg with a foot that lands at 2 m/s and stays.
Case Landing(double k) {
  Case c{"landing", "k=" + Text(k), {}, {}, 1, 0, {}};
  System& s = c.system;
  s.size = 0.5;
  s.bodies = {{0.5, BoxInertia(0.5, Vector3(0.2, 0.2, 0.04))}, {3, BoxInertia(3, Vector3::Constant(0.2))}};
  for (const double x : {-0.1, 0.1})
    for (const double y : {-0.1, 0.1})
      s.contacts.push_back({0, -1, {x, y, -0.02}, 0, Vector3::Zero(), Vector3::UnitZ(), 0.5, 0});
  s.points = {{1, 0, Vector3::Zero(), Vector3::Zero(), {true, true, false}}};
  s.AddLockedRotation(1, 0);
  s.springs = {{1, 0, Vector3::Zero(), {0, 0, 0.4}, k, 0, 0.3 * 2 * std::sqrt(3 * k)}};
  VectorX V = Still(s);
  V(5) = V(11) = -2;
  c.start = MakeState(s, {{{0, 0, 0.1}, Matrix3::Identity()}, {{0, 0, 0.5}, Matrix3::Identity()}}, V);
  c.start.closed.assign(4, 0);
  return c;
}

// Four bodies on hinges, every second one floating, every third one with a rod that closes a loop.
Case RandomTree(unsigned seed, double factor) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto vector = [&] { return Vector3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)); };
  Case c{"random_tree", "factor=" + Text(factor) + " seed=" + std::to_string(seed), {}, {}, 5, 0, {}};
  System& s = c.system;
  const int n = 4;
  const bool floating = seed % 2 == 1;
  if (floating) s.gravity.setZero();
  std::vector<Pose> poses;
  for (int i = 0; i < n; ++i) {
    const double m = std::exp(uniform(-1.5, 0.5));
    s.bodies.push_back({m, m * Vector3(uniform(0.008, 0.012), uniform(0.008, 0.012), uniform(0.008, 0.012))});
    const int parent = i == 0 ? -1 : static_cast<int>(uniform(0, i - 1e-9));
    const Vector3 in = 0.15 * vector(), out = parent < 0 ? Vector3::Zero() : Vector3(0.15 * vector());
    const Vector3 base = parent < 0 ? Vector3::Zero() : poses[static_cast<std::size_t>(parent)].x;
    poses.push_back({base + out - in, Matrix3::Identity()});
    const Vector3 axis = vector().normalized();
    if (parent < 0 && floating) continue;
    s.AddHinge(i, parent, in, out, axis);
    s.torsions.push_back({i, parent, axis, factor * std::exp(uniform(0, 4)), 0, 0});
  }
  for (int i = 0; i < 2; ++i) {
    const int a = static_cast<int>(uniform(1, n - 1e-9)), b = floating ? 0 : -1;
    const Vector3 pa = 0.1 * vector(), pb = 0.3 * vector();
    const double length =
        (poses[static_cast<std::size_t>(a)].x + pa - (b < 0 ? Vector3::Zero() : poses[0].x) - pb).norm();
    s.springs.push_back({a, b, pa, pb, factor * std::exp(uniform(2, 6)), length, 0});
  }
  if (seed % 3 == 0) {
    const Vector3 pa = 0.1 * vector(), pb = 0.1 * vector();
    s.distances.push_back({n - 1, 0, pa, pb, (poses[n - 1].x + pa - poses[0].x - pb).norm()});
  }
  s.size = 0.5;
  VectorX V(6 * n);
  for (int i = 0; i < n; ++i) V.segment<6>(6 * i) << 3 * vector(), 0.5 * vector();
  c.start = MakeState(s, poses, V);
  c.lowest_energy = PotentialEnergy(s, c.start);
  return c;
}

}  // namespace fork1s::lab
