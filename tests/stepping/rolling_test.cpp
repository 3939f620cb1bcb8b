// Contacts that roll: where the point goes, and what energy says of it.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/collision/collision_world.hpp>
#include <random>

#include "support.hpp"
#include "world/contact_curvature.hpp"

namespace fork1s {
namespace {

constexpr double kEllipsoidMass = 0.1;
const Vector3 kSemiAxes(0.03, 0.04, 0.05);

// Stands on its longest axis but for a hair, and tumbles down.
Scene PassiveEllipsoid() {
  Scene scene;
  scene.world.push_back(testing::Geometry("ground", Plane{}, 1));
  FreeBodyDef body = testing::BallBody("egg", kEllipsoidMass, 0.04, Vector3::Zero(), 1);
  const Vector3 squares = kSemiAxes.cwiseAbs2();
  body.inertia.rotational = kEllipsoidMass / 5 * (squares.sum() * Vector3::Ones() - squares).asDiagonal();
  body.geometries = {testing::Geometry("egg", Ellipsoid{kSemiAxes}, 1)};
  body.X_WB = RigidTransform(ExpRotation(Vector3(1e-3, 2e-3, 0.1)), Vector3(0, 0, kSemiAxes.z() + 1e-6));
  scene.free_bodies.push_back(body);
  return scene;
}

double EggEnergy(const World& world) {
  return world.KineticEnergy() + world.PotentialEnergy(Vector3(0, 0, -9.81));
}

TEST(Rolling, PassiveEllipsoidNeverGains) {
  for (double h : {1.0 / 60, 0.004}) {
    SCOPED_TRACE(h);
    World world = testing::MustCreate(PassiveEllipsoid());
    const StepOptions step = testing::BackwardEuler(h, testing::kDown);
    const double start = EggEnergy(world);
    double least = start, fastest = 0;
    for (int i = 0; i < 120 / h; ++i) {
      const StepReport report = world.Step(step);
      ASSERT_TRUE(report.IsSolved());
      const double now = EggEnergy(world);
      // Rows foreseen by the old velocity leave the gap O(h³) open, which the next step lifts it by: weight
      // times the third power of what it turns in a step, 0.2 at most here.
      ASSERT_LE(now, least + 2e-4 * start) << i;
      ASSERT_LE(now, start * (1 + 1e-6)) << i;
      least = std::min(least, now);
      fastest = std::max(fastest, world.free_bodies()[0].PortTwist().head<3>().norm());
    }
    EXPECT_GT(fastest, 5);  // it did roll
  }
}

// What implicit Euler takes is of first order, so little is left of it at small steps.
TEST(Rolling, LossIsOfFirstOrder) {
  double loss[3];
  for (int k = 0; k < 3; ++k) {
    Scene scene = PassiveEllipsoid();
    scene.free_bodies[0].X_WB = RigidTransform(ExpRotation(Vector3(0.3, 0.5, 0.1)), Vector3(0, 0, 0.06));
    World world = testing::MustCreate(scene);
    const StepOptions step = testing::BackwardEuler(0.002 / (1 << k), testing::kDown);
    double landed = 0;
    const int steps = static_cast<int>(std::lround(1 / step.h));
    for (int i = 0; i < steps; ++i) {
      world.Step(step);
      if (i == steps / 5) landed = EggEnergy(world);  // it falls for 0.06 s
    }
    loss[k] = landed - EggEnergy(world);
    EXPECT_GT(loss[k], 0);
  }
  EXPECT_NEAR(loss[0] / loss[1], 2, 0.3);
  EXPECT_NEAR(loss[1] / loss[2], 2, 0.3);
}

// A step of second order has the forces of contact along the rows of its end. Along those half a step before it they
// would work on what rolls, and it gained three times its energy in 30 s, at any step.
TEST(Rolling, BySecondOrderAnEllipsoidKeepsItsEnergy) {
  double lost[3];
  const double steps[] = {1.0 / 60, 0.004, 0.001};
  for (int k = 0; k < 3; ++k) {
    const double h = steps[k];
    SCOPED_TRACE(h);
    World world = testing::MustCreate(PassiveEllipsoid());
    StepOptions step;
    step.h = h;
    step.integrator = Integrator::kTwoStage;
    const double start = EggEnergy(world);
    double fastest = 0;
    for (int i = 0; i < 30 / h; ++i) {
      ASSERT_TRUE(world.Step(step).IsSolved());
      // Within a fast turn over the sharp end some is lent and given back.
      ASSERT_LE(EggEnergy(world), start * (1 + 1e-2)) << i;
      fastest = std::max(fastest, world.free_bodies()[0].PortTwist().head<3>().norm());
    }
    EXPECT_GT(fastest, 5);  // it did roll
    lost[k] = 1 - EggEnergy(world) / start;
  }
  EXPECT_LT(lost[1], 0.15);
  EXPECT_LT(lost[2], 0.01);
  EXPECT_GT(lost[2], -1e-3);
}

// Of the material of a body where its surface is touched, world axes.
struct MaterialMotion {
  Vector3 omega = Vector3::Zero(), velocity = Vector3::Zero();
};
struct ContactMotion {
  Vector3 velocity = Vector3::Zero();  // of the contact point, m/s
  Vector3 omega = Vector3::Zero();     // of its normal, without spin, rad/s
};

// D. J. Montana, The kinematics of contact and grasp, IJRR 7(3), 1988: docs/method.md, (6.3).
ContactMotion MotionOf(const PairCurvature& curvature, const Matrix3& frame, const MaterialMotion& a,
                       const MaterialMotion& b) {
  const CurvatureInverse inverse = Invert(curvature);
  const Vector3 n = frame.row(0).transpose();
  const Eigen::Matrix<double, 2, 3> T = frame.bottomRows<2>();
  const Eigen::Vector2d turn = T * (b.omega - a.omega).cross(n), slip = T * (b.velocity - a.velocity);
  // Where flat lies on flat nothing says which of the two carries the point: half of the slip each.
  const Eigen::Vector2d u_a = inverse.inverse * (turn + curvature.b * slip) + 0.5 * inverse.flat * slip;
  const Eigen::Vector2d u_b = u_a - slip, bend = curvature.a * u_a - curvature.b * u_b;
  const Vector3 n_dot = 0.5 * ((a.omega + b.omega).cross(n) + T.transpose() * bend);
  return {0.5 * (a.velocity + b.velocity + T.transpose() * (u_a + u_b)), n.cross(n_dot)};
}

struct Rolled {
  const char* name;
  Shape a, b;
};

// The detector asked a moment later and a moment before is the other method.
// A ball with a weight of ten times its mass below its centre, let go from a lean. It rolls at up to 20 rad/s, and its
// centre of mass, which a step moves, is not that of its curvature: the gap is off by 0.1 mm within steps of 1/60 s.
TEST(Rolling, AnUnbalancedBallIsMetByNoImpact) {
  for (const double lean : {80.0, 120.0})
    for (const double h : {1.0 / 60, 1.0 / 120, 1.0 / 240}) {
      Scene scene;
      scene.world.push_back(testing::Geometry("ground", Plane{}, 1));
      FreeBodyDef body = testing::BallBody("toy", 1.1, 0.1, Vector3::Zero(), 1);
      constexpr double kBelow = 0.07 / 1.1;  // of the centre of mass
      body.inertia.center = Vector3(0, 0, -kBelow);
      const double round =
          0.1 * (0.4 * 0.01 + kBelow * kBelow) + 1.0 * (0.4 * 4e-4 + (0.07 - kBelow) * (0.07 - kBelow));
      body.inertia.rotational = Vector3(round, round, 0.1 * 0.4 * 0.01 + 0.4 * 4e-4).asDiagonal();
      body.X_WB =
          RigidTransform(ExpRotation(Vector3(lean * std::acos(-1.0) / 180, 0, 0)), Vector3(0, 0, 0.1));
      scene.free_bodies.push_back(body);
      World world = testing::MustCreate(scene);
      StepOptions step;
      step.h = h;
      const double lowest = 1.1 * 9.81 * (0.1 - kBelow), start = EggEnergy(world) - lowest;
      double fastest = 0;
      for (int i = 0; i < static_cast<int>(3 / h); ++i) {
        EXPECT_FALSE(world.Step(step).impact) << lean << " degrees, steps of " << h << " s, step " << i;
        fastest = std::max(fastest, world.free_bodies()[0].PortTwist().head<3>().norm());
      }
      EXPECT_GT(fastest, 15);
      // 0.93 and 0.94 at 1/240 s, 0.85 where it is met by impacts.
      if (h < 0.005) {
        EXPECT_GT(EggEnergy(world) - lowest, 0.9 * start) << lean;
      }
    }
}

TEST(Rolling, PointAndNormalGoWhereTheDetectorFindsThemNext) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto any = [&](double size) { return Vector3(size * u(random), size * u(random), size * u(random)); };
  const Rolled pairs[] = {
      {"plane - ellipsoid", Plane{}, Ellipsoid{Vector3(0.05, 0.07, 0.04)}},
      {"plane - box", Plane{}, Box{Vector3(0.05, 0.07, 0.04)}},
      {"plane - cylinder", Plane{}, Cylinder{0.05, 0.07}},
      {"plane - capsule", Plane{}, Capsule{0.05, 0.07}},
      {"sphere - ellipsoid", Sphere{0.06}, Ellipsoid{Vector3(0.05, 0.07, 0.04)}},
      {"sphere - cylinder", Sphere{0.06}, Cylinder{0.05, 0.07}},
      {"sphere - box", Sphere{0.06}, Box{Vector3(0.05, 0.07, 0.04)}},
      {"capsule - capsule", Capsule{0.05, 0.07}, Capsule{0.03, 0.09}},
      {"ellipsoid - ellipsoid", Ellipsoid{Vector3(0.08, 0.05, 0.06)}, Ellipsoid{Vector3(0.05, 0.07, 0.04)}}};
  for (const Rolled& pair : pairs) {
    int tried = 0;
    for (int trial = 0; trial < 40; ++trial) {
      SCOPED_TRACE(::testing::Message() << pair.name << " " << trial);
      RigidTransform X[2] = {RigidTransform(ExpRotation(any(2)), any(0.1)),
                             RigidTransform(ExpRotation(any(2)), any(0.1))};
      const bool on_plane = std::holds_alternative<Plane>(pair.a);
      X[1].translation() = X[0].translation() + 0.2 * (on_plane ? Vector3(X[0].rotation().col(2)) : any(1));
      const auto detect = [&](const RigidTransform& A, const RigidTransform& B) {
        std::vector<CollisionBodyDef> bodies(2);
        bodies[0] = {"a", {testing::Geometry("a", pair.a, 1)}, !on_plane, A};
        bodies[1] = {"b", {testing::Geometry("b", pair.b, 1)}, true, B};
        auto world = CollisionWorld::Create(bodies, {}, {.margin = 1});
        std::vector<ContactPoint> points;
        if (!world || !world->Detect(points)) throw std::runtime_error("no detector");
        std::sort(points.begin(), points.end(), [](const auto& l, const auto& r) { return l.gap < r.gap; });
        return points;
      };
      auto points = detect(X[0], X[1]);
      ASSERT_FALSE(points.empty());
      X[1].translation() -= points[0].gap * points[0].frame.row(0).transpose() *
                            (points[0].body_a == 0 ? 1 : -1);  // so that they touch
      points = detect(X[0], X[1]);
      ASSERT_FALSE(points.empty());
      const ContactPoint p = points[0];
      if (std::abs(p.gap) > 1e-8) continue;  // other sides of the two were nearer by now
      const std::vector<GeometryDef> g = {testing::Geometry("a", pair.a, 1),
                                          testing::Geometry("b", pair.b, 1)};
      const auto ia = static_cast<std::size_t>(p.body_a), ib = static_cast<std::size_t>(p.body_b);
      const double size = std::min(BoundingRadius(pair.a), BoundingRadius(pair.b));
      const PairCurvature curvature = ComputeCurvature(g[ia], X[ia], g[ib], X[ib], p, size);
      // So near an edge that it is taken for the edge, or over it within the time looked at.
      const auto changes = [&](const Vector3& aside) {
        ContactPoint near = p;
        near.point += p.frame.transpose() * aside;
        const PairCurvature other = ComputeCurvature(g[ia], X[ia], g[ib], X[ib], near, size);
        const Eigen::Matrix2d sum = curvature.a + curvature.b;
        return (other.a + other.b - sum).norm() > 0.5 * sum.norm();
      };
      const bool is_corner = (curvature.a + curvature.b).norm() > 1e5;
      if (!is_corner && (changes({0, 1e-3, 0}) || changes({0, -1e-3, 0}) || changes({0, 0, 1e-3}) ||
                         changes({0, 0, -1e-3})))
        continue;
      // Twists about the contact, that keep them in touch.
      MaterialMotion motion[2] = {{any(1), any(0.1)}, {any(1), any(0.1)}};
      if (on_plane) motion[0] = {};
      const Vector3 n = p.frame.row(0).transpose();
      motion[1].velocity -= n * n.dot(motion[1].velocity - motion[0].velocity);
      const ContactMotion found = MotionOf(curvature, p.frame, motion[ia], motion[ib]);
      // Turned round, nothing changes.
      PairCurvature turned = curvature;
      std::swap(turned.a, turned.b);
      Matrix3 frame = p.frame;
      frame.topRows<2>() *= -1;
      for (Eigen::Matrix2d* K : {&turned.a, &turned.b}) {
        (*K)(0, 1) *= -1;
        (*K)(1, 0) *= -1;
      }
      const ContactMotion again = MotionOf(turned, frame, motion[ib], motion[ia]);
      // A corner's curvature stands for 3e7 / m, and rounding of 1e-12 m/s for 1e-4 rad/s there.
      EXPECT_LT((again.velocity - found.velocity).norm(), 1e-9);
      EXPECT_LT((again.omega - found.omega).norm(), 1e-4);

      const double dt = 1e-3;
      const auto at = [&](double t) {
        RigidTransform Y[2];
        for (std::size_t i = 0; i < 2; ++i) {
          const Matrix3 R = ExpRotation(t * motion[i].omega);
          Y[i] = RigidTransform(R * X[i].rotation(),
                                p.point + R * (X[i].translation() - p.point) + t * motion[i].velocity);
        }
        return detect(Y[0], Y[1]).front();
      };
      const ContactPoint before = at(-dt), after = at(dt);
      // Over an edge it jumps to the next.
      if ((after.point - before.point).norm() > 0.005) continue;
      ++tried;
      const Vector3 velocity = (after.point - before.point) / (2 * dt);
      const Vector3 n_dot = (after.frame.row(0) - before.frame.row(0)).transpose() / (2 * dt);
      // The detector's 1e-10 m of search are 2e-6 m of place on a round surface and 5e-5 of its normal.
      EXPECT_LT((velocity - found.velocity).norm(), 0.005)
          << velocity.transpose() << " for " << found.velocity.transpose();
      EXPECT_LT((n_dot - found.omega.cross(n)).norm(), 0.1)
          << n_dot.transpose() << " for " << found.omega.cross(n).transpose();
    }
    EXPECT_GT(tried, 10) << pair.name;
  }
}

// What a contact does as it rolls has no length but those of the shapes: 1 mm or 1 km, rims, edges and corners included.
TEST(Rolling, InverseCurvature_ScaledShapes_ScalesWithThem) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto scaled = [](const Shape& shape, double s) {
    Shape out = shape;
    if (auto* box = std::get_if<Box>(&out)) box->half *= s;
    if (auto* cylinder = std::get_if<Cylinder>(&out))
      *cylinder = Cylinder{s * cylinder->radius, s * cylinder->half_length};
    if (auto* sphere = std::get_if<Sphere>(&out)) sphere->radius *= s;
    return out;
  };
  const Shape others[] = {Box{Vector3(0.5, 0.7, 0.4)}, Cylinder{0.5, 0.7}, Plane{}};
  for (const Shape& other : others)
    for (int trial = 0; trial < 40; ++trial) {
      // On the face, an edge or a corner of the box, or somewhere on its side.
      Vector3 p(0.3 * u(random), 0.3 * u(random), 0.4);
      if (trial % 3 > 0) p.x() = 0.5;
      if (trial % 3 > 1) p.y() = 0.7;
      const Matrix3 turn = ExpRotation(Vector3(u(random), u(random), u(random)));
      const auto at = [&](double s) {
        ContactPoint point;
        point.frame = turn;
        point.point = s * p;
        const auto first = testing::Geometry("a", scaled(Box{Vector3(0.5, 0.7, 0.4)}, s), 1),
                   second = testing::Geometry("b", scaled(other, s), 1);
        const RigidTransform X(ExpRotation(Vector3(0.2, 0.3, 0.1)), s * Vector3(0.1, 0.2, 0.8));
        return ComputeInverseCurvature(first, RigidTransform(), second, X, point, 0.5 * s);
      };
      const Matrix3 one = at(1);
      for (double s : {1e-3, 1e3})
        EXPECT_LE((at(s) / s - one).norm(), 1e-9 * (1 + one.norm())) << trial << " at " << s;
    }
}

