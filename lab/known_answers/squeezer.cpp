// Andrews' squeezing mechanism: seven bodies, three loops, one freedom.
//
// Data and results: Hairer and Wanner, Solving Ordinary Differential Equations II, section VII.7, and the
// test set for initial value problem solvers built on it. Lengths in m; the letters are those of the
// publication.
#include <fmt/format.h>
#include <cmath>

#include "cases.hpp"
#include "support.hpp"

namespace fork1s::internal {
namespace {

constexpr double kXa = -.06934, kYa = -.00227, kXb = -.03635, kYb = .03273, kXc = .014, kYc = .072;
constexpr double kD = .028, kDa = .0115, kE = .02, kEa = .01421, kRr = .007, kRa = .00092, kSs = .035,
                 kSa = .01874, kSb = .01043, kSc = .018, kSd = .02, kTa = .02308, kTb = .00916, kU = .04,
                 kUa = .01228, kUb = .00449, kZf = .02, kZt = .04, kFa = .01421;
constexpr double kSpring = 4530, kUnloaded = .07785, kTorque = .033;  // N/m, m, N·m
constexpr double kMass[] = {.04325, .00365, .02373, .00706, .07050, .00706, .05498};
constexpr double kInertia[] = {2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5};

MechanismDef SqueezerDefinition() {
  MechanismBuilder builder("squeezer");
  auto add = [&](int number, BodyIndex parent, double x, double y, double center_x, double center_y) {
    BodyDef body;
    body.name = fmt::format("K{}", number);
    body.parent = parent;
    body.X_PB.translation() = Vector3(x, y, 0);
    body.inertia = {kMass[number - 1], Vector3(center_x, center_y, 0),
                    kInertia[number - 1] * Matrix3::Identity()};
    const BodyIndex b = builder.AddBody(body);
    builder.AddJoint(JointDef::Hinge("hinge of " + body.name, b, Vector3::UnitZ()));
    return b;
  };
  const BodyIndex base = builder.base();
  const BodyIndex k1 = add(1, base, 0, 0, kRa, 0);
  const BodyIndex k2 = add(2, k1, kRr, 0, -kDa, 0);
  const BodyIndex k3 = add(3, base, kXb, kYb, kSb, -kSa);
  const BodyIndex k5 = add(5, base, kXa, kYa, kTa, kTb);
  const BodyIndex k4 = add(4, k5, kZt, 0, 0, kEa - kE);
  const BodyIndex k7 = add(7, base, kXa, kYa, -kUb, -kUa);
  const BodyIndex k6 = add(6, k7, 0, -kU, kZf - kFa, 0);
  auto join = [&](const char* name, BodyIndex b, double x, double y) {
    ClosureDef c = ClosureDef::Connect(name, k2, b, Vector3(-kD, 0, 0), Vector3(x, y, 0));
    c.rigid(5) = false;  // all is plane
    builder.AddClosure(c);
  };
  join("loop 1", k3, 0, -kSs);
  join("loop 2", k4, 0, -kE);
  join("loop 3", k6, kZf, 0);
  builder.SetInterfaces({"K1"});
  return builder.definition();
}

/// In the order of the bodies K1 K2 K3 K5 K4 K7 K6: β Θ γ δ Φ ε Ω.
VectorX Angles(double beta, double theta, double gamma, double delta, double phi, double epsilon,
               double omega) {
  VectorX q(7);
  q << beta, theta, gamma, delta, phi, epsilon, omega;
  return q;
}

VectorX InitialAngles() {
  return Angles(-.0617138900142764496, 0, .455279819163070380, .487364979543842550, .222668390165885884,
                1.23054744454982119, -.222668390165885884);
}

Scene SceneAt(const VectorX& q) {
  Scene scene = SceneOf(SqueezerDefinition());
  StartAt(scene, q, VectorX::Zero(7));
  return scene;
}

/// The motor's torque on the crank, and the spring between a point of K3 and the ground.
template <class Simulator>
void Drive(Simulator& s, double torque) {
  s.ApplyWrench(s.FindBody("K1"), Vector3::Zero(), Vector3(0, 0, torque), Vector3::Zero());
  const int k3 = s.FindBody("K3");
  const Vector3 point = s.Pose(k3) * Vector3(kSd, -kSc, 0), away = point - Vector3(kXc, kYc, 0);
  s.ApplyWrench(k3, -kSpring * (away.norm() - kUnloaded) * away.normalized(), Vector3::Zero(), point);
}

struct Start {
  double beta = 0;          // rad
  double acceleration = 0;  // rad/s², of the crank, from rest
  Vector3 reaction_W = Vector3::Zero();
};

// One step of 1e-8 s from rest: nothing has moved, so rate over time is the acceleration, to 1e-4 of the
// digits that are left of 16.
template <class Method>
Start StartOf(double beta_offset, double torque) {
  constexpr double h = 1e-8;
  VectorX q = InitialAngles();
  q(0) += beta_offset;
  auto s = Method::Start(SceneAt(q), h);
  Start start;
  start.beta = Displacements(s)(0);
  Drive(s, torque);
  if constexpr (std::is_same_v<Method, FullMethod>) {
    // The tolerance on poses cannot be met: nothing moves by a length that could be told from rounding.
    if (!s.Step().finite) throw CaseFailure("full: the squeezer's first step is not finite");
    const VectorX forces = s.ClosureForces(0);
    start.reaction_W = s.Pose(s.FindBody("K2")).rotation() * Vector3(forces(0), forces(1), 0);
  } else {
    StepOnce(s);
  }
  start.acceleration = s.Velocity(s.FindBody("K1"))(2) / h;
  return start;
}

struct Crank {
  double acceleration = 0, inertia = 0, torque = 0, stiffness = 0;
  Vector3 reaction_W = Vector3::Zero();
};

// At rest T(β) = I(β) β̈, so that accelerations tell inertia, torque and, by difference, stiffness.
template <class Method>
Crank CrankAtStart() {
  constexpr double kOffset = 1e-4;  // rad
  const Start driven = StartOf<Method>(0, kTorque), still = StartOf<Method>(0, 0);
  const Start ahead = StartOf<Method>(kOffset, 0), behind = StartOf<Method>(-kOffset, 0);
  Crank crank;
  crank.acceleration = driven.acceleration;
  crank.inertia = kTorque / (driven.acceleration - still.acceleration);
  crank.torque = crank.inertia * still.acceleration;
  crank.stiffness = -crank.inertia * (ahead.acceleration - behind.acceleration) / (ahead.beta - behind.beta);
  crank.reaction_W = driven.reaction_W;
  return crank;
}

template <class Method>
VectorX PoseAt(double time, const std::vector<double>& step_sizes) {
  std::vector<VectorX> ends;
  for (const double h : step_sizes) {
    auto s = Method::Start(SceneAt(InitialAngles()), h);
    const int steps = static_cast<int>(time / h + 0.5);
    for (int i = 0; i < steps; ++i) {
      Drive(s, kTorque);
      StepOnce(s);
    }
    ends.push_back(Displacements(s));
  }
  return ExtrapolateToZero(std::move(ends));
}

}  // namespace

std::vector<KnownAnswer> Squeezer(Refinement refinement) {
  Rows rows("squeezer");
  const Crank reduced = CrankAtStart<ReducedMethod>(), full = CrankAtStart<FullMethod>();
  const char* published = "published (Hairer and Wanner)";
  const char* derived =
      "derived from the published data: the inertia is the torque of 0.033 N·m over the published "
      "acceleration";
  const char* digits = "rates after 1e-8 s are solved to about 1e-7 of their size";
  rows.Add({"crank acceleration at t = 0", "rad/s²", 14222.4439, 1e-6 * 14222, digits, published},
           reduced.acceleration, full.acceleration);
  rows.Add({"reaction λ₁ of the loop through K3", "N", 98.56687, 1e-4, digits, published}, std::nullopt,
           std::abs(full.reaction_W.x()));
  rows.Add({"reaction λ₂, magnitude", "N", 6.12269, 1e-4, digits, published}, std::nullopt,
           std::abs(full.reaction_W.y()));
  rows.Add({"inertia seen at the crank", "kg·m²", 2.3202763e-6, 1e-6 * 2.32e-6, digits, derived},
           reduced.inertia, full.inertia);
  rows.Add({"torque of the spring at the crank", "N·m", 0, 1e-6 * kTorque, "as above, of the motor's torque",
            derived},
           reduced.torque, full.torque);
  rows.Add({"tangent stiffness at the crank, all geometric", "N·m/rad", -0.518378, 1e-4 * 0.518378,
            "difference of two accelerations over 2e-4 rad", derived},
           reduced.stiffness, full.stiffness);

  constexpr double kTime = 0.03;
  const bool fine = refinement == Refinement::kFine;
  const std::vector<double> step_sizes =
      fine ? std::vector<double>{2e-5, 1e-5, 5e-6, 2.5e-6} : std::vector<double>{4e-5, 2e-5, 1e-5};
  const VectorX r = PoseAt<ReducedMethodByDegrees>(kTime, step_sizes),
                f = PoseAt<FullMethod>(kTime, step_sizes);
  const VectorX expected =
      Angles(15.8107712, -15.7563711, .0408222, .5244100, -.5347301, 1.0480807, .5347301);
  const char* names[] = {"β", "Θ", "γ", "δ", "Φ", "ε", "Ω"};
  for (int i = 0; i < 7; ++i)
    rows.Add({fmt::format("{} at 0.03 s", names[i]), "rad", expected(i), fine ? 1e-3 : 0.05,
              "first order; steps of 20 to 2.5 µs extrapolated to zero, the reduced reference moved at every "
              "degree",
              published},
             r(i), f(i));
  return rows.Release();
}

}  // namespace fork1s::internal
