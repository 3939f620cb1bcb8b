// Moving the reference: nothing jumps, no energy appears.
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;

struct Jump {
  double pose = 0;      // m and rad, of interfaces and all other bodies
  double kinetic = 0;   // J gained
  double velocity = 0;  // of interfaces, as a share
};

Jump RefreshAfter(const MechanismDef& definition, int modes, int steps, unsigned seed) {
  RandomSource random(seed);
  const auto m = testing::Share(definition);
  World::Options options;
  options.reduction.modes = modes;
  Vector6 V = Vector6::Zero();
  if (definition.base == BaseKind::kFloating) V = random.Six(1);
  World world = MustStart(definition, VectorX::Zero(m->num_coordinates()),
                          random.Vector(m->num_coordinates(), 2), V, options);
  StepOptions step;
  step.refresh = false;
  for (int i = 0; i < steps; ++i) world.Step(step);
  MechanismDynamics& d = world.mechanisms()[0];
  std::vector<RigidTransform> before;
  std::vector<Vector6> velocity;
  for (int b = 0; b < m->num_bodies(); ++b) {
    before.push_back(d.BodyPose(BodyIndex(b)));
    velocity.push_back(d.BodyVelocity(BodyIndex(b)));
  }
  const double kinetic = d.KineticEnergy();
  EXPECT_TRUE(d.Refresh());
  Jump jump;
  jump.kinetic = (d.KineticEnergy() - kinetic) / kinetic;
  double fastest = 0;
  for (int b = 0; b < m->num_bodies(); ++b) {
    jump.pose = std::max(
        jump.pose, Log(before[static_cast<std::size_t>(b)].inverse() * d.BodyPose(BodyIndex(b))).norm());
    fastest = std::max(fastest, velocity[static_cast<std::size_t>(b)].norm());
  }
  for (BodyIndex b : d.model().interfaces)
    jump.velocity = std::max(jump.velocity, (d.BodyVelocity(b) - velocity[b.u()]).norm() / fastest);
  EXPECT_EQ(d.state().z.norm(), 0);
  return jump;
}

TEST(Refresh, NothingJumpsWhereNothingIsTruncated) {
  for (unsigned seed = 0; seed < 10; ++seed)
    for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating}) {
      SCOPED_TRACE(seed);
      RandomMechanismOptions options;
      options.base = base;
      if (seed % 2) options.rigid_closures = 1;
      const Jump jump = RefreshAfter(testing::RandomMechanismDef(seed, options), 100, 10, seed);
      EXPECT_LT(jump.pose, 1e-9);
      // Loops that stood open by 1e-10 are closed to rounding.
      EXPECT_LT(jump.kinetic, 1e-9);
    }
}

TEST(Refresh, NothingJumpsUnderTruncation) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 14;
    options.interfaces = 1;
    const Jump jump = RefreshAfter(testing::RandomMechanismDef(seed, options), 1, 10, seed);
    // The interior's static share is part of the new reference, so even it stays.
    EXPECT_LT(jump.pose, 1e-9);
    EXPECT_LT(jump.kinetic, 1e-12);
  }
}

// Trees and loops, fixed and floating, undamped, at random moments of a large motion.
TEST(Refresh, NeverAddsEnergyUnderTruncation) {
  int truncated = 0;
  for (unsigned seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 12;
    options.interfaces = 1;
    options.damping_ratio = 0;
    options.rigid_closures = static_cast<int>(seed % 2);
    options.base = seed % 4 < 2 ? BaseKind::kFixed : BaseKind::kFloating;
    const MechanismDef definition = testing::RandomMechanismDef(seed, options);
    const int n = testing::Share(definition)->num_coordinates();
    RandomSource random(seed);
    World::Options world_options;
    world_options.reduction.modes = 1;
    World world =
        MustStart(definition, VectorX::Zero(n), random.Vector(n, 8), Vector6::Zero(), world_options);
    MechanismDynamics& d = world.mechanisms()[0];
    truncated += d.model().has_complement ? 1 : 0;
    StepOptions step = testing::Still(2e-3);
    step.refresh = false;
    double kinetic = d.KineticEnergy();
    const auto energy = [&] { return d.KineticEnergy() + d.PotentialEnergy(Vector3::Zero()); };
    for (int i = 0; i < 60; ++i) {
      ASSERT_TRUE(world.Step(step).finite);
      kinetic = std::max(kinetic, d.KineticEnergy());
      if (random.Vector(1, 1)(0) < 0.5) continue;
      const double before = energy();
      ASSERT_TRUE(d.Refresh());
      EXPECT_LT(energy() - before, 1e-6 * kinetic) << i;
    }
  }
  EXPECT_GT(truncated, 12);
}

