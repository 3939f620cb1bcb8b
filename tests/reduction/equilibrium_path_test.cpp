// Equilibria beyond limit points, and of motions that prestress alone resists, against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "mechanisms.hpp"
#include "reduction/tangent_stiffness.hpp"

namespace fork1s {
namespace {

using testing::Ball;
using testing::Share;

constexpr double kHalfSpan = 0.3, kRise = 0.1, kBar = 2000;  // m, N/m

// Von Mises truss: an apex that slides along z between two bars, each a hinge and a sprung slide, connected
// to it.
std::shared_ptr<const Mechanism> Truss() {
  MechanismBuilder builder("truss");
  const auto add = [&](const std::string& name, BodyIndex parent, const RigidTransform& X) {
    BodyDef body;
    body.name = name;
    body.parent = parent;
    body.X_PB = X;
    body.inertia = Ball(0.05, 0.01);
    return builder.AddBody(body);
  };
  const BodyIndex apex = add("apex", builder.base(), RigidTransform(Vector3(0, 0, kRise)));
  builder.AddJoint(JointDef::Slide("z", apex, Vector3::UnitZ()));
  for (const double side : {-1.0, 1.0}) {
    const std::string suffix = side < 0 ? "_left" : "_right";
    const double length = std::hypot(kHalfSpan, kRise), angle = std::atan2(kRise, -side * kHalfSpan);
    const Matrix3 R = Eigen::AngleAxisd(-angle, Vector3::UnitY()).matrix();
    const BodyIndex hinge =
        add("hinge" + suffix, builder.base(), RigidTransform(R, Vector3(side * kHalfSpan, 0, 0)));
    builder.AddJoint(JointDef::Hinge("hinge" + suffix, hinge, Vector3::UnitY()));
    const BodyIndex bar = add("bar" + suffix, hinge, RigidTransform(Vector3(length, 0, 0)));
    builder.AddJoint(JointDef::Slide("bar" + suffix, bar, Vector3::UnitX()).WithSpring(kBar, 0));
    builder.AddClosure(ClosureDef::Connect("pin" + suffix, apex, bar, Vector3::Zero(), Vector3::Zero()));
  }
  builder.SetInterfaces({"apex"});
  return Share(builder.definition());
}

double TrussForce(double z) {  // along z, that holds the apex at height z
  const double length = std::hypot(kHalfSpan, z);
  return 2 * kBar * (length - std::hypot(kHalfSpan, kRise)) * z / length;
}

double TrussStiffness(double z) {
  constexpr double h = 1e-6;
  return (TrussForce(z + h) - TrussForce(z - h)) / (2 * h);
}

TEST(EquilibriumPath, TrussSnapsThrough) {
  const auto m = Truss();
  const BodyIndex apex = m->FindBody("apex");
  double limit = 0;
  for (double z = 0; z < kRise; z += 1e-5) limit = std::min(limit, TrussForce(z));
  for (const double force : {-0.5, -4.0, -7.0, -8.0, -8.6, -20.0}) {
    SCOPED_TRACE(force);
    const auto result = SolveStatics(*m, VectorX::Zero(5), {{apex, Vector3(0, 0, force)}});
    ASSERT_TRUE(result.converged);
    const double z = kRise + result.q(0);
    EXPECT_NEAR(TrussForce(z), force, 1e-8);
    EXPECT_TRUE(result.tangent.IsStable());
    if (force > limit) {
      EXPECT_GT(z, 0.04);
      EXPECT_TRUE(result.limit_shares.empty());
    } else {
      EXPECT_LT(z, -kRise);
      ASSERT_EQ(result.limit_shares.size(), 2u);
      EXPECT_NEAR(result.limit_shares[0], limit / force, 2e-2);
      EXPECT_NEAR(result.limit_shares[1], -limit / force, 2e-2);
    }
    const auto tangent = ComputeTangentStiffness(*m, result.q, {{apex, Vector3(0, 0, force)}}, {});
    EXPECT_NEAR(1 / TangentCompliance(*m, result.q, tangent, {{apex, {}}}).C(5, 5), TrussStiffness(z), 1e-3);
  }
}

// A bead that slides along x and z between two tendons of springs, taut by 200 N.
TEST(EquilibriumPath, BeadIsHeldByThePrestressOfCables) {
  MechanismBuilder builder("bead");
  BodyDef body;
  body.name = "bead";
  body.parent = builder.base();
  body.inertia = Ball(0.5, 0.03);
  const BodyIndex bead = builder.AddBody(body);
  builder.AddJoint(JointDef::Slide("x", bead, Vector3::UnitX()));
  builder.AddJoint(JointDef::Slide("z", bead, Vector3::UnitZ()));
  builder.SetInterfaces({"bead"});
  MechanismDef def = builder.definition();
  for (const double side : {-1.0, 1.0}) {
    PathDef cable;
    cable.name = side < 0 ? "left" : "right";
    cable.elements.resize(2);
    cable.elements[0].body = builder.base();
    cable.elements[0].X_BE = RigidTransform(Vector3(0.5 * side, 0, 0));
    cable.elements[1].body = bead;
    SpringDef spring;
    spring.name = cable.name;
    spring.stiffness = 2000;
    spring.rest = -0.1;
    spring.along.path = static_cast<int>(def.paths.size());
    def.paths.push_back(cable);
    def.springs.push_back(spring);
  }
  const auto m = Share(def);
  const std::vector<DeadLoad> loads{{bead, Vector3(0, 0, -10)}};
  const auto linear = LinearDeflection(*m, VectorX::Zero(2), loads);
  ASSERT_TRUE(linear) << linear.error().Text();
  EXPECT_NEAR((*linear)(1), -0.0125, 1e-9);
  const auto result = SolveStatics(*m, VectorX::Zero(2), loads);
  ASSERT_TRUE(result.converged);
  const double z = result.q(1), length = std::hypot(0.5, z);
  EXPECT_NEAR(2 * 2000 * (length - 0.4) * z / length, -10, 1e-8);
  EXPECT_TRUE(result.tangent.IsStable());
}

// A bead on two cords that are taut, just so or slack where it starts, and slack in the equilibrium without load.
TEST(EquilibriumPath, BeadOnCords_SlackWhereUnloaded_HangsByClosedForm) {
  constexpr double kCord = 2000, kMass = 0.5, kSpan = 0.5, kLength = 0.6;  // N/m, kg, m: half of the span
  double low = -2, high = -std::sqrt(kLength * kLength - kSpan * kSpan);   // where it hangs, and slack
  for (int i = 0; i < 100; ++i) {
    const double z = 0.5 * (low + high), length = std::hypot(kSpan, z);
    (2 * kCord * (length - kLength) * -z / length > kMass * 9.81 ? low : high) = z;
  }
  for (const double start : {-0.1, -0.3316, -0.34, -0.5}) {
    for (const bool turned : {false, true}) {
      SCOPED_TRACE(std::to_string(start) + (turned ? " turned" : ""));
      const Matrix3 R = turned ? ExpRotation(Vector3(0.4, -1.1, 0.7)) : Matrix3::Identity();
      MechanismBuilder builder("bead");
      BodyDef body;
      body.name = "bead";
      body.parent = builder.base();
      body.X_PB = RigidTransform(Vector3(R * Vector3(0, 0, start)));
      body.inertia = Ball(kMass, 0.03);
      const BodyIndex bead = builder.AddBody(body);
      Matrix6X screws = Matrix6X::Zero(6, 3);
      screws.bottomRows<3>().setIdentity();
      builder.AddJoint(JointDef::General("position", bead, screws));
      builder.SetInterfaces({"bead"});
      MechanismDef def = builder.definition();
      for (const double side : {-1.0, 1.0}) {
        const double length = std::hypot(kSpan, start);
        PathDef cord;
        cord.elements.resize(2);
        cord.elements[0].body = builder.base();
        cord.elements[0].X_BE = RigidTransform(Vector3(R * Vector3(kSpan * side, 0, 0)));
        cord.elements[1].body = bead;
        SpringDef spring;
        spring.name = cord.name = side < 0 ? "left" : "right";
        spring.stiffness = kCord;
        spring.rest = -length;  // slack from a length of 0 to kLength
        spring.slack = kLength;
        spring.along.path = static_cast<int>(def.paths.size());
        def.paths.push_back(cord);
        def.springs.push_back(spring);
      }
      const auto m = Share(def);
      StaticsOptions options;
      options.gravity_R = R * Vector3(0, 0, -9.81);
      const auto result = SolveStatics(*m, VectorX::Zero(3), {}, options);
      ASSERT_TRUE(result.converged);
      EXPECT_LT((result.q - R * Vector3(0, 0, low - start)).norm(), 1e-9);
      EXPECT_TRUE(result.tangent.IsStable());
    }
  }
}

// Without anything that holds it there is no equilibrium.
TEST(EquilibriumPath, BodyThatNothingHolds_DoesNotConverge) {
  MechanismBuilder builder("stone");
  BodyDef body;
  body.name = "stone";
  body.parent = builder.base();
  body.inertia = Ball(1, 0.1);
  const BodyIndex stone = builder.AddBody(body);
  builder.AddJoint(JointDef::Slide("falls", stone, Vector3::UnitZ()));
  builder.SetInterfaces({"stone"});
  StaticsOptions options;
  options.gravity_R = Vector3(0, 0, -9.81);
  EXPECT_FALSE(SolveStatics(*Share(builder.definition()), VectorX::Zero(1), {}, options).converged);
}

}  // namespace
}  // namespace fork1s
