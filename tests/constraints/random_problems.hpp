// Families of contact problems drawn at random: what touches where follows from places of bodies, so that
// redundant points, wedges and grasps come as they do in scenes.
#pragma once

#include <array>
#include <string>

#include "problems.hpp"

namespace fork1s::testing {

enum class Family { kJam, kHeap, kStack, kWedge, kGrasp };
constexpr std::array<Family, 5> kFamilies = {Family::kJam, Family::kHeap, Family::kStack, Family::kWedge,
                                             Family::kGrasp};

inline const char* NameOf(Family family) {
  switch (family) {
    case Family::kJam:
      return "jam";
    case Family::kHeap:
      return "heap";
    case Family::kStack:
      return "stack";
    case Family::kWedge:
      return "wedge";
    case Family::kGrasp:
      return "grasp";
  }
  return "";
}

struct DrawnBody {
  Vector3 at = Vector3::Zero();
  int port = -1;
};

/// A point of two bodies at `at`, normal from a to b.
inline void AddPoint(Problem& p, const DrawnBody& a, const DrawnBody& b, const Vector3& at,
                     const Vector3& normal, double friction) {
  p.contacts.push_back(TouchAt(a.port, at - a.at, b.port, at - b.at, normal, friction));
}

/// Points of a flat patch: a grid of side x side on a square of half size `half` about `at`.
inline void AddPatch(Problem& p, const DrawnBody& a, const DrawnBody& b, const Vector3& at,
                     const Vector3& normal, double half, int side, double friction) {
  const Matrix3 frame = FrameOf(normal);
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      const double x = side == 1 ? 0 : half * (2.0 * i / (side - 1) - 1),
                   y = side == 1 ? 0 : half * (2.0 * j / (side - 1) - 1);
      AddPoint(p, a, b, at + frame.transpose() * Vector3(0, x, y), normal, friction);
    }
}

/// Mass within 10^±decades of `typical`, of a body of the given radius.
inline MatrixX DrawnW(std::mt19937& random, double typical, double radius, double decades) {
  const double mass = typical * std::pow(10, Uniform(random, -decades, decades));
  return RigidBodyW(mass, 0.4 * mass * radius * radius);
}

/// Everything that is free falls for a step, and was falling before.
inline void Fall(Problem& p, double speed) {
  for (const VelocityBlock& block : p.blocks)
    if (block.size == 6) p.velocity[block.offset + 5] -= kGravity * kStep + speed;
}

inline Problem DrawHeap(std::mt19937& random, int balls, double friction, double decades) {
  Problem p;
  std::vector<DrawnBody> bodies;
  const double radius = 0.05;
  const double room = radius * std::cbrt(static_cast<double>(balls)) * 1.1;
  for (int i = 0; i < balls; ++i) {
    p.W.push_back(DrawnW(random, 0.3, radius, decades));
    bodies.push_back({Vector3(Uniform(random, -room, room), Uniform(random, -room, room),
                              Uniform(random, radius, 2 * room)),
                      6 * i});
  }
  p.Finish();
  // Touching where centres are nearer than 2.3 radii: a packing as crowded as a heap.
  for (int i = 0; i < balls; ++i) {
    if (bodies[static_cast<std::size_t>(i)].at.z() < 1.2 * radius) {
      const Vector3 foot = bodies[static_cast<std::size_t>(i)].at - radius * Vector3::UnitZ();
      AddPoint(p, DrawnBody{}, bodies[static_cast<std::size_t>(i)], foot, Vector3::UnitZ(), friction);
    }
    for (int j = 0; j < i && p.contacts.size() < 200; ++j) {
      const DrawnBody &a = bodies[static_cast<std::size_t>(j)], &b = bodies[static_cast<std::size_t>(i)];
      const Vector3 way = b.at - a.at;
      if (way.norm() > 2.3 * radius || way.norm() < radius) continue;
      AddPoint(p, a, b, 0.5 * (a.at + b.at), way, friction);
    }
  }
  Fall(p, Uniform(random, 0, 0.5));
  for (double& v : p.velocity) v += 0.1 * Uniform(random, -1, 1);
  return p;
}

