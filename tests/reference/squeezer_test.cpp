// Andrews' squeezing mechanism: seven bodies, three loops, one freedom, published to many digits.
#include <array>
#include <cmath>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

// Lengths in m, masses in kg, inertias in kg m²; the letters are those of the publication.
constexpr double kXa = -.06934, kYa = -.00227, kXb = -.03635, kYb = .03273, kXc = .014, kYc = .072;
constexpr double kD = .028, kDa = .0115, kE = .02, kEa = .01421, kRr = .007, kRa = .00092, kSs = .035,
                 kSa = .01874, kSb = .01043, kSc = .018, kSd = .02, kTa = .02308, kTb = .00916, kU = .04,
                 kUa = .01228, kUb = .00449, kZf = .02, kZt = .04, kFa = .01421;
constexpr double kSpring = 4530, kUnloaded = .07785, kTorque = .033;
constexpr double kMass[] = {.04325, .00365, .02373, .00706, .07050, .00706, .05498};
constexpr double kInertia[] = {2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5};

SpatialInertia Part(int number, double x, double y) {
  SpatialInertia I;
  I.mass = kMass[number - 1];
  I.center = Vector3(x, y, 0);
  I.rotational = kInertia[number - 1] * Matrix3::Identity();
  return I;
}

MechanismDef Squeezer() {
  MechanismBuilder builder("squeezer");
  auto add = [&](const std::string& name, BodyIndex parent, double x, double y,
                 const SpatialInertia& inertia) {
    BodyDef body;
    body.name = name;
    body.parent = parent;
    body.X_PB.translation() = Vector3(x, y, 0);
    body.inertia = inertia;
    const BodyIndex b = builder.AddBody(body);
    builder.AddJoint(JointDef::Hinge("hinge of " + name, b, Vector3::UnitZ()));
    return b;
  };
  const BodyIndex base = builder.base();
  const BodyIndex k1 = add("K1", base, 0, 0, Part(1, kRa, 0));
  const BodyIndex k2 = add("K2", k1, kRr, 0, Part(2, -kDa, 0));
  const BodyIndex k3 = add("K3", base, kXb, kYb, Part(3, kSb, -kSa));
  const BodyIndex k5 = add("K5", base, kXa, kYa, Part(5, kTa, kTb));
  const BodyIndex k4 = add("K4", k5, kZt, 0, Part(4, 0, kEa - kE));
  const BodyIndex k7 = add("K7", base, kXa, kYa, Part(7, -kUb, -kUa));
  const BodyIndex k6 = add("K6", k7, 0, -kU, Part(6, kZf - kFa, 0));
  auto join = [&](BodyIndex b, double x, double y) {
    ClosureDef c =
        ClosureDef::Connect("loop" + std::to_string(b.value()), k2, b, Vector3(-kD, 0, 0), Vector3(x, y, 0));
    c.rigid(5) = false;  // all is plane
    builder.AddClosure(c);
  };
  join(k3, 0, -kSs);
  join(k4, 0, -kE);
  join(k6, kZf, 0);
  return builder.definition();
}

// Joint displacements in the order of the bodies above.
struct Angles {
  double beta, theta, gamma, delta, phi, epsilon, omega;
  VectorX Vector() const {
    VectorX q(7);
    q << beta, theta, gamma, delta, phi, epsilon, omega;
    return q;
  }
};
const Angles kStart{-.0617138900142764496, 0,
                    .455279819163070380,   .487364979543842550,
                    .222668390165885884,   1.23054744454982119,
                    -.222668390165885884};

FullSimulation StartSqueezer(double h) {
  Scene scene = Of(Squeezer());
  StartAt(scene, kStart.Vector(), VectorX::Zero(7));
  return reference_test::Start(scene, h);
}

// The motor's torque on the crank, and the spring between a point of K3 and the ground.
void Drive(FullSimulation& s) {
  s.ApplyWrench(s.FindBody("K1"), Vector3::Zero(), Vector3(0, 0, kTorque), Vector3::Zero());
  const int k3 = s.FindBody("K3");
  const Vector3 point = s.Pose(k3) * Vector3(kSd, -kSc, 0), away = point - Vector3(kXc, kYc, 0);
  s.ApplyWrench(k3, -kSpring * (away.norm() - kUnloaded) * away.normalized(), Vector3::Zero(), point);
}

TEST(Squeezer, StartsWithThePublishedAcceleration) {
  constexpr double h = 1e-8;
  FullSimulation s = StartSqueezer(h);
  Drive(s);
  ASSERT_TRUE(s.Step().finite);
  // Digits: rates of 1e-4 rad/s are solved to about 1e-11 of their size.
  EXPECT_NEAR(s.Rates(0)(0) / h, 14222.4439, 0.01);
  // Two reactions are not 0; the loop through K3 carries them.
  const VectorX force = s.ClosureForces(0);
  EXPECT_NEAR(force.norm(), std::hypot(98.56687, 6.12269), 1e-3);
}

TEST(Squeezer, ReachesThePublishedPose) {
  constexpr double kTime = 0.03;
  auto end = [&](double h) {
    FullSimulation s = StartSqueezer(h);
    const int steps = static_cast<int>(kTime / h + 0.5);
    for (int i = 0; i < steps; ++i) {
      Drive(s);
      const FullStepReport report = s.Step();
      EXPECT_TRUE(report.finite);
      EXPECT_LT(report.joint_gap, 1e-9);
    }
    return s.Displacements(0);
  };
  const VectorX coarse = end(2e-5), fine = end(1e-5);
  const VectorX expected =
      Angles{15.8107712, -15.7563711, .0408222, .5244100, -.5347301, 1.0480807, .5347301}.Vector();
  const double error = (2 * fine - coarse - expected).norm();
  // First order, 0.3 rad at the finer step after 16 rad of the crank at up to 1000 rad/s; extrapolation takes
  // most of it away.
  EXPECT_LT(error, 0.1) << (fine - expected).transpose();
  EXPECT_NEAR((coarse - expected).norm() / (fine - expected).norm(), 2, 0.3);
}

}  // namespace
}  // namespace fork1s::reference_test
