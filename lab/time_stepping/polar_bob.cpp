#include "polar_bob.hpp"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace fork1s::lab {

namespace {

using Matrix2 = Eigen::Matrix2d;
constexpr double kMass = 0.5, kLength = 0.5, kBobGravity = 9.81;

struct Point {
  Vector2 z, w, p, rate;  // (r, θ), rates, momentum and its rate in world axes
};

Vector2 Along(double angle) { return {std::sin(angle), -std::cos(angle)}; }
Vector2 Across(double angle) { return {std::cos(angle), std::sin(angle)}; }
Vector2 Force(const Vector2& z, double k) {
  return -k * (z[0] - kLength) * Along(z[1]) - Vector2(0, kMass * kBobGravity);
}

// m J(z) w = p̂ + b F(z), z = ẑ + b w
Point Solve(const Vector2& z_hat, const Vector2& p_hat, double b, double k, const Vector2& guess,
            long* iterations) {
  Vector2 w = guess;
  for (int i = 0; i < 50; ++i) {
    const Vector2 z = z_hat + b * w, e = Along(z[1]), t = Across(z[1]);
    const Vector2 v = w[0] * e + z[0] * w[1] * t, r = kMass * v - p_hat - b * Force(z, k);
    Matrix2 J, v_z, F_z;
    J << e, z[0] * t;
    v_z << w[1] * t, w[0] * t - z[0] * w[1] * e;
    F_z << -k * e, -k * (z[0] - kLength) * t;
    const Vector2 step = Matrix2(kMass * J + b * kMass * v_z - b * b * F_z).lu().solve(r);
    w -= step;
    ++*iterations;
    if (step.norm() < 1e-11 * (1 + w.norm())) break;
  }
  const Vector2 z = z_hat + b * w, p = kMass * (w[0] * Along(z[1]) + z[0] * w[1] * Across(z[1]));
  return {z, w, p, (p - p_hat) / b};
}

double Energy(const Point& x, double k) {
  const double stretch = x.z[0] - kLength;
  return x.p.squaredNorm() / (2 * kMass) + 0.5 * k * stretch * stretch +
         kMass * kBobGravity * x.z[0] * Along(x.z[1])[1];
}

}  // namespace

PolarRun SimulatePolarBob(double k, double amplitude, Scheme scheme, double h, int steps) {
  const double g = 1 - 1 / std::numbers::sqrt2, s = (1 - g) / g, gamma = 2 - std::numbers::sqrt2,
               onward = 1 / (gamma * (2 - gamma));
  Point x{{kLength + kMass * kBobGravity * std::cos(amplitude) / k, amplitude},
          Vector2::Zero(),
          Vector2::Zero(),
          {}};
  x.rate = Force(x.z, k);
  Point before = x;
  PolarRun run;
  const double stretch = kMass * kBobGravity / k, E0 = Energy(x, k),
               lowest = 0.5 * k * stretch * stretch - kMass * kBobGravity * (kLength + stretch);
  long iterations = 0, stages = 0;
  run.positions.push_back(x.z[0] * Along(x.z[1]));
  for (int i = 0; i < steps; ++i) {
    const Point start = x;
    const auto solve = [&](const Vector2& z, const Vector2& p, double b) {
      ++stages;
      x = Solve(z, p, b, k, x.w, &iterations);
    };
    if (scheme == Scheme::kEuler) {
      solve(x.z, x.p, h);
    } else if (scheme == Scheme::kSdirk2) {
      solve(x.z, x.p, g * h);
      solve(start.z + s * (x.z - start.z), start.p + s * (x.p - start.p), g * h);
    } else if (scheme == Scheme::kTrBdf2) {
      const double b = 0.5 * gamma * h;
      solve(x.z + b * x.w, x.p + b * x.rate, b);
      solve(start.z + onward * (x.z - start.z), start.p + onward * (x.p - start.p),
            (1 - gamma) / (2 - gamma) * h);
    } else if (i == 0) {
      solve(x.z, x.p, 0.5 * h);
      solve(x.z, x.p, 0.5 * h);
    } else {
      solve(before.z + 4. / 3 * (x.z - before.z), before.p + 4. / 3 * (x.p - before.p), 2. / 3 * h);
    }
    before = start;
    run.positions.push_back(x.z[0] * Along(x.z[1]));
    run.energy_gain = std::max(run.energy_gain, (Energy(x, k) - E0) / (E0 - lowest));
  }
  run.energy_left = (Energy(x, k) - lowest) / (E0 - lowest);
  run.iterations_per_stage = static_cast<double>(iterations) / static_cast<double>(stages);
  return run;
}

}  // namespace fork1s::lab