inline Problem DrawStack(std::mt19937& random, int boxes, int side, double friction, double decades) {
  Problem p;
  std::vector<DrawnBody> bodies{DrawnBody{}};
  const double half = 0.1;
  for (int i = 0; i < boxes; ++i) {
    p.W.push_back(DrawnW(random, 1, half, decades));
    bodies.push_back(
        {Vector3(Uniform(random, -0.4, 0.4) * half, Uniform(random, -0.4, 0.4) * half, half * (2 * i + 1)),
         6 * i});
  }
  p.Finish();
  for (int i = 0; i < boxes; ++i) {
    const DrawnBody &below = bodies[static_cast<std::size_t>(i)],
                    &above = bodies[static_cast<std::size_t>(i) + 1];
    Vector3 at = i == 0 ? above.at : Vector3(0.5 * (below.at + above.at));
    at.z() = 2 * half * i;
    AddPatch(p, below, above, at, Vector3::UnitZ(), 0.8 * half, side, friction);
  }
  Fall(p, 0);
  // Somebody pushes one of them.
  const int pushed = std::uniform_int_distribution<int>(0, boxes - 1)(random);
  p.velocity.segment<3>(6 * pushed + 3) += Uniform(random, 0, 1) * RandomUnit(random);
  return p;
}

/// A body pressed between two to four faces with patches.
inline Problem DrawWedge(std::mt19937& random, int side, double friction) {
  Problem p;
  p.W.push_back(DrawnW(random, 1, 0.05, 1));
  p.Finish();
  const DrawnBody body{Vector3::Zero(), 0};
  const int faces = std::uniform_int_distribution<int>(2, 4)(random);
  for (int f = 0; f < faces; ++f) {
    const Vector3 normal = (RandomUnit(random) + Vector3(0, 0, 0.3)).normalized();
    AddPatch(p, DrawnBody{}, body, -0.05 * normal, normal, 0.02, side, friction);
  }
  p.velocity.tail<3>() = Uniform(random, 0.1, 3) * RandomUnit(random);
  p.velocity.head<3>() = Uniform(random, 0, 10) * RandomUnit(random);
  p.velocity[5] -= 1;
  return p;
}

/// An object between the tips of coupled fingers: their block is stiff (springs of a palm), pads of points.
inline Problem DrawGrasp(std::mt19937& random, int fingers, int side, double friction) {
  Problem p;
  const int n = 6 * fingers;
  std::normal_distribution<double> normal;
  const MatrixX b = MatrixX::NullaryExpr(n, n, [&] { return normal(random); });
  VectorX sizes(n);
  for (int i = 0; i < n; ++i) sizes[i] = (i % 6 < 3 ? 30 : 1) * std::pow(10, Uniform(random, -1, 1));
  p.W.push_back(sizes.asDiagonal() * (b * b.transpose() / n + 0.05 * MatrixX::Identity(n, n)) *
                sizes.asDiagonal());
  p.W.push_back(DrawnW(random, 0.3, 0.04, 1.5));
  p.Finish();
  const DrawnBody object{Vector3::Zero(), n};
  for (int f = 0; f < fingers; ++f) {
    Vector3 out = RandomUnit(random);
    if (f == 1) out = -Matrix3(FrameOf(Vector3::UnitX())).row(0).transpose() + 0.3 * RandomUnit(random);
    if (f == 0) out = Vector3::UnitX();
    out.normalize();
    const DrawnBody tip{0.05 * out, 6 * f};
    AddPatch(p, tip, object, 0.04 * out, -out, 0.008, side, friction);
    p.velocity.segment<3>(6 * f + 3) = -Uniform(random, 0.05, 1) * out + 0.1 * RandomUnit(random);
  }
  p.velocity[n + 5] -= kGravity * kStep;
  return p;
}

/// The material that scenes have unless told otherwise: 1 MN/m, 10 µm at most, at 1/60 s.
inline void GiveDefaultMaterial(Problem& p) {
  for (ContactConstraint& c : p.contacts) {
    c.compliance_normal = 1 / (kStep * 5 * kStep * 1e6);
    c.compliance_tangent = 1 / (kStep * kStep * 1e6);
    c.hardening_speed = 1e-5 / (5 * kStep);
  }
}

inline Problem DrawFamily(std::mt19937& random, Family family) {
  const auto whole = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  const double friction = whole(0, 9) == 0 ? 0 : Uniform(random, 0.05, 1.2);
  switch (family) {
    case Family::kJam:
      return RandomProblem(random, whole(0, 5), whole(1, 8), whole(1, 60), friction);
    case Family::kHeap:
      return DrawHeap(random, whole(2, 20), friction, Uniform(random, 0, 3));
    case Family::kStack:
      return DrawStack(random, whole(1, 10), whole(2, 4), friction, Uniform(random, 0, 3));
    case Family::kWedge:
      return DrawWedge(random, whole(1, 6), friction);
    case Family::kGrasp:
      return DrawGrasp(random, whole(2, 5), whole(1, 6), friction);
  }
  return {};
}

}  // namespace fork1s::testing