// The interior that is left out takes no load from how fast joint rates change: over a short step that would
// be large, feed on itself, and after a refresh hold what the new coordinates lack.
TEST(Refresh, ShortStepsGoWhereLongerOnesGo) {
  int kept_apart = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    RandomMechanismOptions options;
    options.bodies = 12;
    options.rigid_closures = 1;
    options.interfaces = 1;
    const MechanismDef definition = testing::RandomMechanismDef(seed, options);
    const auto m = testing::Share(definition);
    World::Options world_options;
    world_options.reduction.modes = 1;
    bool has_interior = false;
    const auto end = [&](int steps) {
      RandomSource random(seed);
      World world = MustStart(definition, VectorX::Zero(m->num_coordinates()),
                              random.Vector(m->num_coordinates(), 2), Vector6::Zero(), world_options);
      StepOptions step = testing::Still(4e-3 / steps);
      step.refresh = false;
      MechanismDynamics& d = world.mechanisms()[0];
      has_interior = d.model().has_complement && d.model().loop_rank() > 0;
      for (int i = 0; i < steps; ++i) {
        if (i == steps / 2) {
          EXPECT_TRUE(d.Refresh());
        }
        world.Step(step);
      }
      return d.configuration().q;
    };
    const VectorX fine = end(400), coarse = end(200);
    if (!has_interior) continue;
    // Of first order, and the way of interiors that are nearly free is long: one of twenty comes to 1 %.
    EXPECT_LT((fine - coarse).norm(), 0.05 * coarse.norm()) << seed;
    ++kept_apart;
  }
  EXPECT_GT(kept_apart, 5);
}

// From a restored moment it is taken to the same bits, and closes loops further than steps do.
TEST(Refresh, ClosesLoopsToRoundingAndRepeatsItself) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.rigid_closures = 2;
    options.couplings = static_cast<int>(seed % 2);
    options.base = seed % 3 == 0 ? BaseKind::kFloating : BaseKind::kFixed;
    const MechanismDef definition = testing::RandomMechanismDef(seed, options);
    const int n = testing::Share(definition)->num_coordinates();
    World world =
        MustStart(definition, VectorX::Zero(n), RandomSource(seed).Vector(n, 3), Vector6::Zero(), {});
    StepOptions step;
    step.refresh = false;
    for (int i = 0; i < 10; ++i) world.Step(step);
    WorldState moment;
    world.Save(moment);
    std::vector<VectorX> ends;
    for (int run = 0; run < 2; ++run) {
      MechanismDynamics& d = world.mechanisms()[0];
      ASSERT_TRUE(d.Refresh());
      const Mechanism& m = d.mechanism();
      Kinematics kinematics(m);
      ComputeKinematics(m, d.model().q_ref, kinematics);
      EXPECT_LT(ClosureGap(m, kinematics, d.model().q_ref), 1e-12 * m.length_scale());
      for (int i = 0; i < 10; ++i) world.Step(step);
      ends.push_back(d.configuration().q);
      world.Restore(moment);
    }
    EXPECT_EQ(ends[0], ends[1]);
  }
}

