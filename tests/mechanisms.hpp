// Mechanisms with known answers, built by hand.
#pragma once

#include <cmath>
#include <fork1s/mechanism/builder.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::testing {

inline std::shared_ptr<const Mechanism> Share(const MechanismDef& definition) {
  auto built = BuildMechanism(definition);
  if (!built) throw std::runtime_error(built.error().Text());
  return std::make_shared<const Mechanism>(std::move(*built));
}

/// Thin rod of given mass and length along +x from the origin of its frame.
inline SpatialInertia Rod(double mass, double length) {
  SpatialInertia I;
  I.mass = mass;
  I.center = Vector3(length / 2, 0, 0);
  const double i = mass * length * length / 12;
  // A hundredth about its own axis, so that it may turn in space.
  I.rotational = Vector3(0.01 * i, i, i).asDiagonal();
  return I;
}

inline SpatialInertia Ball(double mass, double radius) {
  SpatialInertia I;
  I.mass = mass;
  I.rotational = 0.4 * mass * radius * radius * Matrix3::Identity();
  return I;
}

inline SpatialInertia Brick(double mass, const Vector3& half) {
  SpatialInertia I;
  I.mass = mass;
  const Vector3 s = half.cwiseAbs2() * (mass / 3);
  I.rotational = Vector3(s.y() + s.z(), s.x() + s.z(), s.x() + s.y()).asDiagonal();
  return I;
}

/// Rods of 0.3 and 0.25 m, 0.5 and 0.1 kg, along x, hinged about y; the second one is the interface.
struct HingeSpring {
  double stiffness, damping;  // N·m/rad, N·m·s/rad
};
inline MechanismDef TwoLinkArm(BaseKind base, HingeSpring shoulder, HingeSpring elbow) {
  MechanismBuilder builder("arm", base);
  const auto add = [&](const char* name, BodyIndex parent, double at, double mass, double length,
                       HingeSpring spring) {
    BodyDef link;
    link.name = name;
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(at, 0, 0));
    link.inertia = Rod(mass, length);
    const BodyIndex body = builder.AddBody(link);
    builder.AddJoint(
        JointDef::Hinge(name, body, Vector3::UnitY()).WithSpring(spring.stiffness, spring.damping));
    return body;
  };
  add("lower", add("upper", builder.base(), 0, 0.5, 0.3, shoulder), 0.3, 0.1, 0.25, elbow);
  builder.SetInterfaces({"lower"});
  return builder.definition();
}

/// Rods along x, hinged about z (every third about y if `spatial`), and a massless tip body as the interface.
inline MechanismDef Chain(int links, double length, double mass, double stiffness, double damping = 0,
                          bool spatial = false) {
  MechanismBuilder builder("chain");
  BodyIndex parent = builder.base();
  for (int i = 0; i < links; ++i) {
    BodyDef link;
    link.name = "link" + std::to_string(i + 1);
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(i == 0 ? 0 : length, 0, 0));
    link.inertia = Rod(mass, length);
    parent = builder.AddBody(link);
    builder.AddJoint(JointDef::Hinge("joint" + std::to_string(i + 1), parent,
                                     spatial && i % 3 == 2 ? Vector3::UnitY() : Vector3::UnitZ())
                         .WithSpring(stiffness, damping));
  }
  BodyDef tip;
  tip.name = "tip";
  tip.parent = parent;
  tip.X_PB = RigidTransform(Vector3(length, 0, 0));
  builder.AddBody(tip);
  builder.SetInterfaces({"tip"});
  return builder.definition();
}

/// Planar four-bar A(0,0) B(0,0.1) C(0.15,0.15) D(0.2,0), hinges about z, crank AB and rocker DC sprung.
struct FourBar {
  Vector2 A{0, 0}, B{0, 0.1}, C{0.15, 0.15}, D{0.2, 0};
  double k_A = 2, k_D = 0.5;

  MechanismDef Definition() const {
    auto bar = [](const std::string& name, BodyIndex parent, const Vector2& from, const Vector2& to,
                  const Vector2& parent_origin) {
      BodyDef body;
      body.name = name;
      body.parent = parent;
      body.X_PB = RigidTransform(Vector3((from - parent_origin).x(), (from - parent_origin).y(), 0));
      const Vector2 along = to - from;
      const Matrix3 R = Eigen::AngleAxisd(std::atan2(along.y(), along.x()), Vector3::UnitZ()).matrix();
      body.inertia = Transform(RigidTransform(R, Vector3::Zero()), Rod(0.1, along.norm()));
      return body;
    };
    MechanismBuilder builder("fourbar");
    const BodyIndex crank = builder.AddBody(bar("crank", builder.base(), A, B, Vector2::Zero()));
    const BodyIndex coupler = builder.AddBody(bar("coupler", crank, B, C, A));
    const BodyIndex rocker = builder.AddBody(bar("rocker", builder.base(), D, C, Vector2::Zero()));
    builder.AddJoint(JointDef::Hinge("A", crank, Vector3::UnitZ()).WithSpring(k_A, 0.02 * k_A));
    builder.AddJoint(JointDef::Hinge("B", coupler, Vector3::UnitZ()));
    builder.AddJoint(JointDef::Hinge("D", rocker, Vector3::UnitZ()).WithSpring(k_D, 0.02 * k_D));
    const Vector2 on_coupler = C - B, on_rocker = C - D;
    builder.AddClosure(ClosureDef::Connect("C", coupler, rocker, Vector3(on_coupler.x(), on_coupler.y(), 0),
                                           Vector3(on_rocker.x(), on_rocker.y(), 0)));
    builder.SetInterfaces({"coupler"});
    return builder.definition();
  }
};

