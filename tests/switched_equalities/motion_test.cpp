// What is held and let go moves as closed forms say.
#include <fork1s/sim/sensors.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <tuple>

#include "support.hpp"

namespace fork1s::switched_equalities_test {
namespace {

TEST(SwitchedEquality, WeldedBox_HangsWithItsWeightAndFallsFreelyWhereItIsLetGo) {
  for (const double size : kSizes)
    for (const Quaternion& turn : kTurns)
      for (const int order : {0, 1, 2, 3}) {
        SCOPED_TRACE(fmt::format("size {}, turned {}, order {}", size, turn.w() != 1, order));
        Arm arm;
        arm.size = size;
        arm.turn = turn;
        arm.box_first = order % 2 == 1;
        arm.swap_bodies = order / 2 == 1;
        Simulation s = MustStart(arm.Text(), 1. / 240);
        const Vector3 start = Place(s, "box");
        s.SetControl("grab", 1);
        RunUntil(s, 0.5);
        EXPECT_LT((Place(s, "box") - start).norm(), 1e-5 * size);
        // On the free body, whichever of both the file names first.
        EXPECT_LT((arm.In(Force(s)) - Vector3(0, 0, arm.mass * kGravity)).norm(), 1e-5 * arm.mass * kGravity);
        s.SetControl("grab", 0);
        const Vector3 from = Place(s, "box");
        RunUntil(s, 0.75);
        const Vector3 fallen = arm.In(Place(s, "box") - from);
        EXPECT_NEAR(fallen.z(), -0.5 * kGravity * 0.25 * 0.25, 1e-6 * kGravity);
        EXPECT_LT(fallen.head<2>().norm(), 1e-6 * size);
        EXPECT_EQ(Force(s).norm(), 0);
      }
}

TEST(SwitchedEquality, ThatStartsOn_HoldsItsLoadUntilAControlTrackReleasesIt) {
  for (const double size : kSizes)
    for (const Quaternion& turn : kTurns)
      for (const int order : {0, 1, 2, 3}) {
        SCOPED_TRACE(fmt::format("size {}, turned {}, order {}", size, turn.w() != 1, order));
        Arm arm = ArmThatHolds();
        arm.size = size;
        arm.turn = turn;
        arm.box_first = order % 2 == 1;
        arm.swap_bodies = order / 2 == 1;
        Simulation s = MustStart(arm.Text(), 1. / 240);
        const Vector3 start = Place(s, "box");
        const ControlTrack track = ReleaseAt(0.5);
        track.Start(s);
        const auto run_until = [&](double until) {
          while (s.time() < until - 1e-9) {
            track.Apply(s.time() + s.dt(), s);
            ASSERT_TRUE(s.Step(true).IsSolved()) << s.time();
            // The servo sinks by 1e-6 of its length, and its arm and box start from rest above that.
            if (s.time() < 0.5 + 1e-9) {
              ASSERT_LT((Place(s, "box") - start).norm(), 1e-5 * size) << s.time();
            }
          }
        };
        run_until(0.5);
        // After 0.5 s what the servo's motion to its rest, a share of 1e-6, adds to the weight has died away.
        EXPECT_LT((arm.In(Force(s)) - Vector3(0, 0, arm.mass * kGravity)).norm(), 1e-5 * arm.mass * kGravity);
        const Vector3 from = Place(s, "box");
        run_until(0.75);
        // Both stages are exact for constant accelerations; its velocity where it is let go is that of the sinking servo,
        // below 1e-6 of the weight's over a step.
        const Vector3 fallen = arm.In(Place(s, "box") - from);
        EXPECT_NEAR(fallen.z(), -0.5 * kGravity * 0.25 * 0.25, 1e-6 * kGravity);
        EXPECT_LT(fallen.head<2>().norm(), 1e-6 * size);
        EXPECT_EQ(Force(s).norm(), 0);
      }
}

// Welds to the world that are no switches make a free body a fixed one.
TEST(SwitchedEquality, ThatStartsOnBetweenTheWorldAndFreeBodies_ReleasesThem) {
  for (const char* equality :
       {"<weld name='grab' body1='box'/>", "<weld name='grab' body1='world' body2='box'/>",
        "<connect name='grab' body1='box' anchor='0 0 .5'/>",
        "<weld name='grab' body1='box' body2='other'/><weld name='fixed' body1='other'/>"}) {
    SCOPED_TRACE(equality);
    Simulation s = MustStart(
        std::string("<mujoco><custom><text name='fork1s_switched' data='grab'/></custom><worldbody><body "
                    "name='box'><freejoint/><geom type='box' size='.1 .1 .1' mass='3'/></body><body "
                    "name='other' pos='0 5 0'><freejoint/><geom size='.1' mass='1'/></body></worldbody>"
                    "<equality>") +
            equality + "</equality></mujoco>",
        1. / 240);
    RunUntil(s, 0.5);
    // Held exactly; the mass of the body, 3 kg, is the load.
    EXPECT_LT(Place(s, "box").norm(), 1e-9);
    EXPECT_NEAR(Force(s).norm(), 3 * kGravity, 1e-9 * 3 * kGravity);
    s.SetControl("grab", 0);
    RunUntil(s, 0.75);
    // Both stages are exact for constant accelerations.
    EXPECT_NEAR(Place(s, "box").z(), -0.5 * kGravity * 0.25 * 0.25, 1e-9);
  }
}

// A box on a connect to the world is a compound pendulum: θ'' = -m g L sin θ / (I + m L²), here by Runge and Kutta.
struct Pendulum {
  double angle = 1, rate = 0, stiffness = 0;  // rad, rad/s, 1/s²