TEST(Refresh, StepsAfterItMoveOn) {
  // A chain that falls through 60 degrees and more: poses go on from step to step at no more than the speed.
  MechanismDef definition = testing::Chain(8, 0.1, 0.2, 0.8, 0.02, true);
  definition.modes = 1;
  World world = testing::MustCreate(definition);
  StepOptions step;
  step.gravity = Vector3(0, -9.81, 0);
  const MechanismDynamics& chain = world.mechanisms()[0];
  const BodyIndex tip = chain.mechanism().FindBody("tip");
  Vector3 before = chain.BodyPose(tip).translation();
  for (int i = 0; i < 240; ++i) {
    const double speed = chain.BodyVelocity(tip).tail<3>().norm();
    const StepReport report = world.Step(step);
    ASSERT_TRUE(report.finite);
    ASSERT_EQ(report.failed_refreshes, 0);
    if (i % 10 == 5) {
      ASSERT_TRUE(world.mechanisms()[0].Refresh());
    }
    const Vector3 now = chain.BodyPose(tip).translation();
    const double next = chain.BodyVelocity(tip).tail<3>().norm();
    // Half as much again as the faster end, and what gravity may add within a step.
    ASSERT_LT((now - before).norm(), 1.5 * step.h * std::max(speed, next) + 0.01) << i;
    before = now;
  }
}

// A blade on a soft hinge, on a hub that is driven faster and faster: it trails, through one reference after
// another, as fourth-order Runge and Kutta find it. Momentum that the hub's own motion gives the blade is none of
// its rates: taken for theirs, each new reference would change them.
TEST(Refresh, TakesNothingFromWhatADrivenBaseCarries) {
  constexpr double R = 0.12, r = 0.17, m = 0.35, I = 1.5e-3, k = 0.5, d = 2e-3, faster = 9, T = 1.2;
  MechanismBuilder builder("rotor", BaseKind::kDriven, testing::Ball(1, 0.05));
  BodyDef blade;
  blade.name = "blade";
  blade.parent = builder.base();
  blade.X_PB = RigidTransform(Vector3(R, 0, 0));
  blade.inertia.mass = m;
  blade.inertia.center = Vector3(r, 0, 0);
  blade.inertia.rotational = I * Matrix3::Identity();
  const BodyIndex b = builder.AddBody(blade);
  builder.AddJoint(JointDef::Hinge("hinge", b, Vector3::UnitZ()).WithSpring(k, d));
  builder.SetInterfaces({"blade"});

  const auto turn = [&](double t) { return 0.5 * faster * t * t; };
  const auto rates = [&](double t, const Vector2& x) {
    const double spin = faster * t;
    const double carried = m * r * R * (faster * std::cos(x(0)) + spin * spin * std::sin(x(0))),
                 moment = carried + k * x(0) + d * x(1);
    return Vector2(x(1), -faster - moment / (I + m * r * r));
  };
  constexpr int kFine = 9600;
  std::vector<Vector2> path = {Vector2::Zero()};
  for (int i = 0; i < kFine; ++i) {
    constexpr double s = T / kFine;
    const double t = i * s;
    const Vector2 x = path.back(), r1 = rates(t, x), r2 = rates(t + s / 2, x + s / 2 * r1),
                  r3 = rates(t + s / 2, x + s / 2 * r2), r4 = rates(t + s, x + s * r3);
    path.push_back(x + s / 6 * (r1 + 2 * r2 + 2 * r3 + r4));
  }
  EXPECT_LT(path.back()(0), -0.3);  // rad, past where the first reference serves
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    const bool second = integrator == Integrator::kTwoStage;
    SCOPED_TRACE(second ? "two stages" : "euler");
    double before = 0;
    for (const int steps : {240, 480, 960}) {
      World world = testing::MustCreate(builder.definition());
      MechanismDynamics& rotor = world.mechanisms()[0];
      StepOptions step = testing::Still(T / steps);
      step.integrator = integrator;
      double error = 0;
      int refreshes = 0;
      for (int i = 1; i <= steps; ++i) {
        rotor.DriveBase(RigidTransform(ExpRotation(Vector3(0, 0, turn(i * step.h))), Vector3::Zero()));
        refreshes += world.Step(step).refreshes;
        // What has all its motions needs none by implicit Euler, but may be given one.
        if (i % 40 == 0) refreshes += rotor.Refresh() ? 1 : 0;
        const double truth = path[static_cast<std::size_t>(i * (kFine / steps))](0);
        error = std::max(error, std::abs(rotor.configuration().q(0) - truth));
      }
      EXPECT_GE(refreshes, steps / 40);
      if (before > 0) {
        EXPECT_GT(before / error, second ? 3.8 : 1.85) << steps;  // of first and of second order
      }
      before = error;
    }
    EXPECT_LT(before, second ? 1e-5 : 0.03);  // rad
  }
}

