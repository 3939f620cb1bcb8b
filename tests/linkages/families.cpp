#include "families.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

namespace fork1s::linkages {
namespace {

Sketch Start(RandomSource& random, std::string family) {
  Sketch s;
  s.family = std::move(family);
  s.AddBody(RigidTransform(), random.Inertia());
  return s;
}

int AddBodyNear(RandomSource& random, Sketch& s, const Vector3& point) {
  const RigidTransform X(random.Pose(1).rotation(), point + random.InBox(0.1));
  return s.AddBody(X, random.Inertia());
}

/// Adds a pair between two bodies at a point.
using MakePair = std::function<void(Sketch&, int a, int b, const Vector3& point)>;
using DrawPoint = std::function<Vector3()>;

// A chain of `links` bodies from body a at `from` to body b at `to`. Pins keep a distance of 0.3.
void AddChain(RandomSource& random, Sketch& s, int a, const Vector3& from, int b, const Vector3& to,
              int links, const DrawPoint& draw, const MakePair& make) {
  int before = a;
  Vector3 at = from;
  for (int i = 0; i < links; ++i) {
    const int link = AddBodyNear(random, s, at);
    make(s, before, link, at);
    before = link;
    for (int attempt = 0;; ++attempt) {
      const Vector3 next = i + 1 == links ? to : draw();
      const bool apart = (next - at).norm() > 0.3 && (i + 2 < links || (next - to).norm() > 0.3);
      if (i + 1 == links || apart || attempt > 50) {
        at = next;
        break;
      }
    }
  }
  make(s, before, b, to);
}

// Loops that each ask for three equations (a plane's or a sphere's).
void AddLoops(RandomSource& random, Sketch& s, int loops, const DrawPoint& draw, const MakePair& make) {
  int freedoms = 0;
  for (int loop = 0; loop < loops; ++loop) {
    const int bodies = static_cast<int>(s.X.size());
    int a = 0, b = 0;
    if (loop > 0) {
      switch (random.Below(3)) {
        case 0:
          b = 1 + random.Below(bodies - 1);
          break;  // beside the loops that are there
        case 1:
          a = b = 1 + random.Below(bodies - 1);
          break;  // carried by one of their bodies
        default:
          a = random.Below(bodies), b = random.Below(bodies);  // between two of them
      }
    }
    int links = 1 + random.Below(4);
    if (a == b) links = std::max(links, random.Chance(0.06) ? 2 : 3);
    // A loop may take the last freedom, but seldom.
    if (freedoms + links - 2 < 1 && !random.Chance(0.08)) links = 3;
    freedoms = std::max(0, freedoms + links - 2);
    Vector3 from = draw(), to = draw();
    for (int i = 0; i < 50 && (from - to).norm() < 0.4; ++i) to = draw();
    AddChain(random, s, a, from, b, to, links, draw, make);
  }
}

PairKind Loosened(RandomSource& random, double balls) {
  return random.Chance(balls) ? PairKind::kBall : PairKind::kHinge;
}

}  // namespace

Sketch PlanarLinkage(RandomSource& random, int loops) {
  Sketch s = Start(random, "planar");
  const double slides = random.Chance(0.5) ? 0 : 0.2, balls = random.Chance(0.5) ? 0 : 0.3,
               cylinders = random.Chance(0.7) ? 0 : 0.3;
  AddLoops(
      random, s, loops, [&] { return Vector3(random.Uniform(-1, 1), random.Uniform(-1, 1), 0); },
      [&](Sketch& sketch, int a, int b, const Vector3& point) {
        if (random.Chance(slides)) {
          const double angle = random.Uniform(-3, 3);
          sketch.AddPair(a, b, PairKind::kSlide, point,
                         FrameAlong(Vector3(std::cos(angle), std::sin(angle), 0)));
        } else if (random.Chance(cylinders)) {
          sketch.AddPair(a, b, PairKind::kCylindrical, point, FrameAlong(Vector3::UnitZ()));
        } else {
          sketch.AddPair(a, b, Loosened(random, balls), point, FrameAlong(Vector3::UnitZ()));
        }
      });
  return s;
}

Sketch SphericalLinkage(RandomSource& random, int loops) {
  Sketch s = Start(random, "spherical");
  const double balls = random.Chance(0.7) ? 0 : 0.2;
  AddLoops(
      random, s, loops,
      [&] {
        Vector3 d = random.Direction();
        return Vector3(d.x(), d.y(), std::abs(d.z()));
      },
      [&](Sketch& sketch, int a, int b, const Vector3& point) {
        sketch.AddPair(a, b, Loosened(random, balls), point, FrameAlong(point));
      });
  return s;
}

Sketch ParallelogramLinkage(RandomSource& random, int stages) {
  Sketch s = Start(random, "parallelogram");
  int below = 0;
  Vector3 origin = Vector3::Zero();
  for (int stage = 0; stage < stages; ++stage) {
    const Vector3 axis = random.Direction(), crank = random.Direction();
    const int platform = AddBodyNear(random, s, origin + crank);
    const int cranks = 2 + random.Below(3);
    const double balls = random.Chance(0.7) ? 0 : 0.3;
    for (int i = 0; i < cranks; ++i) {
      const Vector3 foot = origin + random.InBox(1);
      const int body = AddBodyNear(random, s, foot);
      s.AddPair(below, body, Loosened(random, balls), foot, FrameAlong(axis));
      s.AddPair(body, platform, Loosened(random, balls), foot + crank, FrameAlong(axis));
    }
    below = platform;
    origin += crank;
  }
  return s;
}

Sketch BennettLinkage(RandomSource& random) {
  Sketch s = Start(random, "bennett");
  // sin α / a = sin β / b;  tan(θ₁/2) tan(θ₂/2) = sin((α+β)/2) / sin((β-α)/2) (Denavit and Hartenberg's
  // signs).
  const double alpha = random.Uniform(0.5, 1.0), beta = random.Uniform(1.2, 1.5), a = random.Uniform(0.5, 1);
  const double b = a * std::sin(beta) / std::sin(alpha);
  const double theta1 = random.Uniform(0.6, 2.4);
  const double ratio = std::sin((alpha + beta) / 2) / std::sin((beta - alpha) / 2);
  const double theta2 = 2 * std::atan(ratio / std::tan(theta1 / 2));
  const std::array<double, 4> theta = {theta1, theta2, -theta1, -theta2}, twist = {alpha, beta, alpha, beta},
                              side = {a, b, a, b};
  RigidTransform X;
  std::array<RigidTransform, 4> hinge;
  for (std::size_t i = 0; i < 4; ++i) {
    hinge[i] = X;
    X = X * RigidTransform(ExpRotation(Vector3(0, 0, theta[i])), Vector3::Zero()) *
        RigidTransform(ExpRotation(Vector3(twist[i], 0, 0)), Vector3(side[i], 0, 0));
  }
  if ((X.translation()).norm() + (X.rotation() - Matrix3::Identity()).norm() > 1e-12)
    throw std::logic_error("Bennett's loop stands open");
  int before = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const int next = i == 3 ? 0 : AddBodyNear(random, s, hinge[i].translation());
    s.AddPair(before, next, PairKind::kHinge, hinge[i].translation(), hinge[i].rotation());
    before = next;
  }
  return s;
}