// A wheel at 5 m/s touches the ground 83 mm farther on in each step, with another part of its tread. It is
// the same contact: what it bore is where the next step starts, also where a torque drives it and friction
// holds.
TEST(Rolling, AWheelKeepsItsContacts) {
  constexpr double kRadius = 0.3, kMass = 20, kTorque = 10;
  Scene scene;
  scene.world.push_back(testing::Geometry("ground", Plane{}, 1));
  FreeBodyDef wheel = testing::BallBody("wheel", kMass, kRadius, Vector3::Zero(), 1);
  wheel.inertia.rotational = kMass * kRadius * kRadius * Vector3(0.3, 0.3, 0.5).asDiagonal();
  wheel.geometries = {testing::Geometry("tread", Cylinder{kRadius, 0.1}, 1)};
  wheel.X_WB = RigidTransform(ExpRotation(Vector3(M_PI / 2, 0, 0)), Vector3(0, 0, kRadius));
  scene.free_bodies.push_back(wheel);
  World world = testing::MustCreate(scene);
  FreeBody& body = world.free_bodies()[0];
  body.SetState(wheel.X_WB, Vector3(0, 5 / kRadius, 0), Vector3(5, 0, 0));
  for (int i = 0; i < 60; ++i) {
    const Vector3 center = body.pose().translation();
    body.AddWrench(Vector3::Zero(), Vector3(0, kTorque, 0), center);
    const StepReport report = world.Step({});
    ASSERT_TRUE(report.IsSolved());
    ASSERT_GT(report.solver.active, 0);
    if (i >= 5) {
      EXPECT_LE(report.solver.newton_iterations, 1) << i;
    }
  }
  // Half the torque's share of what a rolling wheel is: I + m r².
  const double gain = 1.0 * kTorque / (kMass * kRadius * kRadius * 1.5);
  EXPECT_NEAR(body.PortTwist()[1], 5 / kRadius + gain, 1e-3 * gain);
}

}  // namespace
}  // namespace fork1s
