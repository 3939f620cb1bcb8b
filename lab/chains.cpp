#include "chains.hpp"

#include <fork1s/mechanism/builder.hpp>

#include <fmt/format.h>

namespace fork1s::internal {

std::shared_ptr<const Mechanism> MakeChain(int joints, int interfaces) {
  MechanismBuilder builder("chain");
  BodyIndex parent = builder.base();
  const double length = 0.05, mass = 0.02;
  for (int i = 0; i < joints; ++i) {
    BodyDef link;
    link.name = fmt::format("link{}", i);
    link.parent = parent;
    if (i > 0) link.X_PB = RigidTransform(Vector3(length, 0, 0));
    link.inertia = {mass, Vector3(length / 2, 0, 0), Vector3(1e-6, 5e-6, 5e-6).asDiagonal()};
    parent = builder.AddBody(link);
    builder.AddJoint(
        JointDef::Hinge(fmt::format("joint{}", i), parent, i % 2 ? Vector3::UnitY() : Vector3::UnitZ())
            .WithSpring(100, 1));
  }
  std::vector<std::string> names;
  for (int i = 1; i <= interfaces; ++i) names.push_back(fmt::format("link{}", joints * i / interfaces - 1));
  builder.SetInterfaces(names);
  return std::make_shared<const Mechanism>(std::move(builder.Build().value()));
}

std::shared_ptr<const Mechanism> MakeFourBars(int count) {
  MechanismBuilder builder("four-bars");
  // Hinges of one, where they stand at the reference: crank on the base, coupler on it, rocker on the base,
  // closed to the coupler.
  const Vector3 A(0, 0, 0), B(0, 0.1, 0), C(0.15, 0.15, 0), D(0.2, 0, 0);
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) {
    const RigidTransform X(ExpRotation(Vector3(0.1 * i, 0, 0)), Vector3(0, 0, 0.05 * i));
    const auto bar = [&](const char* what, BodyIndex parent, const RigidTransform& X_PB, double stiffness) {
      BodyDef body;
      body.name = fmt::format("{}{}", what, i);
      body.parent = parent;
      body.X_PB = X_PB;
      body.inertia = {0.1, Vector3(0.05, 0.05, 0), Vector3(1e-5, 1e-5, 2e-5).asDiagonal()};
      const BodyIndex b = builder.AddBody(body);
      builder.AddJoint(JointDef::Hinge(fmt::format("{}_hinge{}", what, i), b, Vector3::UnitZ())
                           .WithSpring(stiffness, 0.02 * stiffness));
      return b;
    };
    const BodyIndex crank = bar("crank", builder.base(), X, 2);
    const BodyIndex coupler = bar("coupler", crank, RigidTransform(B), 0.1);
    const BodyIndex rocker = bar("rocker", builder.base(), X * RigidTransform(D), 0.5);
    builder.AddClosure(ClosureDef::Connect(fmt::format("C{}", i), coupler, rocker, C - B, C - D));
    names.push_back(fmt::format("coupler{}", i));
  }
  builder.SetInterfaces(names);
  return std::make_shared<const Mechanism>(std::move(builder.Build().value()));
}

}  // namespace fork1s::internal
