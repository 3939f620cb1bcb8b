// The stiff flyball governor: a spinning shaft, a slider on it, two rods with balls at their ends, and stiff
// springs with dampers between the middle of the rods and the slider.
//
// Problem A05 of the multibody benchmark of the IFToMM (Gonzalez, Dopico, Lugris, Cuadrado 2006).
#include <fmt/format.h>
#include <cmath>
#include <numbers>

#include "cases.hpp"
#include "support.hpp"

namespace fork1s::internal {
namespace {

constexpr double kStiffness = 8e5, kDamping = 4e4;  // N/m, N·s/m
constexpr double kLength = 1, kDensity = 3000;      // m, kg/m³
constexpr double kSpringLength = 0.5;               // m, unloaded and at the start
constexpr double kBallMass = 5;                     // kg
// A strut's share of mass must not show beside 14 kg, nor be nothing.
constexpr double kStrutMass = 1e-8;  // kg

/// A rod along +x with a point mass at its end.
SpatialInertia RodWithBall() {
  const double width = 0.01, rod = kDensity * kLength * width * width;
  SpatialInertia I;
  I.mass = rod + kBallMass;
  const double c = (rod * kLength / 2 + kBallMass * kLength) / I.mass;
  I.center = Vector3(c, 0, 0);
  const double across = rod * (kLength * kLength + width * width) / 12 + rod * std::pow(c - kLength / 2, 2) +
                        kBallMass * std::pow(kLength - c, 2);
  I.rotational = Vector3(rod * width * width / 6, across, across).asDiagonal();
  return I;
}

MechanismDef GovernorDefinition() {
  MechanismBuilder builder("governor");
  BodyDef shaft, slider;
  shaft.name = "shaft";
  shaft.parent = builder.base();
  shaft.X_PB = RigidTransform(Vector3(0, 0, kLength / 2));
  shaft.inertia = testing::Brick(kDensity * 1e-4 * kLength, Vector3(0.005, 0.005, kLength / 2));
  const BodyIndex shaft_index = builder.AddBody(shaft);
  builder.AddJoint(JointDef::Hinge("bearing", shaft_index, Vector3::UnitZ()));
  slider.name = "slider";
  slider.parent = shaft_index;
  slider.inertia = testing::Brick(kDensity * 1e-3, Vector3::Constant(0.05));
  const BodyIndex slider_index = builder.AddBody(slider);
  builder.AddJoint(JointDef::Slide("sleeve", slider_index, Vector3::UnitZ()));
  // Seen from above, one side is the other turned by half a turn.
  for (const int side : {1, 2}) {
    const Matrix3 outward = ExpRotation(Vector3(0, 0, side == 1 ? 0 : std::numbers::pi));
    const Matrix3 down = outward * ExpRotation(Vector3(0, std::numbers::pi / 6, 0));
    const Matrix3 up = outward * ExpRotation(Vector3(0, -std::numbers::pi / 6, 0));
    BodyDef rod, lower, upper;
    rod.name = fmt::format("rod{}", side);
    rod.parent = shaft_index;
    rod.X_PB = RigidTransform(down, outward * Vector3(0.05, 0, 0) + Vector3(0, 0, kLength / 2));
    rod.inertia = RodWithBall();
    const BodyIndex r = builder.AddBody(rod);
    builder.AddJoint(JointDef::Hinge(rod.name + "_hinge", r, Vector3::UnitY()));
    // The spring is a strut of two halves that slide on each other.
    lower.name = fmt::format("lower{}", side);
    lower.parent = slider_index;
    lower.X_PB = RigidTransform(up, outward * Vector3(0.05, 0, 0));
    lower.inertia = testing::Ball(kStrutMass, 0.01);
    upper.name = fmt::format("upper{}", side);
    upper.parent = builder.AddBody(lower);
    upper.X_PB = RigidTransform(Vector3(kSpringLength, 0, 0));
    upper.inertia = testing::Ball(kStrutMass, 0.01);
    builder.AddJoint(JointDef::Hinge(lower.name + "_hinge", upper.parent, Vector3::UnitY()));
    const BodyIndex u = builder.AddBody(upper);
    builder.AddJoint(
        JointDef::Slide(fmt::format("spring{}", side), u, Vector3::UnitX()).WithSpring(kStiffness, kDamping));
    ClosureDef joint =
        ClosureDef::Connect(fmt::format("joint{}", side), r, u, Vector3(kLength / 2, 0, 0), Vector3::Zero());
    joint.rigid(4) = false;  // the plane of rod and strut is kept by their hinges
    builder.AddClosure(joint);
  }
  builder.SetInterfaces({"slider", "rod1", "rod2"});
  return builder.definition();
}

// Height of the slider at 1, 5 and 10 s, extrapolated to h = 0.
template <class Method>
VectorX Heights(const std::vector<double>& steps, bool to_the_end) {
  std::vector<VectorX> heights;
  for (const double h : steps) {
    Scene scene = SceneOf(GovernorDefinition(), Vector3(0, 0, -9.81));
    VectorX q_dot = VectorX::Zero(8);
    q_dot(0) = 2 * std::numbers::pi;
    StartAt(scene, VectorX::Zero(8), q_dot);
    auto s = Method::Start(std::move(scene), h);
    const int slider = s.FindBody("slider");
    VectorX at = VectorX::Zero(3);
    Advance(s, 1);
    at(0) = s.Pose(slider).translation().z();
    Advance(s, 4);
    at(1) = s.Pose(slider).translation().z();
    if (to_the_end) Advance(s, 5);
    at(2) = s.Pose(slider).translation().z();
    heights.push_back(at);
  }
  return ExtrapolateToZero(std::move(heights));
}

}  // namespace

std::vector<KnownAnswer> FlyballGovernor(Refinement refinement) {
  Rows rows("flyball_governor");
  const bool fine = refinement == Refinement::kFine;
  const double first = fine ? 1.0 / 400 : 1.0 / 50;
  const std::vector<double> steps = {first, first / 2, first / 4, first / 8};
  const VectorX r = Heights<ReducedMethod>(steps, fine), f = Heights<FullMethod>(steps, fine),
                second = Heights<SecondOrderMethod>({1.0 / 50, 1.0 / 100, 1.0 / 200, 1.0 / 400}, fine);
  const double known[] = {0.501421, 0.535563, 0.619623};
  const char* times[] = {"1", "5", "10"};
  for (int i = 0; i < (fine ? 3 : 2); ++i) {
    const std::string height = fmt::format("height s of the slider at {} s", times[i]);
    rows.Add({height, "m", known[i], fine ? 3e-5 : 3e-4,
              "first order; steps of 1/400 to 1/3200 s extrapolated to zero",
              "published (benchmark A05 of the IFToMM)"},
             r(i), f(i));
    rows.Add({height + ", by steps of second order", "m", known[i], 1e-4,
              "second order; steps of 1/50 to 1/400 s extrapolated to zero",
              "published (benchmark A05 of the IFToMM)"},
             second(i), std::nullopt);
  }
  return rows.Release();
}

}  // namespace fork1s::internal
