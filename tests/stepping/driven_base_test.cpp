// Driven bases in steps of two stages: friction, weight and springs on a base whose rate is continuous.
#include <cmath>
#include <fork1s/world/world_state.hpp>
#include <functional>
#include <stepping/support.hpp>

#include "stepping/step_context.hpp"

namespace fork1s::driven_base_test {
namespace {

using testing::MustCreate;
using testing::MustStart;

constexpr double kGravity = 9.81, kFriction = 0.5;
const double kSteps[] = {1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 480};

struct Motion {
  std::function<RigidTransform(double)> pose;
  std::function<Vector6(double)> rate;  // world axes, velocity of the origin
};

enum class Rate { kKnown, kEstimated };

void Drive(MechanismDynamics& m, const Motion& motion, double t, Rate rate) {
  if (rate == Rate::kKnown)
    m.DriveBase(motion.pose(t), motion.rate(t));
  else
    m.DriveBase(motion.pose(t));
}

// A plate with its upper side at z = 0 of its frame and a box on it at `at`.
Scene BoxOnPlate(const RigidTransform& X_WP, const Vector3& at, double mass) {
  const Vector3 half(3, 3, 0.05), box(0.05, 0.05, 0.05);
  MechanismDef plate = testing::Chain(1, 0.1, 0.1, 5, 0.1);
  plate.base = BaseKind::kDriven;
  plate.bodies[0].geometries.push_back(
      testing::Geometry("plate", Box{half}, kFriction, RigidTransform(Vector3(0, 0, -0.05))));
  plate.interfaces.push_back(plate.bodies[0].name);
  plate.X_WR = X_WP;
  Scene scene;
  scene.mechanisms.push_back(plate);
  scene.free_bodies.push_back(testing::BoxBody("box", mass, box, Vector3::Zero(), kFriction));
  scene.free_bodies[0].X_WB = X_WP * RigidTransform(at + Vector3(0, 0, 0.05));
  return scene;
}

Vector3 ForceOnBox(const World& world, double h) {
  Vector3 force = Vector3::Zero();
  for (const ContactRecord& c : world.contacts()) {
    const Vector3 f = c.point.frame.transpose() * c.impulse / h;
    force += f.z() > 0 ? f : Vector3(-f);
  }
  return force;
}

struct Ride {
  double slip = 0;  // m, largest distance from where the box stood on the plate
  double force_error =
      0;  // of m a, relative, from the fourth step of the acceleration on; of estimated rates the tenth
  int impacts = 0;
};

// Still for 0.2 s, then at constant acceleration for 0.4 s, then at constant speed for 0.2 s.
Ride Accelerate(double share_of_limit, double h, double yaw, double mass, Rate rate) {
  const double a = share_of_limit * kFriction * kGravity, from = 0.2, to = 0.6;
  const Vector3 along(std::cos(yaw), std::sin(yaw), 0);
  const RigidTransform X_WP(ExpRotation(Vector3(0, 0, 2 * yaw)), Vector3(1, -2, 0.3));
  const Motion motion{[&](double t) {
                        const double s = std::clamp(t - from, 0.0, to - from);
                        const double x = 0.5 * a * s * s + a * s * std::max(0.0, t - to);
                        return RigidTransform(X_WP.rotation(), Vector3(X_WP.translation() + x * along));
                      },
                      [&](double t) {
                        Vector6 V = Vector6::Zero();
                        V.tail<3>() = a * std::clamp(t - from, 0.0, to - from) * along;
                        return V;
                      }};
  const Vector3 at(0.2, 0.1, 0);
  World world = MustCreate(BoxOnPlate(X_WP, at, mass));
  Ride ride;
  const int steps = static_cast<int>(std::lround(0.8 / h));
  for (int i = 1; i <= steps; ++i) {
    Drive(world.mechanisms()[0], motion, i * h, rate);
    const StepReport report = world.Step(testing::TwoStage(h, testing::kDown));
    EXPECT_TRUE(report.finite && report.stages_converged) << i;
    ride.impacts += report.impact && i > 0.1 / h ? 1 : 0;
    const Vector3 on_plate =
        world.mechanisms()[0].state().X_WR.inverse() * world.free_bodies()[0].pose().translation();
    ride.slip = std::max(ride.slip, (on_plate - at).head<2>().norm());
    if (i * h > from + (rate == Rate::kKnown ? 3.5 : 9.5) * h && i * h < to + 0.5 * h)
      ride.force_error =
          std::max(ride.force_error, std::abs(ForceOnBox(world, h).dot(along) / (mass * a) - 1));
  }
  return ride;
}

TEST(DrivenBase, KnownRate_FrictionCarriesUpToItsLimit) {
  for (const double share : {0.28, 0.9})
    for (const double h : kSteps)
      for (const double yaw : {0.0, 2.3}) {
        SCOPED_TRACE(::testing::Message() << share << " of the limit, h = " << h << ", yaw " << yaw);
        const Ride ride = Accelerate(share, h, yaw, yaw > 0 ? 5 : 0.5, Rate::kKnown);
        EXPECT_LT(ride.slip, 2e-5);  // 15 mm where the twist was that of the chord
        EXPECT_LT(ride.force_error, 0.01);
        EXPECT_EQ(ride.impacts, 0);
      }
}

// The onset of the acceleration comes as a surprise: the rate lags by half a step and catches up in the next, where
// friction fails, and what has slipped comes to the speed of the plate in the steps after.
TEST(DrivenBase, EstimatedRate_FrictionCarriesAfterTheOnset) {
  for (const double share : {0.28, 0.9})
    for (const double h : kSteps) {
      SCOPED_TRACE(::testing::Message() << share << " of the limit, h = " << h);
      const Ride ride = Accelerate(share, h, 0.4, 1, Rate::kEstimated);
      EXPECT_LT(ride.slip, 2 * share * kFriction * kGravity * h * h);
      EXPECT_LT(ride.force_error, 0.01);
      EXPECT_EQ(ride.impacts, 0);
    }
}

// A plate that is shaken at 3 Hz, at 0.7 of what friction carries: what sticks to it goes where it goes. Rates whose mean
// is not that of the displacement moved it to and fro by h²/4 of the acceleration, where rates were estimated, and by
// h²/12 where they were known.
TEST(DrivenBase, SmoothShaking_BoxStaysOnItsSpot) {
  constexpr double kOmega = 2 * M_PI * 3, kFadeIn = 0.3;  // rad/s, s
  const double amplitude = 0.7 * kFriction * kGravity / (kOmega * kOmega);
  const Vector3 along = Vector3(2, 1, 0).normalized();
  const auto fade = [](double t) { return 1 - std::exp(-std::pow(t / kFadeIn, 3)); };
  const Motion motion{
      [&](double t) { return RigidTransform(Vector3(amplitude * std::sin(kOmega * t) * fade(t) * along)); },
      [&](double t) {
        const double fades = 3 * t * t / std::pow(kFadeIn, 3) * (1 - fade(t));
        Vector6 V = Vector6::Zero();
        V.tail<3>() =
            amplitude * (kOmega * std::cos(kOmega * t) * fade(t) + std::sin(kOmega * t) * fades) * along;
        return V;
      }};
  const auto slip_of = [&](Rate rate, StepOptions step) {
    World world = MustCreate(BoxOnPlate({}, Vector3::Zero(), 1));
    double slip = 0;
    for (int i = 1; i <= std::lround(2 / step.h); ++i) {
      Drive(world.mechanisms()[0], motion, i * step.h, rate);
      EXPECT_TRUE(world.Step(step).stages_converged);
      const Vector3 on_plate =
          world.mechanisms()[0].state().X_WR.inverse() * world.free_bodies()[0].pose().translation();
      slip = std::max(slip, on_plate.head<2>().norm());
    }
    return slip;
  };
  for (const Rate rate : {Rate::kKnown, Rate::kEstimated})
    for (const double h : {1.0 / 60, 1.0 / 120, 1.0 / 240}) {
      const double slip = slip_of(rate, testing::TwoStage(h, testing::kDown));
      // The quadrature of the two stages leaves 0.0101 h² of the acceleration; estimated rates are off by h³, and the
      // contact's tangential springs give way by 1 um/N.
      EXPECT_LT(slip, (rate == Rate::kKnown ? 0.0102 : 0.015) * 0.7 * kFriction * kGravity * h * h + 2e-6)
          << h;
      // By the rate at the end of the step it moved by h/2 of the speed.
      EXPECT_LT(slip_of(rate, testing::BackwardEuler(h, testing::kDown)), 4e-6) << h;
    }
}

// A tray that moves up and down with 0.6 g at most.
TEST(DrivenBase, VerticalMotion_BoxKeepsContactAndFeelsItsAcceleration) {
  const double omega = 7, height = 0.6 * kGravity / (omega * omega);
  const Motion motion{
      [&](double t) { return RigidTransform(Vector3(0, 0, height * (1 - std::cos(omega * t)))); },
      [&](double t) {
        Vector6 V = Vector6::Zero();
        V(5) = height * omega * std::sin(omega * t);
        return V;
      }};
  for (const Rate rate : {Rate::kKnown, Rate::kEstimated})
    for (const double h : kSteps) {
      SCOPED_TRACE(::testing::Message() << (rate == Rate::kKnown ? "known" : "estimated") << ", h = " << h);
      World world = MustCreate(BoxOnPlate({}, Vector3::Zero(), 1));
      double gap = 0, error = 0;
      int impacts = 0;
      for (int i = 1; i <= std::lround(2 / h); ++i) {
        Drive(world.mechanisms()[0], motion, i * h, rate);
        impacts += world.Step(testing::TwoStage(h, testing::kDown)).impact ? 1 : 0;
        if (i < 0.2 / h) continue;  // it starts with a jump of acceleration
        gap = std::max(gap, std::abs(world.free_bodies()[0].pose().translation().z() - 0.05 -
                                     world.mechanisms()[0].state().X_WR.translation().z()));
        const double a = height * omega * omega * std::cos(omega * (i - 0.5) * h);
        error = std::max(error, std::abs(ForceOnBox(world, h).z() - (kGravity + a)));
      }
      EXPECT_LT(gap, 1e-5 + h * h * h * 20) << gap;
      EXPECT_LT(error, 0.01 * kGravity + 2 * kGravity * omega * h * omega * h) << error;
      EXPECT_LE(impacts, 1);
    }
}

// Spins up to 1.5 rad/s with a box at 0.6 m, 0.4 of the limit at the most.
TEST(DrivenBase, TurntableSpinsUp_BoxKeepsItsPlace) {
  const double alpha = 1, until = 1.5;
  const auto angle = [&](double t) {
    const double s = std::min(t, until);
    return 0.5 * alpha * s * s + alpha * s * (t - s);
  };
  const Motion motion{
      [&](double t) { return RigidTransform(ExpRotation(Vector3(0, 0, angle(t))), Vector3(0, 0, 0)); },
      [&](double t) {
        Vector6 V = Vector6::Zero();
        V(2) = alpha * std::min(t, until);
        return V;
      }};
  for (const Rate rate : {Rate::kKnown, Rate::kEstimated})
    for (const double h : kSteps) {
      SCOPED_TRACE(::testing::Message() << (rate == Rate::kKnown ? "known" : "estimated") << ", h = " << h);
      const Vector3 at(0.6, 0, 0);
      World world = MustCreate(BoxOnPlate({}, at, 1));
      double slip = 0;
      for (int i = 1; i <= std::lround(2 / h); ++i) {
        Drive(world.mechanisms()[0], motion, i * h, rate);
        world.Step(testing::TwoStage(h, testing::kDown));
        const Vector3 on_plate =
            world.mechanisms()[0].state().X_WR.inverse() * world.free_bodies()[0].pose().translation();
        slip = std::max(slip, (on_plate - at).head<2>().norm());
      }
      EXPECT_LT(slip, 1e-4 + 4 * h * h);
    }
}

// A three-link arm on springs; its base goes to and fro and turns about an axis that is none of its own.
std::vector<double> EndOfSwing(const Motion& motion, double h, Rate rate) {
  MechanismDef arm = testing::Chain(3, 0.2, 0.5, 30, 0.1);
  arm.base = BaseKind::kDriven;
  arm.X_WR = motion.pose(0);
  World::Options options;
  options.reduction.modes = 100;
  World world = MustCreate(arm, options);
  for (int i = 1; i <= std::lround(1 / h); ++i) {
    Drive(world.mechanisms()[0], motion, i * h, rate);
    EXPECT_TRUE(world.Step(testing::TwoStage(h, testing::kDown)).stages_converged);
  }
  const VectorX& q = world.mechanisms()[0].configuration().q;
  return {q.data(), q.data() + q.size()};
}

TEST(DrivenBase, SmoothPath_ErrorFallsWithTheSquareOfTheStep) {
  const Vector3 axis = Vector3(0.3, 1, 0.2).normalized(), along(0.4, 0.1, 0.3);
  const auto s = [](double t) { return t * t * t * std::exp(-t); };
  const auto s_dot = [](double t) { return (3 - t) * t * t * std::exp(-t); };
  for (const bool turns : {false, true}) {
    const Motion motion{[&](double t) {
                          return RigidTransform(ExpRotation(Vector3((turns ? 3 : 0) * s(t) * axis)),
                                                Vector3(s(t) * along));
                        },
                        [&](double t) {
                          Vector6 V;
                          V << (turns ? 3 : 0) * s_dot(t) * axis, s_dot(t) * along;
                          return V;
                        }};
    const auto truth = EndOfSwing(motion, 1.0 / 7680, Rate::kKnown);
    for (const Rate rate : {Rate::kKnown, Rate::kEstimated}) {
      std::vector<double> errors;
      for (const double h : {1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 480}) {
        const auto q = EndOfSwing(motion, h, rate);
        double error = 0;
        for (std::size_t i = 0; i < q.size(); ++i) error = std::max(error, std::abs(q[i] - truth[i]));
        errors.push_back(error);
      }
      SCOPED_TRACE(::testing::Message()
                   << (turns ? "turns" : "slides") << (rate == Rate::kKnown ? ", known" : ", estimated"));
      EXPECT_GT(std::log2(errors.front() / errors.back()) / 3, 1.8)
          << errors[0] << " " << errors[1] << " " << errors[2] << " " << errors[3];
    }
  }
}

// The same joints on a base at 0.3 m/s as on one at rest.
TEST(DrivenBase, ConstantVelocity_JointsMoveAsAtRest) {
  MechanismDef arm = testing::Chain(3, 0.2, 0.5, 30, 0.1);
  arm.base = BaseKind::kDriven;
  const Vector3 velocity(0.2, -0.1, 0.2);
  const VectorX q0 = VectorX::LinSpaced(3, 0.3, -0.4), q_dot0 = VectorX::LinSpaced(3, -1, 2);
  for (const double h : kSteps) {
    Vector6 V = Vector6::Zero();
    V.tail<3>() = velocity;
    World rest = MustStart(arm, q0, q_dot0), moves = MustStart(arm, q0, q_dot0, V);
    for (int i = 1; i <= std::lround(1 / h); ++i) {
      moves.mechanisms()[0].DriveBase(RigidTransform(Vector3(i * h * velocity)));
      rest.Step(testing::TwoStage(h, testing::kDown));
      moves.Step(testing::TwoStage(h, testing::kDown));
    }
    EXPECT_LT((rest.mechanisms()[0].configuration().q - moves.mechanisms()[0].configuration().q).norm(), 1e-9)
        << h;
  }
}

// A base that moves and then stops at once: it is where it was told to be, and still, whatever it hits on the way.
TEST(DrivenBase, SuddenStop_DoesNotOvershoot) {
  MechanismDef arm = testing::Chain(1, 0.2, 0.5, 30, 0.1);
  arm.base = BaseKind::kDriven;
  World world = MustCreate(arm);
  MechanismDynamics& m = world.mechanisms()[0];
  const double h = 1.0 / 60;
  for (int i = 1; i <= 20; ++i) {
    m.DriveBase(RigidTransform(Vector3(0.01 * i, 0, 0)));
    world.Step(testing::TwoStage(h, testing::kDown));
  }
  const BasePath path = PathOfBase(
      [&] {
        MechanismState state;
        m.Save(state);
        return state;
      }(),
      h);
  for (const double share : {0.1, 0.3, 0.5, 0.7, 1.0}) {
    EXPECT_NEAR(path.PoseAt(share).translation().x(), 0.2, 1e-15) << share;
    EXPECT_EQ(path.RateAt(share).norm(), 0) << share;
  }
  world.Step(testing::TwoStage(h, testing::kDown));
  EXPECT_EQ(m.state().X_WR.translation().x(), 0.2);
  EXPECT_EQ(m.state().V_R.norm(), 0);
}

// A plate rises at constant acceleration with a box on it, and a ball lands beside the box at some time within a step,
// which is taken in parts. A part of backward Euler whose rate was not that of its displacement left the box closing on
// the plate by half of what the rate had changed in the part, which began the next step as an impact of its own.
TEST(DrivenBase, ImpactElsewhere_WhatIsCarriedKeepsToTheBase) {
  constexpr double h = 1.0 / 60, a = 3;
  for (const Rate rate : {Rate::kKnown, Rate::kEstimated})
    for (int k = 0; k < 16; ++k) {
      SCOPED_TRACE(::testing::Message()
                   << (rate == Rate::kKnown ? "known" : "estimated") << ", landing " << k);
      Scene scene = BoxOnPlate(RigidTransform(), Vector3(0.2, 0.1, 0), 1);
      scene.free_bodies.push_back(
          testing::BallBody("ball", 0.3, 0.05, Vector3(-0.5, 0, 0.2 + 0.003 * k), kFriction));
      World world = MustCreate(scene);
      const Motion rise{[](double t) { return RigidTransform(Vector3(0, 0, 0.5 * a * t * t)); },
                        [](double t) { return (Vector6() << 0, 0, 0, 0, 0, a * t).finished(); }};
      int landings = 0;
      for (int i = 1; i <= 30; ++i) {
        Drive(world.mechanisms()[0], rise, i * h, rate);
        const StepReport report = world.Step(testing::TwoStage(h, testing::kDown));
        if (i < 4) continue;  // of estimated rates the start comes as a surprise
        landings += report.impact ? 1 : 0;
        const auto is_ball = [&](int collision_body) {
          return world.collision_bodies()[static_cast<std::size_t>(collision_body)].name == "ball";
        };
        for (const ContactRecord& c : world.contacts())
          if (c.impulse(0) > 0 && !is_ball(c.point.body_a) && !is_ball(c.point.body_b)) {
            EXPECT_GT(c.end_speed, -1e-4)
                << i;  // m/s, a sixth of an impact: what material gives; before, 3e-3
          }
      }
      EXPECT_GE(landings, 1);
    }
}

TEST(DrivenBase, RestoredState_GivesTheSameBits) {
  const auto pose = [](double t) {
    return RigidTransform(ExpRotation(Vector3(0, 0, 0.3 * t * t)), Vector3(0.5 * t * t, 0, 0));
  };
  const double h = 1.0 / 60;
  World world = MustCreate(BoxOnPlate({}, Vector3::Zero(), 1));
  WorldState saved, end, again;
  const auto step = [&](int i) {
    if (i % 3 == 0)
      world.mechanisms()[0].DriveBase(pose(i * h), (Vector6() << 0, 0, 0.6 * i * h, i * h, 0, 0).finished());
    else
      world.mechanisms()[0].DriveBase(pose(i * h));
  };
  for (int i = 1; i <= 40; ++i) {
    step(i);
    if (i == 21) world.Save(saved);  // with an input that is known and not taken yet
    world.Step(testing::TwoStage(h, testing::kDown));
  }
  world.Save(end);
  World other = MustCreate(BoxOnPlate({}, Vector3::Zero(), 1));
  other.Restore(saved);
  std::swap(world, other);
  for (int i = 21; i <= 40; ++i) {
    if (i > 21) step(i);
    world.Step(testing::TwoStage(h, testing::kDown));
  }
  world.Save(again);
  EXPECT_EQ(HashOf(end, VectorX()), HashOf(again, VectorX()));
}

}  // namespace
}  // namespace fork1s::driven_base_test
