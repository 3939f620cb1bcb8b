// Coulomb contact of one body with a plane.
#include <fmt/format.h>
#include <cmath>

#include "cases.hpp"
#include "support.hpp"

namespace fork1s::internal {
namespace {

constexpr double kGravity = 9.81;  // m/s²
constexpr double kRadius = 0.1;    // m
constexpr double kContactStep = 1.0 / 60;
// The reduced simulator's contact solver stops at 1e-4 of a step's impulse, the full one's at 1e-8.
constexpr double kSolver = 1e-3;
const char* const kWhySolver = "the contact solver stops at 1e-4 of a step's impulse; ten times that";

struct Speeds {
  double slide = 0, turn = 0;  // m/s, rad/s
};

template <class Method>
Speeds AfterOneSecond(const Shape& shape, const SpatialInertia& inertia, double height, double slope,
                      double friction) {
  auto s = Method::Start(OnPlane(shape, inertia, height, slope, friction), kContactStep);
  Advance(s, 1);
  const Vector6 V = s.Velocity(s.FindBody("body"));
  return {V(3), V(1)};
}

// When the slip of a ball thrown at v0 ends: slip falls by 7/2 µ g t, and the first step at which less than a
// step's share is left is told by what is left before it.
template <class Method>
Speeds SlipAndSpeed(double v0, double friction, double h) {
  Scene scene = OnPlane(Sphere{kRadius}, testing::Ball(1, kRadius), kRadius, 0, friction);
  KeyframeDef key;
  key.free_bodies.push_back({scene.free_bodies[0].X_WB, Vector3::Zero(), Vector3(v0, 0, 0)});
  scene.keyframes = {key};
  auto s = Method::Start(std::move(scene), h);
  const int ball = s.FindBody("body");
  const double rate = 3.5 * friction * kGravity;
  double ends = -1;
  for (int i = 1; i <= 2 / h; ++i) {
    StepOnce(s);
    const Vector6 V = s.Velocity(ball);
    const double slip = V(3) - kRadius * V(1);
    if (ends < 0 && slip < rate * h) ends = i * h + std::max(slip, 0.0) / rate;
  }
  return {s.Velocity(ball)(3), ends};
}

}  // namespace

std::vector<KnownAnswer> Rolling(Refinement) {
  Rows rows("rolling");
  const double slope = 0.2, expected = 5.0 / 7 * kGravity * std::sin(slope);
  const SpatialInertia ball = testing::Ball(1, kRadius);
  const Speeds r = AfterOneSecond<ReducedMethod>(Sphere{kRadius}, ball, kRadius, slope, 1);
  const Speeds f = AfterOneSecond<FullMethod>(Sphere{kRadius}, ball, kRadius, slope, 1);
  const char* source = "closed form: 5/7 g sin θ for θ = 0.2 rad";
  rows.Add({"mean acceleration over 1 s", "m/s²", expected, kSolver * expected, kWhySolver, source}, r.slide,
           f.slide);
  rows.Add({"angular acceleration over 1 s", "rad/s²", expected / kRadius, kSolver * expected / kRadius,
            kWhySolver, source},
           r.turn, f.turn);
  return rows.Release();
}

std::vector<KnownAnswer> SlidingToRolling(Refinement) {
  Rows rows("sliding_to_rolling");
  const double v0 = 3, friction = 0.2, h = 1.0 / 240;
  const Speeds r = SlipAndSpeed<ReducedMethod>(v0, friction, h),
               f = SlipAndSpeed<FullMethod>(v0, friction, h);
  rows.Add({"time at which slip ends", "s", 2 * v0 / (7 * friction * kGravity), 1e-3,
            "kinks within a step of 1/240 s are found by the slip left before them",
            "closed form: 2 v₀/(7 µ g) for v₀ = 3 m/s, µ = 0.2"},
           r.turn, f.turn);
  rows.Add({"speed of rolling", "m/s", 5.0 / 7 * v0, kSolver * v0, kWhySolver, "closed form: 5/7 v₀"},
           r.slide, f.slide);
  return rows.Release();
}

std::vector<KnownAnswer> Sticking(Refinement) {
  Rows rows("sticking");
  const double friction = 0.5;
  const Vector3 half(0.1, 0.1, 0.05);
  for (const double share : {0.98, 1.02}) {
    const double slope = std::atan(share * friction);
    const Speeds r =
        AfterOneSecond<ReducedMethod>(Box{half}, testing::Brick(1, half), half.z(), slope, friction);
    const Speeds f =
        AfterOneSecond<FullMethod>(Box{half}, testing::Brick(1, half), half.z(), slope, friction);
    const double expected = share < 1 ? 0 : kGravity * (std::sin(slope) - friction * std::cos(slope));
    rows.Add({fmt::format("speed after 1 s at tan θ = {} µ", share), "m/s", expected, kSolver,
              "1e-4 of the impulse of gravity in 1 s", "Coulomb's law, µ = 0.5"},
             r.slide, f.slide);
  }
  return rows.Release();
}

}  // namespace fork1s::internal