  double Acceleration(double q) const { return -stiffness * std::sin(q); }
  void Advance(double time) {
    constexpr int kSteps = 2000;
    const double h = time / kSteps;
    for (int k = 0; k < kSteps; ++k) {
      const double a1 = Acceleration(angle), r2 = rate + h / 2 * a1, a2 = Acceleration(angle + h / 2 * rate),
                   r3 = rate + h / 2 * a2, a3 = Acceleration(angle + h / 2 * r2), r4 = rate + h * a3,
                   a4 = Acceleration(angle + h * r3);
      angle += h / 6 * (rate + 2 * r2 + 2 * r3 + r4);
      rate += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
  }
};

// A box, its connect to a point of the world above it, and a second free one that has no part in it.
std::string PendulumText(double angle, bool world_first) {
  const double L = 0.5, s = std::sin(angle), c = std::cos(angle);
  return fmt::format(
      "<mujoco><worldbody><body name='bob' pos='{:.17g} 0 {:.17g}'><freejoint/><geom type='box' size='.05 .08 .1' "
      "mass='1.5'/></body><body name='other' pos='0 5 0'><freejoint/><geom size='.1' mass='1'/></body></worldbody>"
      "<equality><connect name='pin' {} anchor='{:.17g} 0 {:.17g}' active='false'/></equality></mujoco>",
      L * s, -L * c, world_first ? "body1='world' body2='bob'" : "body1='bob'", world_first ? 0.0 : -L * s,
      world_first ? 0.0 : L * c);
}

TEST(SwitchedEquality, ConnectToTheWorld_SwingsAsACompoundPendulum) {
  const double L = 0.5, m = 1.5, I = m / 3 * (0.05 * 0.05 + 0.1 * 0.1), start = 1,
               fastest = std::sqrt(2 * kGravity / L * (1 - std::cos(start)));
  for (const bool world_first : {false, true}) {
    double before = 0;
    for (const double dt : {1. / 120, 1. / 240, 1. / 480}) {
      SCOPED_TRACE(fmt::format("world first {}, step {}", world_first, dt));
      Pendulum expected;
      expected.angle = start;
      expected.stiffness = m * kGravity * L / (I + m * L * L);
      Simulation s = MustStart(PendulumText(start, world_first), dt);
      s.SetControl("pin", 1);
      double off = 0, gap = 0;
      for (int k = 0; k < 10; ++k) {
        RunUntil(s, 0.1 * (k + 1));
        expected.Advance(0.1);
        const Vector3 p = Place(s, "bob");
        const double angle = std::atan2(p.x(), -p.z());
        off = std::max(off, std::abs(angle - expected.angle));
        // The pin in the frame of the bob stays where it was.
        const RigidTransform X = s.Pose("bob");
        gap = std::max(gap, (X * Vector3(-L * std::sin(start), 0, L * std::cos(start))).norm());
        EXPECT_NEAR(p.norm(), L, 1e-4);
        // m (g - a) on the world, at the middle of the last step.
        Pendulum middle = expected;
        middle.Advance(-dt / 2);
        const Vector3 bar(std::sin(middle.angle), 0, -std::cos(middle.angle)),
            across(std::cos(middle.angle), 0, std::sin(middle.angle)),
            acceleration = L * (middle.Acceleration(middle.angle) * across - middle.rate * middle.rate * bar);
        EXPECT_LT((Force(s) - m * (Vector3(0, 0, -kGravity) - acceleration)).norm(), 0.01 * m * kGravity)
            << k;
      }
      EXPECT_LT(gap, L * std::pow(fastest * dt, 2));
      // Of second order.
      if (before > 0) {
        EXPECT_NEAR(before / off, 4, 0.5);
      }
      before = off;
    }
  }
}

// Two free boxes without gravity, at any pose to each other.
std::string Pair(double size, const std::string& more = "") {
  return fmt::format(
      "<mujoco><option gravity='0 0 0'/><worldbody><body name='a' pos='{0} 0 0'><freejoint/><geom type='box' "
      "size='{0} {1} {2}' mass='2'/></body><body name='b' pos='{3} {2} 0' euler='20 30 40'><freejoint/><geom "
      "type='box' size='{2} {0} {1}' mass='1'/></body></worldbody><equality><weld name='dock' body1='a' body2='b' "
      "active='false'/>{4}</equality></mujoco>",
      0.1 * size, 0.2 * size, 0.15 * size, -0.5 * size, more);
}

struct Momentum {
  Vector3 linear = Vector3::Zero(), angular = Vector3::Zero();  // about the origin
  Matrix3 inertia = Matrix3::Zero();                            // likewise
  Vector3 first = Vector3::Zero();                              // Σ m c
  double mass = 0, energy = 0;
};
// From inertias of boxes and not from those of the program.
Momentum MomentumOfPair(const Simulation& s, double size) {
  Momentum sum;
  for (const auto& [name, mass, half] :
       {std::tuple("a", 2.0, Vector3(0.1, 0.2, 0.15)), std::tuple("b", 1.0, Vector3(0.15, 0.1, 0.2))}) {
    const RigidTransform X = s.Pose(name);
    const Vector6 V = s.Velocity(s.FindBody(name));
    const Vector3 squares = size * size * half.cwiseAbs2(), c = X.translation(), w = V.head<3>(),
                  v = V.tail<3>();
    const Matrix3 I = X.rotation() *
                      Matrix3((mass / 3 * (Vector3::Constant(squares.sum()) - squares)).asDiagonal()) *
                      X.rotation().transpose();
    sum.linear += mass * v;
    sum.angular += I * w + c.cross(mass * v);
    sum.inertia += I + mass * (c.squaredNorm() * Matrix3::Identity() - c * c.transpose());
    sum.first += mass * c;
    sum.mass += mass;
    sum.energy += 0.5 * (mass * v.squaredNorm() + w.dot(I * w));
  }
  return sum;
}

// Momenta stay, and the turn is that of one rigid body: ω = I⁻¹ L about the common centre.
TEST(SwitchedEquality, DockingOfTwoFreeBodies_KeepsMomentaAndTurnsThemAsOne) {
  for (const double size : kSizes) {
    SCOPED_TRACE(size);
    ImportedScene loaded = MustLoad(Pair(size));
    SimulationOptions options;
    options.dt = 1. / 240;
    auto created = Simulation::Create(loaded.scene, options);
    ASSERT_TRUE(created) << created.error().Text();
    Simulation& s = *created;
    // A push of one step gives them velocities.
    const auto push = [&](const char* name, const Vector3& force, const Vector3& moment) {
      s.ApplyWrench(s.FindBody(name), size * force, size * size * moment, Place(s, name));
    };
    push("a", Vector3(30, 20, -10), Vector3(2, -3, 4));
    push("b", Vector3(-20, 30, 15), Vector3(-1, 1, 0.5));
    RunUntil(s, 1. / 240);
    const Momentum before = MomentumOfPair(s, size);
    s.SetControl("dock", 1);
    RunUntil(s, 2. / 240);
    for (int k = 0; k < 120; ++k) {
      const Momentum m = MomentumOfPair(s, size);
      const Vector3 c = m.first / m.mass;
      const Matrix3 I = m.inertia - m.mass * (c.squaredNorm() * Matrix3::Identity() - c * c.transpose());
      const Vector3 L = m.angular - c.cross(m.linear), w = I.inverse() * L;
      const double scale = before.linear.norm();
      EXPECT_LT((m.linear - before.linear).norm(), 1e-7 * scale);
      // The first is a mechanism, whose rotation about a reference is of the order of the step.
      EXPECT_LT((m.angular - before.angular).norm(), 1e-4 * size * scale) << k;
      // The step before took them from the pose of the file, which they are brought back to: by exp(-20) after 0.4 s.
      for (const char* name : {"a", "b"})
        if (k >= 96) {
          EXPECT_LT((s.Velocity(s.FindBody(name)).head<3>() - w).norm(), 1e-3 * w.norm()) << k;
        }
      if (k >= 96) {
        EXPECT_LT(m.energy, before.energy);
      }
      s.Step();
    }
  }
}

// The box has fallen from its pose under the arm; switched on, the gap of its weld falls by exp(-t/T).
TEST(SwitchedEquality, OffsetWhereItIsSwitchedOn_IsClosedByItsTimeConstantAndCalm) {
  for (const double T : {0.02, 0.1})
    for (const double size : kSizes) {
      SCOPED_TRACE(fmt::format("T {}, size {}", T, size));
      Arm arm;
      arm.size = size;
      arm.equality = "<weld name='grab' {} active='false' " + fmt::format("solref='{} 1'/>", T);
      Simulation s = MustStart(arm.Text(), 1. / 240);
      const Vector3 held = s.Pose("arm").inverse() * Place(s, "box");
      const auto gap = [&] { return (Place(s, "box") - s.Pose("arm") * held).norm(); };
      RunUntil(s, 12. / 240);
      const double offset = gap(), at = s.time();
      ASSERT_GT(offset, 0.01);
      s.SetControl("grab", 1);
      double largest = 0;
      for (int k = 0; k < 240; ++k) {
        s.Step();
        const double expected = offset * std::exp(-(s.time() - at) / T);
        EXPECT_NEAR(gap(), expected, 1e-3 * offset) << k;
        largest = std::max(largest, Force(s).norm());
      }
      EXPECT_LT((Force(s) - Vector3(0, 0, arm.mass * kGravity)).norm(), 1e-3 * arm.mass * kGravity);
      // What the first step gives the box is the velocity with which it is drawn up, and what stops its fall.
      const double fall = kGravity * 12. / 240;
      EXPECT_LT(largest, 1.1 * arm.mass * (240 * (offset / T + fall) + kGravity));
    }
}

// A weld and a connect of the same bodies say the same twice.
TEST(SwitchedEquality, TwoThatSayTheSame_BearTheWeightTogether) {
  Arm arm;
  arm.equality =
      "<weld name='grab' {0} active='false'/><connect name='pin' {0} anchor='.1 .2 .3' active='false'/>";
  Simulation s = MustStart(arm.Text(), 1. / 240);
  const Vector3 start = Place(s, "box");
  s.SetControl("grab", 1);
  s.SetControl("pin", 1);
  RunUntil(s, 0.5);
  EXPECT_LT((Place(s, "box") - start).norm(), 1e-5);
  EXPECT_LT((Force(s, 0) + Force(s, 1) - Vector3(0, 0, arm.mass * kGravity)).norm(), 1e-4 * kGravity);
  s.SetControl("grab", 0);
  RunUntil(s, 0.6);
  EXPECT_LT((Force(s, 1) - Vector3(0, 0, arm.mass * kGravity)).norm(), 20.0);
  EXPECT_EQ(Force(s, 0).norm(), 0);
}

// A chain of three crates that welds join stands on the floor by its last one: contact bears all of the weight.
TEST(SwitchedEquality, ChainOfCratesOnTheFloor_StandsAsOneBody) {
  std::string crates, welds;
  for (int k = 0; k < 3; ++k)
    crates += fmt::format(
        "<body name='crate{}' pos='{} 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' mass='3' {}/></body>",
        k, 0.2 * k, k == 1 ? "contype='0' conaffinity='0'" : "friction='.8'");
  for (int k = 0; k < 2; ++k)
    welds += fmt::format("<weld name='hook{0}' body1='crate{0}' body2='crate{1}' active='false'/>", k, k + 1);
  Simulation s = MustStart("<mujoco><worldbody><geom type='plane' size='5 5 1' friction='.8'/>" + crates +
                               "</worldbody><equality>" + welds + "</equality></mujoco>",
                           1. / 240);
  s.SetControl("hook0", 1);
  s.SetControl("hook1", 1);
  const Vector3 start = Place(s, "crate1");
  RunUntil(s, 1);
  EXPECT_LT((Place(s, "crate1") - start).norm(), 1e-4);
  double normal = 0;
  for (const ContactRecord& c : s.world().contacts())
    normal += std::abs((c.point.frame.transpose() * c.impulse).z()) / s.dt();
  EXPECT_NEAR(normal, 9 * kGravity, 1e-4 * 9 * kGravity);
  // Half of the middle crate on either side, by symmetry.
  for (const std::size_t weld : {0u, 1u})
    EXPECT_NEAR(std::abs(Force(s, weld).z()), 1.5 * kGravity, 1e-3 * 9 * kGravity);
}

// A servo that can give no more is a row beside those of the weld: the arm sinks with the box, by
// I θ'' = (m_arm/2 + m_box) g L - τ about its hinge, L = 1 m.
TEST(SwitchedEquality, BoxOnAnArmWhoseServoIsAtItsBound_SinksWithIt) {
  const double mass = 2, tau = 10, dt = 1. / 1000;
  Simulation s = MustStart(
      fmt::format(
          "<mujoco><worldbody><body name='arm'><joint name='shoulder' axis='0 1 0'/><geom type='box' pos='.5 0 "
          "0' size='.5 .01 .01' mass='1' contype='0' conaffinity='0'/></body><body name='box' pos='1 0 "
          "0'><freejoint/><geom type='sphere' size='.05' mass='{}'/></body></worldbody><actuator><position "
          "name='servo' joint='shoulder' kp='1e4' kv='10' forcerange='-{} {}'/></actuator><equality><weld "
          "name='grab' body1='arm' body2='box' active='false'/></equality></mujoco>",
          mass, tau, tau),
      dt);
  s.SetControl("grab", 1);
  // By then the deflection is beyond the servo's range of 1e-3 rad, and 2e-3 rad.
  RunUntil(s, 0.021);
  EXPECT_EQ(s.Step().forces_at_bound, 1);
  const double I = 1. / 12 * (1 + 4e-4) + 0.25 + mass * 1 + 0.4 * mass * 0.05 * 0.05,
               acceleration = ((0.5 + mass) * kGravity - tau) / I;
  EXPECT_NEAR(Force(s).z(), mass * (kGravity - acceleration), 1e-4 * mass * kGravity);
}

// What is cut in the arm feels the box.
TEST(SwitchedEquality, SensorsOfForce_FeelWhatHangsOnTheWeld) {
  const std::string text =
      "<mujoco><worldbody><body name='arm'><joint name='shoulder' type='slide' axis='0 0 1' stiffness='1e6' "
      "damping='2e4'/><geom type='box' size='.1 .1 .1' mass='1' contype='0' conaffinity='0'/><site "
      "name='wrist'/></body><body name='box' pos='.3 0 -.5'><freejoint/><geom type='box' size='.1 .1 .1' "
      "mass='2'/></body></worldbody><equality><weld name='grab' body1='arm' body2='box' active='false'/></equality>"
      "<sensor><force name='f' site='wrist'/><torque name='t' site='wrist'/></sensor></mujoco>";
  Simulation s = MustStart(text, 1. / 240);
  s.SetControl("grab", 1);
  RunUntil(s, 1);
  const VectorX values = Sensors(s).values();
  EXPECT_LT((values.head<3>() - Vector3(0, 0, 3 * kGravity)).norm(), 1e-3 * kGravity);
  EXPECT_LT((values.segment<3>(3) - Vector3(0, -0.3 * 2 * kGravity, 0)).norm(), 1e-3 * kGravity);
}

TEST(SwitchedEquality, SavedWhileItHolds_GoesOnBitByBit) {
  Arm arm;
  Simulation s = MustStart(arm.Text(), 1. / 240);
  s.SetControl("grab", 1);
  RunUntil(s, 0.1);
  const Simulation::Snapshot saved = s.Save();
  s.SetControl("servo", 0.2);
  RunUntil(s, 0.2);
  const auto hash = s.HashState();
  ASSERT_TRUE(s.Restore(saved));
  s.SetControl("servo", 0.2);
  RunUntil(s, 0.2);
  EXPECT_EQ(s.HashState(), hash);
}

// Expanded poses, one stage of backward Euler, and a step of 1/60 s: what hangs on the weld hangs and swings alike.
TEST(SwitchedEquality, OtherIntegratorAndRecovery_HoldAsWell) {
  for (const Recovery recovery : {Recovery::kExact, Recovery::kExpanded})
    for (const Integrator integrator : {Integrator::kTwoStage, Integrator::kEuler})
      for (const double dt : {1. / 60, 1. / 1000}) {
        SCOPED_TRACE(fmt::format("expanded {}, Euler {}, step {}", recovery == Recovery::kExpanded,
                                 integrator == Integrator::kEuler, dt));
        Arm arm;
        SimulationOptions options;
        options.dt = dt;
        options.recovery = recovery;
        auto created = Simulation::Create(MustLoad(arm.Text()).scene, options);
        ASSERT_TRUE(created) << created.error().Text();
        Simulation& s = *created;
        s.step_options().integrator = integrator;
        const Vector3 held = s.Pose("arm").inverse() * Place(s, "box");
        s.SetControl("grab", 1);
        s.SetControl("servo", 0.5);
        double gap = 0;
        while (s.time() < 1) {
          const StepReport report = s.Step();
          ASSERT_TRUE(report.finite && report.stages_converged) << s.time();
          gap = std::max(gap, (Place(s, "box") - s.Pose("arm") * held).norm());
        }
        // The jerk of the servo turns the arm by 0.5 rad within a few steps: a chord of a step, closed by exp(-h/T).
        EXPECT_LT(gap, 0.05);
        EXPECT_LT((Place(s, "box") - s.Pose("arm") * held).norm(), 1e-6);
        EXPECT_LT((Force(s) - Vector3(0, 0, arm.mass * kGravity)).norm(), 1e-3 * arm.mass * kGravity);
      }
}

// Two links hang from pins 2 m apart and meet 0.75 m below: joined there they are rigid, and by the moment of each about
// its pin the joint bears m g (1/2)/0.75 along x, on the right one towards the left.
TEST(SwitchedEquality, LinksOfTwoMechanismsOrOfOne_CloseALoop) {
  const double mass = 3;
  for (const bool one : {false, true}) {
    SCOPED_TRACE(one);
    const auto link = [&](const char* name, double x) {
      return fmt::format(
          "<body name='{0}' pos='{1} 0 0'><joint name='{0}' axis='0 1 0'/><geom type='capsule' fromto='0 0 0 {2} 0 "
          "-.75' size='.02' mass='{3}' contype='0' conaffinity='0'/></body>",
          name, x, -x, mass);
    };
    const std::string links = link("left", -1) + link("right", 1);
    Simulation s = MustStart(
        fmt::format(
            "<mujoco><worldbody>{}</worldbody><equality><connect name='pin' body1='left' body2='right' "
            "anchor='1 0 -.75' active='false'/></equality></mujoco>",
            one ? "<body name='frame'><joint name='lift' type='slide' axis='0 0 1' stiffness='1e6' "
                  "damping='1e4'/><geom size='.1' mass='1' contype='0' conaffinity='0'/>" +
                      links + "</body>"
                : links),
        1. / 480);
    EXPECT_EQ(s.world().mechanisms().size(), one ? 1u : 2u);
    const auto gap = [&] {
      return (s.Pose("left") * Vector3(1, 0, -0.75) - s.Pose("right") * Vector3(-1, 0, -0.75)).norm();
    };
    s.SetControl("pin", 1);
    RunUntil(s, 1);
    EXPECT_LT(gap(), 1e-6);
    EXPECT_LT((Force(s) - Vector3(-mass * kGravity * 0.5 / 0.75, 0, 0)).norm(), 1e-4 * mass * kGravity);
    s.SetControl("pin", 0);
    RunUntil(s, 1.2);
    // They pass each other.
    EXPECT_GT(gap(), 0.05);
    EXPECT_EQ(Force(s).norm(), 0);
  }
}

// A reference pose within the floor: what is hard in both directions bears more than contact, which only presses.
TEST(SwitchedEquality, ThatAsksForAPoseInsideOfTheFloor_HoldsItAndStaysCalm) {
  Simulation s = MustStart(
      "<mujoco><worldbody><geom type='plane' size='5 5 1'/><body name='crate' pos='0 0 .1'><freejoint/><geom type='box' "
      "size='.1 .1 .1' mass='3'/></body></worldbody><equality><weld name='sunk' body1='world' body2='crate' "
      "relpose='0 0 .09 1 0 0 0' active='false'/></equality></mujoco>",
      1. / 240);
  RunUntil(s, 0.1);
  s.SetControl("sunk", 1);
  for (int k = 0; k < 120; ++k) {
    const StepReport report = s.Step();
    ASSERT_TRUE(report.finite && report.stages_converged && report.solver.converged) << k;
  }
  EXPECT_NEAR(Place(s, "crate").z(), 0.09, 1e-6);
  EXPECT_LT(s.Velocity(s.FindBody("crate")).norm(), 1e-6);
  s.SetControl("sunk", 0);
  double highest = 0;
  for (int k = 0; k < 240; ++k) {
    ASSERT_TRUE(s.Step().finite);
    highest = std::max(highest, Place(s, "crate").z());
  }
  // What overlaps is pushed apart at 0.1 m/s at most, with which it hops by 0.5 mm (constraints/material.hpp).
  EXPECT_LT(highest, 0.101);
  EXPECT_NEAR(Place(s, "crate").z(), 0.1, 1e-4);
}

}  // namespace
}  // namespace fork1s::switched_equalities_test
