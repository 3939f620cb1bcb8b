// Small contact problems with known answers, built on rigid bodies whose velocity is [ω; v] at their centre.
#pragma once

#include <fork1s/constraints/contact_solver.hpp>
#include <fork1s/spatial/rigid_transform.hpp>
#include <random>
#include <vector>

#include "linalg/spectrum.hpp"

namespace fork1s::testing {

struct Problem {
  std::vector<MatrixX> W;  // one a block
  std::vector<MatrixX> Y;  // W = Yᵀ Y
  std::vector<VelocityBlock> blocks;
  std::vector<ContactConstraint> contacts;
  std::vector<LimitConstraint> limits;
  VectorX velocity;

  /// Call after all blocks are in `W`.
  void Finish() {
    int offset = 0;
    blocks.clear();
    Y.clear();
    for (const MatrixX& w : W) {
      const SymmetricSpectrum spectrum = SpectrumOf(w);
      Y.push_back(spectrum.values.cwiseMax(0).cwiseSqrt().asDiagonal() * spectrum.vectors.transpose());
    }
    for (const MatrixX& y : Y) {
      const int size = static_cast<int>(y.cols());
      blocks.push_back({offset, size, y.data(), size, size});
      offset += size;
    }
    velocity = VectorX::Zero(offset);
  }
  MatrixX FullW() const {
    MatrixX full = MatrixX::Zero(velocity.size(), velocity.size());
    for (std::size_t b = 0; b < W.size(); ++b) {
      full.block(blocks[b].offset, blocks[b].offset, W[b].rows(), W[b].cols()) = W[b];
    }
    return full;
  }
  MatrixX RowsOf(const ContactConstraint& c) const {
    MatrixX J = MatrixX::Zero(3, velocity.size());
    if (c.port_a >= 0) J.middleCols<6>(c.port_a) += c.J_a;
    if (c.port_b >= 0) J.middleCols<6>(c.port_b) += c.J_b;
    return J;
  }
};

inline MatrixX RigidBodyW(double mass, double inertia) {
  MatrixX w = MatrixX::Zero(6, 6);
  w.diagonal() << Vector3::Constant(1 / inertia), Vector3::Constant(1 / mass);
  return w;
}

inline Matrix3 FrameOf(const Vector3& normal) {
  const Vector3 n = normal.normalized();
  const Vector3 t = (std::abs(n.x()) < 0.7 ? Vector3::UnitX() : Vector3::UnitY()).cross(n).normalized();
  Matrix3 frame;
  frame.row(0) = n;
  frame.row(1) = t;
  frame.row(2) = n.cross(t);
  return frame;
}

/// Contact velocity = frame · (v + ω x arm) on port b minus the same on port a; normal from a to b.
inline ContactConstraint TouchAt(int port_a, const Vector3& arm_a, int port_b, const Vector3& arm_b,
                                 const Vector3& normal, double friction) {
  ContactConstraint c;
  const Matrix3 frame = FrameOf(normal);
  c.port_a = port_a;
  c.port_b = port_b;
  if (port_a >= 0) c.J_a << frame * Skew(arm_a), -frame;
  if (port_b >= 0) c.J_b << -frame * Skew(arm_b), frame;
  c.friction = friction;
  return c;
}

constexpr double kStep = 1.0 / 60, kGravity = 9.81;

/// The compliance of the problem, not reduced for the sake of impacts.
inline ContactSolverOptions AsGiven() {
  ContactSolverOptions options;
  options.max_relative_regularization = 1;
  return options;
}

/// A box of half sizes (a, a, b) on the plane z = 0, with the velocity that gravity gives it in one step.
inline Problem BoxOnPlane(double mass, double friction, double a = 0.1, double b = 0.1) {
  Problem p;
  MatrixX w = MatrixX::Zero(6, 6);
  const double ixx = mass / 3 * (a * a + b * b), izz = mass / 3 * 2 * a * a;
  w.diagonal() << 1 / ixx, 1 / ixx, 1 / izz, 1 / mass, 1 / mass, 1 / mass;
  p.W.push_back(w);
  p.Finish();
  for (double x : {-a, a}) {
    for (double y : {-a, a}) {
      p.contacts.push_back(TouchAt(-1, Vector3::Zero(), 0, Vector3(x, y, -b), Vector3::UnitZ(), friction));
    }
  }
  p.velocity[5] = -kGravity * kStep;
  return p;
}

inline double Uniform(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}
inline Vector3 RandomUnit(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return Vector3(normal(random), normal(random), normal(random)).normalized();
}

/// One coupled block of `ports` six-vectors (positive definite) and `free` rigid bodies, touching at random.
inline Problem RandomProblem(std::mt19937& random, int ports, int free, int contacts, double friction) {
  Problem p;
  std::normal_distribution<double> normal;
  if (ports > 0) {
    const MatrixX b = MatrixX::NullaryExpr(6 * ports, 6 * ports, [&] { return normal(random); });
    p.W.push_back(b * b.transpose() / (6 * ports) + 0.1 * MatrixX::Identity(6 * ports, 6 * ports));
  }
  for (int i = 0; i < free; ++i) {
    const double mass = std::pow(10, Uniform(random, -1.5, 0.5));
    p.W.push_back(RigidBodyW(mass, 0.1 * mass));
  }
  p.Finish();
  const int bodies = ports + free;
  std::uniform_int_distribution<int> pick(-1, bodies - 1);
  for (int i = 0; i < contacts; ++i) {
    int a = pick(random), b = pick(random);
    while (b == a || (a < 0 && b < 0)) b = pick(random);
    p.contacts.push_back(TouchAt(a < 0 ? -1 : 6 * a, 0.3 * RandomUnit(random), b < 0 ? -1 : 6 * b,
                                 0.3 * RandomUnit(random), RandomUnit(random), friction));
  }
  for (double& v : p.velocity) v = normal(random);
  return p;
}

/// Largest violation of Coulomb's law, recomputed from the definition: velocity errors and impulse errors
/// (turned into velocities by the contact's own inverse mass), relative to the largest contact velocity.
inline double LawViolation(const Problem& p, const VectorX& v_start, const VectorX& v_end) {
  double worst = 0, speed = 1e-12;
  VectorX impulse_response = v_end - v_start;
  const MatrixX W = p.FullW();
  for (const ContactConstraint& c : p.contacts) {
    const MatrixX J = p.RowsOf(c);
    VectorX push = VectorX::Zero(v_end.size());
    if (c.port_a >= 0) push.segment<6>(c.port_a) += c.ImpulseOn(c.J_a);
    if (c.port_b >= 0) push.segment<6>(c.port_b) += c.ImpulseOn(c.J_b);
    impulse_response -= W * push;
    const double D = (J * W * J.transpose()).trace() / 3;
    Vector3 u = J * v_end + c.bias;  // beside what the material gives
    u[0] += c.compliance_normal * c.impulse[0];
    u.tail<2>() += c.compliance_tangent * (c.impulse - c.previous_impulse).tail<2>();
    speed = std::max({speed, (J * v_start + c.bias).norm(), D * c.impulse.norm()});
    const double n = c.impulse[0], t = c.impulse.tail<2>().norm(), ut = u.tail<2>().norm();
    worst = std::max({worst, -D * n, -u[0], std::min(D * n, std::abs(u[0]))});
    worst = std::max(worst, D * (t - c.friction * n));
    // Where it slides friction is full and opposite.
    worst = std::max(worst, std::min(ut, D * (c.friction * n - t)));
    if (ut > 0 && c.friction > 0) {
      worst =
          std::max(worst, std::min(ut, D * (c.impulse.tail<2>() + c.friction * n * u.tail<2>() / ut).norm()));
    }
  }
  for (const LimitConstraint& l : p.limits) {
    impulse_response -= W.col(l.row) * (l.sign * l.impulse);
    const double D = W(l.row, l.row),
                 u = l.sign * v_end[l.row] + l.bias + l.compliance * (l.impulse - l.previous_impulse);
    speed = std::max({speed, std::abs(l.sign * v_start[l.row] + l.bias), D * std::abs(l.impulse)});
    // Between its bounds it lets nothing by; what goes forth it gives least against, and what goes back all it has.
    worst = std::max({worst, D * (l.lower - l.impulse), D * (l.impulse - l.upper),
                      std::min(D * (l.impulse - l.lower), u), std::min(D * (l.upper - l.impulse), -u)});
  }
  worst = std::max(worst, impulse_response.cwiseAbs().maxCoeff());
  return worst / speed;
}

}  // namespace fork1s::testing
