// Gains and mass ratios at which explicit steps explode.
#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "cases.hpp"
#include "support.hpp"

namespace fork1s::internal {
namespace {

// A finger of 1e-5 kg·m² along x, hinged about y, with a ball of 5 mm at its end 0.1 m out.
// An explicit spring at h = 5 ms keeps below 9.33 N·m/rad only; this is ten thousand times that.
constexpr double kGain = 9.33e4;    // N·m/rad
constexpr double kReach = 0.1;      // m
constexpr double kBall = 0.005;     // m
constexpr double kHeight = 0.01;    // m, of the hinge over the plane
constexpr double kSetPoint = 0.06;  // rad, below the plane

Scene Finger() {
  MechanismBuilder builder("finger");
  BodyDef link;
  link.name = "link";
  link.parent = builder.base();
  link.inertia = {0.004, Vector3(0.05, 0, 0), 1e-9 * Matrix3::Identity()};  // 0.004 · 0.05² about the hinge
  GeometryDef tip;
  tip.name = "tip";
  tip.shape = Sphere{kBall};
  tip.friction = 0;
  tip.frictionless = true;
  tip.X_BG = RigidTransform(Vector3(kReach, 0, 0));
  link.geometries.push_back(tip);
  const BodyIndex b = builder.AddBody(link);
  const JointIndex j = builder.AddJoint(JointDef::Hinge("joint", b, Vector3::UnitY()).WithSpring(kGain));
  ControlDef control;
  control.name = "set point";
  control.terms.emplace_back(FreedomRef{j, 0}, 1.0);
  control.gain = kGain;
  control.is_setpoint = true;
  builder.AddControl(control);
  builder.SetInterfaces({"link"});
  builder.SetBasePose(RigidTransform(Vector3(0, 0, kHeight)));
  Scene scene = SceneOf(builder.definition(), Vector3(0, 0, -9.81));
  GeometryDef plane;
  plane.name = "plane";
  plane.shape = Plane{};
  plane.friction = 0;
  plane.frictionless = true;
  scene.world.push_back(plane);
  return scene;
}

struct Pressed {
  double angle = 0;  // rad, at rest against the plane
  double speed = 0;  // rad/s left at rest
  double away = 0;   // rad, largest distance from the way between the two set-points
};

// Pressed and let go in turn, half a second each, three times.
template <class Method>
Pressed PressAndLetGo() {
  auto s = Method::Start(Finger(), 0.005);
  const int input = s.FindControl("set point");
  Pressed out;
  for (int i = 0; i < 600; ++i) {
    const bool down = i / 100 % 2 == 0;
    VectorX u = s.controls();
    u(input) = down ? kSetPoint : 0;
    s.SetControls(u);
    StepOnce(s);
    const double q = Displacements(s)(0);
    out.away = std::max({out.away, -q, q - kSetPoint});
    if (down && i % 100 == 99) {
      out.angle = q;
      out.speed = std::max(out.speed, std::abs(s.Velocity(s.FindBody("link"))(1)));
    }
  }
  return out;
}

// A chain of four links of a gramme; the last one weighs a tonne.
Scene HeavyChain() {
  MechanismBuilder builder("chain");
  BodyIndex parent = builder.base();
  for (int i = 0; i < 4; ++i) {
    BodyDef link;
    link.name = fmt::format("link{}", i + 1);
    link.parent = parent;
    if (i > 0) link.X_PB = RigidTransform(Vector3(0.1, 0, 0));
    link.inertia = testing::Rod(i < 3 ? 1e-3 : 1e3, 0.1);
    parent = builder.AddBody(link);
    builder.AddJoint(
        JointDef::Hinge(fmt::format("joint{}", i + 1), parent, Vector3::UnitZ()).WithSpring(100, 1));
  }
  builder.SetInterfaces({"link4"});
  return SceneOf(builder.definition(), Vector3(0, -9.81, 0));
}

// A kilogramme on a milligramme, both bricks.
Scene HeavyStack() {
  const Vector3 half(0.1, 0.1, 0.05);
  Scene scene = OnPlane(Box{half}, testing::Brick(1e-6, half), half.z(), 0, 0.8);
  FreeBodyDef heavy = scene.free_bodies[0];
  heavy.name = "heavy";
  heavy.inertia = testing::Brick(1, half);
  heavy.X_WB.translation().z() = 3 * half.z();
  scene.free_bodies.push_back(heavy);
  return scene;
}

template <class Method>
double EnergyGained(double h) {
  auto s = Method::Start(HeavyChain(), h);
  double before = s.Energy(), gained = 0;
  for (int i = 0; i < 30 / h; ++i) {
    StepOnce(s);
    gained = std::max(gained, s.Energy() - before);
    before = s.Energy();
  }
  return gained;
}

template <class Method>
double StackMoved() {
  auto s = Method::Start(HeavyStack(), 0.1);
  const int heavy = s.FindBody("heavy");
  const Vector3 start = s.Pose(heavy).translation();
  double moved = 0;
  for (int i = 0; i < 300; ++i) {
    s.Step();
    moved = std::max(moved, (s.Pose(heavy).translation() - start).norm());
  }
  return moved;
}

}  // namespace

std::vector<KnownAnswer> GainInContact(Refinement) {
  Rows rows("gain_in_contact");
  const Pressed r = PressAndLetGo<ReducedMethod>(), f = PressAndLetGo<FullMethod>();
  rows.Add({"angle at which the finger rests on the plane", "rad", std::asin((kHeight - kBall) / kReach),
            2e-4, "the contact gives 10 µm at 0.1 m, twice",
            "closed form: asin of height over reach, at 1e4 times an explicit spring's largest gain"},
           r.angle, f.angle);
  rows.Add({"angular speed left while it is pressed", "rad/s", 0, 1e-3,
            "what it is pressed in too far comes back at less than 0.1 mm a second", "it rests"},
           r.speed, f.speed);
  rows.Add({"farthest beyond the way between the set-points", "rad", 0, 1e-3,
            "gravity bends the spring by 2e-8 rad", "an unstable step leaves it at once"},
           r.away, f.away);
  return rows.Release();
}

std::vector<KnownAnswer> MassRatio(Refinement) {
  Rows rows("mass_ratio");
  const char* why = "of the 4 kJ that are exchanged";
  const char* source = "energy never grows by itself";
  // Not by the full method: at 0.1 s the weight swings by more than a radian in a step, and its Newton
  // iteration on the poses of all bodies does not find such a step. At 0.05 s it does.
  rows.Add({"largest energy gained in a step by a chain 1 g : 1000 kg at h = 0.1 s, 30 s", "J", 0, 1e-3, why,
            source},
           EnergyGained<ReducedMethod>(0.1), std::nullopt);
  rows.Add({"the same at h = 0.05 s", "J", 0, 1e-3, why, source}, EnergyGained<ReducedMethod>(0.05),
           EnergyGained<FullMethod>(0.05));
  rows.Add({"farthest move of 1 kg on 1 mg at h = 0.1 s, 30 s", "m", 0, 1e-4,
            "two contacts that give 10 µm each, more while the load comes on", "it rests"},
           StackMoved<ReducedMethod>(), StackMoved<FullMethod>());
  return rows.Release();
}

}  // namespace fork1s::internal