// A trailing arm on a spring, with a wheel or a crank at its end. The spring stiffens, so that the arm ages
// the model although it has all their motions.
MechanismDef TrailingArm(double off_axis, bool rod) {
  MechanismBuilder builder("arm");
  BodyDef arm;
  arm.name = "arm";
  arm.parent = builder.base();
  arm.inertia.mass = 1;
  arm.inertia.center = Vector3(0.2, 0, 0);
  arm.inertia.rotational = Vector3(1e-3, 0.02, 0.02).asDiagonal();
  const BodyIndex a = builder.AddBody(arm);
  const JointIndex swing = builder.AddJoint(JointDef::Hinge("swing", a, Vector3::UnitY()).WithSpring(60, 2));
  SpringDef stiffens;
  stiffens.name = "stop";
  stiffens.terms = {{{swing, 0}, 1.0}};
  stiffens.higher_stiffness = {0, 5};
  builder.AddSpring(stiffens);
  BodyDef wheel;
  wheel.name = "wheel";
  wheel.parent = a;
  wheel.X_PB = RigidTransform(Vector3(0.4, 0, 0));
  wheel.inertia.mass = 2;
  wheel.inertia.center = Vector3(off_axis, 0, 0);
  wheel.inertia.rotational = Vector3(0.01, 0.02, 0.01).asDiagonal();
  const BodyIndex w = builder.AddBody(wheel);
  builder.AddJoint(JointDef::Hinge("spin", w, Vector3::UnitY()));
  std::vector<std::string> interfaces{"wheel"};
  if (rod) {
    BodyDef on_it;
    on_it.name = "rod";
    on_it.parent = w;
    on_it.X_PB = RigidTransform(Vector3(0.1, 0, 0));
    on_it.inertia.mass = 0.1;
    on_it.inertia.rotational = Vector3::Constant(1e-4).asDiagonal();
    const BodyIndex r = builder.AddBody(on_it);
    builder.AddJoint(JointDef::Hinge("pin", r, Vector3::UnitX()).WithSpring(5));
    interfaces.push_back("rod");
  }
  builder.SetInterfaces(interfaces);
  return builder.definition();
}

int RefreshesIn(World& world, int steps) {
  int refreshes = 0;
  for (int i = 0; i < steps; ++i)
    refreshes += world.Step(testing::BackwardEuler(1.0 / 60, testing::kDown)).refreshes;
  return refreshes;
}

// Its spin is not seen by anything else, so the model stays as good as one that is made again all the time.
TEST(Refresh, AWheelMaySpinForEver) {
  const VectorX q = VectorX::Zero(2), q_dot = (VectorX(2) << 0.5, 30).finished();
  World::Options often;
  often.refresh_angle = 1e-9;
  // Unbalanced or not: inertia is that of the pose.
  for (const double off_axis : {0.0, 3e-4, 5e-3}) {
    World rarely = MustStart(TrailingArm(off_axis, false), q, q_dot),
          always = MustStart(TrailingArm(off_axis, false), q, q_dot, Vector6::Zero(), often);
    EXPECT_EQ(RefreshesIn(rarely, 300), 0) << off_axis;
    EXPECT_GT(RefreshesIn(always, 300), 200) << off_axis;  // until the arm is at rest
    const VectorX &a = rarely.mechanisms()[0].configuration().q,
                  &b = always.mechanisms()[0].configuration().q;
    EXPECT_GT(std::abs(a(1)), 100);
    // Rounding of as many refreshes.
    EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-9 * a.norm()) << off_axis;
  }
}

TEST(Refresh, AWheelThatCarriesMoreAgesTheModel) {
  const VectorX q_dot = (VectorX(2) << 0, 30).finished();
  World carries = MustStart(TrailingArm(0, true), VectorX::Zero(3), (VectorX(3) << 0, 30, 0).finished());
  EXPECT_GT(RefreshesIn(carries, 60), 30);
  World::Options by_twist;
  by_twist.recovery = Recovery::kTwist;
  World twist = MustStart(TrailingArm(0, false), VectorX::Zero(2), q_dot, Vector6::Zero(), by_twist);
  EXPECT_GT(RefreshesIn(twist, 60), 30) << "a pose by one twist grows old as the wheel turns";
}