Sketch SarrusLinkage(RandomSource& random) {
  Sketch s = Start(random, "sarrus");
  const int platform = AddBodyNear(random, s, Vector3(0, 0, 0.8));
  const int legs = 2 + random.Below(2);
  double turn = random.Uniform(-3, 3);
  for (int i = 0; i < legs; ++i) {
    turn += random.Uniform(0.8, 1.8);
    const Vector3 out(std::cos(turn), std::sin(turn), 0), axis = Vector3::UnitZ().cross(out);
    const Vector3 foot = 0.5 * out,
                  knee = random.Uniform(0.7, 1.2) * out + Vector3(0, 0, random.Uniform(0.2, 0.6)),
                  top = random.Uniform(0.2, 0.5) * out + Vector3(0, 0, 0.8);
    const int lower = AddBodyNear(random, s, foot), upper = AddBodyNear(random, s, knee);
    s.AddPair(0, lower, PairKind::kHinge, foot, FrameAlong(axis));
    s.AddPair(lower, upper, PairKind::kHinge, knee, FrameAlong(axis));
    s.AddPair(upper, platform, PairKind::kHinge, top, FrameAlong(axis));
  }
  return s;
}

namespace {

constexpr std::array<PairKind, 6> kPairs = {PairKind::kHinge,       PairKind::kBall,  PairKind::kUniversal,
                                            PairKind::kCylindrical, PairKind::kSlide, PairKind::kPlanar};

int Count(PairKind kind) { return FreedomsOf(kind).turns + FreedomsOf(kind).slides; }

}  // namespace