/// Six struts on the edges of a cube of side a between the corners next to the lower corner and those next to the
/// upper one, universal below, ball above, springs along them; the platform's frame is at the cube's centre.
inline MechanismDef CubicStewart(double a, double k) {
  MechanismBuilder builder("stewart");
  const Vector3 center = Vector3::Constant(a / 2);
  BodyIndex platform;
  const Matrix3 E = Matrix3::Identity();
  std::vector<std::pair<BodyIndex, Vector3>> open;  // strut end and where it meets the platform
  for (int i = 0; i < 3; ++i)
    for (int side = 1; side <= 2; ++side) {
      const std::string n = std::to_string(2 * i + side);
      const Vector3 along = E.col((i + side) % 3), across = E.col((i + 3 - side) % 3), third = E.col(i);
      const Vector3 low = a * third, high = low + a * along;
      BodyDef lower;
      lower.name = "lower" + n;
      lower.parent = builder.base();
      lower.X_PB = RigidTransform(low);
      lower.inertia = Ball(0.1, 0.05);
      const BodyIndex l = builder.AddBody(lower);
      builder.AddJoint(UniversalJoint("universal" + n, l, across, third));
      BodyDef upper;
      upper.name = "upper" + n;
      upper.parent = l;
      upper.X_PB = RigidTransform(Vector3(a * along));
      upper.inertia = Ball(0.1, 0.05);
      const BodyIndex u = builder.AddBody(upper);
      builder.AddJoint(JointDef::Slide("slide" + n, u, along).WithSpring(k, 0.02 * k));
      if (!platform.valid()) {
        BodyDef top;
        top.name = "platform";
        top.parent = u;
        top.X_PB = RigidTransform(Vector3(center - high));
        top.inertia = Brick(3, Vector3(0.1, 0.1, 0.02));
        platform = builder.AddBody(top);
        builder.AddJoint(JointDef::Ball("ball", platform, high - center));
      } else {
        open.emplace_back(u, high - center);
      }
    }
  for (std::size_t i = 0; i < open.size(); ++i)
    builder.AddClosure(ClosureDef::Connect("top" + std::to_string(i), open[i].first, platform,
                                           Vector3::Zero(), open[i].second));
  builder.SetInterfaces({"platform"});
  return builder.definition();
}

/// A torso with four legs of two hinges each. Interfaces: the feet, or only the torso.
inline MechanismDef Walker(BaseKind base, double stiffness, double damping, bool feet = true) {
  MechanismBuilder builder("walker", base, Brick(2, Vector3(0.2, 0.1, 0.05)));
  std::vector<std::string> names;
  for (int i = 0; i < 4; ++i) {
    const std::string n = std::to_string(i);
    BodyDef thigh;
    thigh.name = "thigh" + n;
    thigh.parent = builder.base();
    const Matrix3 R = Eigen::AngleAxisd((0.25 + 0.5 * i) * M_PI, Vector3::UnitZ()).matrix();
    thigh.X_PB = RigidTransform(R, R * Vector3(0.15, 0, 0));
    thigh.inertia = Rod(0.3, 0.15);
    const BodyIndex t = builder.AddBody(thigh);
    builder.AddJoint(JointDef::Hinge("hip" + n, t, Vector3::UnitZ()).WithSpring(stiffness, damping));
    BodyDef shank;
    shank.name = "shank" + n;
    shank.parent = t;
    shank.X_PB = RigidTransform(Vector3(0.15, 0, 0));
    shank.inertia = Rod(0.2, 0.15);
    const BodyIndex s = builder.AddBody(shank);
    builder.AddJoint(JointDef::Hinge("knee" + n, s, Vector3::UnitY()).WithSpring(stiffness, damping));
    names.push_back(shank.name);
  }
  if (!feet) names = {builder.definition().bodies[0].name};
  builder.SetInterfaces(names);
  return builder.definition();
}

}  // namespace fork1s::testing