struct TurnOfJoint {
  VectorX q;  // at rest
  int refreshes = 0, truncated = 0;
};

// A chain of eight without weight, of which one soft joint swings by 2 rad to the rest of its spring.
TurnOfJoint RestAfterTurnOf(std::size_t joint, int modes) {
  MechanismDef chain = testing::Chain(8, 0.05, 0.05, 50, 0.5);
  FreedomDef& soft = chain.joints[joint].freedoms[0];
  soft.stiffness = 0.5;
  soft.damping = joint == 0 ? 0.2 : 0.02;
  soft.rest = 2;
  chain.modes = modes;
  World world = testing::MustCreate(chain);
  TurnOfJoint turned;
  turned.truncated = world.mechanisms()[0].model().has_complement;
  for (int i = 0; i < 900; ++i) {
    const StepReport report = world.Step(testing::TwoStage(1.0 / 60));
    EXPECT_TRUE(report.finite);
    turned.refreshes += report.refreshes_by_cause[static_cast<std::size_t>(DriftCause::kTurnedJoint)].count;
  }
  turned.q = world.mechanisms()[0].configuration().q;
  return turned;
}

TEST(Refresh, JointsThatLeaveTheReductionAsItIsDoNotCount) {
  for (const std::size_t joint : {0, 4, 7}) {
    SCOPED_TRACE(joint);
    const TurnOfJoint few = RestAfterTurnOf(joint, 0), all = RestAfterTurnOf(joint, 8);
    EXPECT_EQ(few.truncated, 1);
    EXPECT_EQ(few.refreshes > 0, joint == 4);
    EXPECT_NEAR(few.q(static_cast<Eigen::Index>(joint)), 2, 1e-3);
    EXPECT_LT((few.q - all.q).cwiseAbs().maxCoeff(), 1e-9);
  }
}

// Coordinates of which none was left out are the same motions at any reference, so nothing is gained by a new
// one: a tree that never has one moves as one that has it all the time.
TEST(Refresh, WhatIsWholeDoesNotAge) {
  World::Options often;
  often.refresh_angle = 0.02;
  // Two stages start from a prediction that a refresh forgets, and end within their tolerance of each other.
  const StepOptions step = testing::BackwardEuler(1.0 / 60, testing::kDown);
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
    for (unsigned seed = 0; seed < 6; ++seed) {
      SCOPED_TRACE(seed);
      RandomMechanismOptions options;
      options.base = base;
      options.bodies = 5;
      options.hinges_only = true;
      options.stiffness_low = 0.1;
      options.stiffness_high = 1;
      MechanismDef definition = testing::RandomMechanismDef(seed, options);
      definition.modes = 100;
      const auto m = testing::Share(definition);
      RandomSource random(seed);
      const VectorX q_dot = random.Vector(m->num_coordinates(), 6);
      const Vector6 V = base == BaseKind::kFloating ? random.Six(1) : Vector6(Vector6::Zero());
      const auto start = [&](const World::Options& as) {
        return MustStart(definition, VectorX::Zero(m->num_coordinates()), q_dot, V, as);
      };
      World never = start({}), always = start(often);
      ASSERT_EQ(never.mechanisms()[0].model().size(), m->num_coordinates());
      double turned = 0;
      int refreshes = 0;
      for (int i = 0; i < 120; ++i) {
        ASSERT_EQ(never.Step(step).refreshes, 0) << i;
        always.Step(step);
        refreshes += always.mechanisms()[0].Refresh() ? 1 : 0;
        turned = std::max(turned, never.mechanisms()[0].configuration().q.cwiseAbs().maxCoeff());
      }
      EXPECT_EQ(refreshes, 120);
      EXPECT_GT(turned, 0.5);
      const VectorX &a = never.mechanisms()[0].configuration().q,
                    &b = always.mechanisms()[0].configuration().q;
      // Rounding of 120 refreshes, which a motion of a radian and more carries on.
      EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-9) << "after turns of " << turned;
    }
}

}  // namespace
}  // namespace fork1s