Sketch SpatialLinkage(RandomSource& random, int loops) {
  Sketch s = Start(random, "spatial");
  int freedoms = 0;
  for (int loop = 0; loop < loops; ++loop) {
    const int bodies = static_cast<int>(s.X.size());
    const int a = loop == 0 ? 0 : random.Below(bodies), b = loop == 0 ? 0 : random.Below(bodies);
    const int links = (a == b ? 2 : 1) + random.Below(3);
    // Six equations a loop: the chain keeps one to three, or takes some of what other loops have left.
    const int least = freedoms > 1 && a != b ? 5 : 7;
    const int wanted = least + random.Below(3);
    std::vector<PairKind> kinds(static_cast<std::size_t>(links) + 1, PairKind::kHinge);
    int sum = links + 1;
    for (int i = 0; i < 100 && sum != wanted; ++i) {
      PairKind& kind = kinds[static_cast<std::size_t>(random.Below(links + 1))];
      const PairKind other = kPairs[static_cast<std::size_t>(random.Below(6))];
      const int change = Count(other) - Count(kind);
      if ((wanted - sum) * change <= 0 || std::abs(change) > std::abs(wanted - sum)) continue;
      sum += change;
      kind = other;
    }
    freedoms += sum - 6;
    std::size_t next = 0;
    AddChain(
        random, s, a, random.InBox(1), b, random.InBox(1), links, [&] { return random.InBox(1); },
        [&](Sketch& sketch, int first, int second, const Vector3& point) {
          sketch.AddPair(first, second, kinds[next++], point, random.Pose(1).rotation());
        });
  }
  return s;
}

Sketch PlatformLinkage(RandomSource& random, int legs) {
  constexpr std::array<std::array<PairKind, 3>, 5> kLegs = {{
      {PairKind::kUniversal, PairKind::kSlide, PairKind::kBall},
      {PairKind::kHinge, PairKind::kSlide, PairKind::kBall},
      {PairKind::kHinge, PairKind::kHinge, PairKind::kBall},
      {PairKind::kUniversal, PairKind::kHinge, PairKind::kUniversal},
      {PairKind::kBall, PairKind::kSlide, PairKind::kBall},  // turns about itself, unseen
  }};
  Sketch s = Start(random, "platform");
  const int platform = AddBodyNear(random, s, Vector3(0, 0, 1));
  for (int leg = 0; leg < legs; ++leg) {
    const auto& kinds = kLegs[static_cast<std::size_t>(random.Chance(0.06) ? 4 : random.Below(4))];
    const double turn = 2 * M_PI * leg / legs + random.Uniform(-0.3, 0.3);
    const Vector3 foot(std::cos(turn), std::sin(turn), 0),
        top = 0.5 * Vector3(std::cos(turn), std::sin(turn), 2) + random.InBox(0.1);
    const Vector3 knee = 0.5 * (foot + top) + random.InBox(0.2);
    const int lower = AddBodyNear(random, s, foot), upper = AddBodyNear(random, s, knee);
    s.AddPair(0, lower, kinds[0], foot, random.Pose(1).rotation());
    s.AddPair(lower, upper, kinds[1], knee,
              kinds[1] == PairKind::kSlide ? FrameAlong(top - foot) : random.Pose(1).rotation());
    s.AddPair(upper, platform, kinds[2], top, random.Pose(1).rotation());
  }
  return s;
}

void HangBody(RandomSource& random, Sketch& s) {
  const int on = random.Below(static_cast<int>(s.X.size()));
  const Vector3 point = s.X[static_cast<std::size_t>(on)].translation() + random.InBox(0.5);
  const int body = AddBodyNear(random, s, point);
  s.AddPair(on, body, kPairs[static_cast<std::size_t>(random.Below(6))], point, random.Pose(1).rotation());
}

}  // namespace fork1s::linkages
