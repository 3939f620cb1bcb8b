// Steps of two stages where nothing touches: order, energy, momentum.
#include <cmath>
#include <draws.hpp>
#include <functional>
#include <random_mechanism.hpp>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

using testing::RandomMechanismOptions;
using testing::RandomSource;

// Any turn and any place, which must change nothing.
RigidTransform Elsewhere() { return {ExpRotation(Vector3(0.4, -1.1, 0.7)), Vector3(3, -2, 5)}; }

void Move(Scene& scene, const RigidTransform& X) {
  scene.gravity = X.rotation() * scene.gravity;
  for (MechanismDef& m : scene.mechanisms) m.X_WR = X * m.X_WR;
  for (KeyframeDef& key : scene.keyframes) {
    for (auto& m : key.mechanisms) m.X_WR = X * m.X_WR;
    for (auto& b : key.free_bodies) {
      b.X_WB = X * b.X_WB;
      b.omega_W = X.rotation() * b.omega_W;
      b.velocity_W = X.rotation() * b.velocity_W;
    }
  }
}

// Places of all bodies after `seconds`; `before` sets inputs for the end of each step.
std::vector<Vector3> Places(const Scene& scene, double seconds, double h, FullIntegrator integrator,
                            const std::function<void(FullSimulation&, double)>& before = {}) {
  FullSimulation s = Start(scene, h, integrator, true);
  const int steps = static_cast<int>(std::lround(seconds / h));
  for (int i = 1; i <= steps; ++i) {
    if (before) before(s, i * h);
    const FullStepReport report = s.Step();
    EXPECT_TRUE(report.converged) << i << " " << report.residual;
    EXPECT_EQ(report.euler_parts, 0) << i;
    EXPECT_LT(report.joint_gap, 1e-9) << i;
  }
  std::vector<Vector3> places;
  for (std::size_t b = 0; b < s.bodies().size(); ++b) {
    const RigidTransform X = s.Pose(static_cast<int>(b));
    places.push_back(X.translation());
    places.push_back(X * Vector3(0.1, 0.2, 0.3));  // turns too
  }
  return places;
}

double Farthest(const std::vector<Vector3>& a, const std::vector<Vector3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

// Places at h -> 0 of a scheme of second order, from those at two steps, `fine` half of `coarse`.
std::vector<Vector3> Extrapolate(const std::vector<Vector3>& coarse, const std::vector<Vector3>& fine) {
  std::vector<Vector3> places;
  for (std::size_t i = 0; i < fine.size(); ++i) places.push_back((4 * fine[i] - coarse[i]) / 3);
  return places;
}

struct Moving {
  std::string name;
  Scene scene;
  double of_euler = 0.1;  // error at 1/60 s, at most this share of implicit Euler's
  std::function<void(FullSimulation&, double)> before = {};
  double seconds = 0.5;
};
std::ostream& operator<<(std::ostream& out, const Moving& m) { return out << m.name; }

Moving DoublePendulum() {
  Scene scene = Of(testing::Chain(2, 1, 1, 0), Vector3(0, -kGravity, 0));
  Move(scene, Elsewhere());
  return {"double pendulum", scene, 0.02};
}

Moving FourBar() {
  testing::FourBar loop;
  loop.k_A = loop.k_D = 0.05;
  Scene scene = Of(loop.Definition(), Vector3(0, -kGravity, 0));
  StartAt(scene, Vector3::Zero(), Vector3(4, 0, 0));
  Move(scene, Elsewhere());
  return {"four-bar", scene};
}

Moving Floating() {
  Scene scene = Of(testing::Walker(BaseKind::kFloating, 20, 0.05), Vector3(1, -2, -9));
  scene.mechanisms[0].interfaces.clear();
  Vector6 V_R;
  V_R << 1, 3, -2, 0.5, 0.2, -0.4;
  StartAt(scene, VectorX::Zero(8), VectorX::LinSpaced(8, -2, 3), V_R);
  return {"floating", scene};
}

Moving Driven() {
  Scene scene = Of(testing::Walker(BaseKind::kDriven, 20, 0.05), Vector3(0, 0, -9.81));
  scene.mechanisms[0].interfaces.clear();
  // Like a clock hand that starts slowly: t³ has no jump of speed or acceleration.
  // The servos' own swings have died down by then: what is left of either error is small.
  return {"driven", scene, 0.2, [](FullSimulation& s, double t) {
            s.SetControl(s.FindControl("base.rz"), 4 * t * t * t);
            s.SetControl(s.FindControl("base.ry"), -3 * t * t * t);
            s.SetControl(s.FindControl("base.x"), t * t * t);
            s.SetBaseRates((VectorX(6) << 3 * t * t, 0, 0, 0, -9 * t * t, 12 * t * t).finished());
          }};
}

Moving Spinning() {
  Scene scene;
  scene.gravity = Vector3(0, 0, -9.81);
  FreeBodyDef body;
  body.name = "brick";
  body.inertia = testing::Brick(2, Vector3(0.1, 0.05, 0.02));
  body.inertia.center = Vector3(0.03, 0, 0.01);
  scene.free_bodies = {body};
  KeyframeDef key;
  key.free_bodies.push_back({RigidTransform(), Vector3(0.1, 6, 0.05), Vector3(0.3, 0, 0)});
  scene.keyframes = {key};
  Move(scene, Elsewhere());
  return {"free body about its middle axis", scene, 3, {}, 1};
}

class Order : public ::testing::TestWithParam<Moving> {};

TEST_P(Order, ErrorFallsWithTheSquareOfTheStep) {
  const Moving& m = GetParam();
  const auto run = [&](int parts, FullIntegrator integrator = FullIntegrator::kTwoStages) {
    return Places(m.scene, m.seconds, 1.0 / 60 / parts, integrator, m.before);
  };
  // Of an error of first order the extrapolation would leave so much that the ratios below were 1.9 to 2.5.
  const auto finest = run(16), truth = Extrapolate(finest, run(32));
  const double euler = Farthest(run(1, FullIntegrator::kEuler), truth);
  double before = Farthest(run(1), truth);
  EXPECT_LT(before, m.of_euler * euler);
  for (const int parts : {2, 4, 8, 16}) {
    const double now = Farthest(parts == 16 ? finest : run(parts), truth);
    EXPECT_NEAR(before / now, 4, 0.8) << parts << " " << now;
    before = now;
  }
}

INSTANTIATE_TEST_SUITE_P(All, Order,
                         ::testing::Values(DoublePendulum(), FourBar(), Floating(), Driven(), Spinning()));

// Random mechanisms, driven, floating and fixed, with and without loops, couplings, tendons, servos.
TEST(TwoStages, ErrorOfRandomMechanismsFallsWithTheSquareOfTheStep) {
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven})
    for (const int loops : {0, 1})
      for (unsigned seed = 1; seed <= testing::Seeds(1, 2); ++seed) {
        SCOPED_TRACE("base " + std::to_string(static_cast<int>(base)) + ", loops " + std::to_string(loops) +
                     ", seed " + std::to_string(seed));
        RandomMechanismOptions options;
        options.base = base;
        options.rigid_closures = options.springy_closures = options.springs = loops;
        options.couplings = options.controls = loops;
        MechanismDef def = testing::RandomMechanismDef(seed, options);
        def.interfaces.clear();
        Scene scene = Of(def, Vector3(0, 0, -kGravity));
        RandomSource random(seed + 1000);
        const int n = testing::Share(def)->num_coordinates();
        const VectorX q_dot = random.Vector(n, 1);
        StartAt(scene, VectorX::Zero(n), q_dot,
                base == BaseKind::kFloating ? random.Six(1) : Vector6(Vector6::Zero()));
        const std::string root = def.bodies[0].name;
        const auto drive = [&](FullSimulation& s, double t) {
          if (base != BaseKind::kDriven) return;
          s.SetControl(s.FindControl(root + ".ry"), 10 * t * t * t);
          s.SetControl(s.FindControl(root + ".x"), 3 * t * t * t);
        };
        const auto run = [&](int parts, FullIntegrator by = FullIntegrator::kTwoStages) {
          return Places(scene, 0.25, 1.0 / 60 / parts, by, drive);
        };
        const auto quarter = run(4), truth = Extrapolate(quarter, run(8));
        const double euler = Farthest(run(2, FullIntegrator::kEuler), truth),
                     coarse = Farthest(run(2), truth), fine = Farthest(quarter, truth);
        EXPECT_LT(coarse, 0.1 * euler);
        EXPECT_GT(coarse / fine, 3.4);
      }
}

// Undamped, thrown at 5 rad/s, up to a million times as stiff as a step can follow: all is solved by two
// stages, and the energy never passes that of the start, though nothing forces it to.
TEST(TwoStages, RandomMechanismsStayTogetherHoweverStiff) {
  for (const double scale : {1.0, 1e3, 1e6})
    for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
      for (unsigned seed = 1; seed <= testing::Seeds(1, 2); ++seed) {
        SCOPED_TRACE("stiffness times " + std::to_string(scale) + ", seed " + std::to_string(seed));
        RandomMechanismOptions options;
        options.base = base;
        options.rigid_closures = options.springy_closures = options.couplings = options.bent_springs = 1;
        options.springs = options.controls = 2;
        MechanismDef def = testing::RandomMechanismDef(seed, options);
        def.interfaces.clear();
        for (JointDef& joint : def.joints)
          for (auto& freedom : joint.freedoms) {
            freedom.stiffness *= scale;
            freedom.damping = 0;
          }
        Scene scene = Of(def, Vector3(1, -2, -9));
        RandomSource random(seed + 1000);
        const int n = testing::Share(def)->num_coordinates();
        const VectorX q_dot = random.Vector(n, 5);
        StartAt(scene, VectorX::Zero(n), q_dot,
                base == BaseKind::kFloating ? random.Six(5) : Vector6(Vector6::Zero()));
        FullSimulation s = Start(scene, 1.0 / 60, FullIntegrator::kTwoStages);
        const double start = s.Energy(), moving = std::abs(start) + s.KineticEnergy();
        for (int i = 0; i < 60; ++i) {
          const FullStepReport report = s.Step();
          ASSERT_TRUE(report.converged) << i;
          EXPECT_EQ(report.euler_parts, 0) << i;
          EXPECT_LT(report.joint_gap, 1e-12) << i;  // rounding
          EXPECT_LE(s.Energy(), start + 1e-9 * moving) << i;
        }
      }
}

// The same swing at any place and in any direction: rounding, and Newton's 1e-9 a step.
TEST(TwoStages, NorthAndEastAreAlike) {
  const auto swing = [](bool elsewhere) {
    Scene scene = Of(testing::FourBar().Definition(), Vector3(1, -kGravity, 2));
    StartAt(scene, Vector3::Zero(), Vector3(3, 0, 0));
    if (elsewhere) Move(scene, Elsewhere());
    FullSimulation s = Start(scene, 1.0 / 60, FullIntegrator::kTwoStages);
    Advance(s, 1);
    return s.Displacements(0);
  };
  EXPECT_LT((swing(true) - swing(false)).norm(), 1e-8);
}

// With y = ω h a step keeps 1 - (g² y²/(1 + g² y²))² of the energy of a linear mode, g = 1 - 1/√2: never more
// than 1, and 0.99894 after 20 periods of 60 steps.
TEST(TwoStages, ASlowModeKeepsItsEnergy) {
  const double rate = 2 * M_PI;
  Scene scene = Of(testing::Chain(1, 1, 1, rate * rate / 3));
  StartAt(scene, VectorX::Constant(1, 0.3), VectorX::Zero(1));
  Move(scene, Elsewhere());
  FullSimulation s = Start(scene, 1.0 / 60, FullIntegrator::kTwoStages);
  const double start = s.Energy();
  double before = start;
  for (int i = 0; i < 1200; ++i) {
    ASSERT_TRUE(s.Step().converged);
    EXPECT_LE(s.Energy(), before + 1e-9 * start) << i;  // the tolerance of Newton, 1e-9 of a length
    before = s.Energy();
  }
  EXPECT_NEAR(before / start, 0.99894, 1e-4);
}

// The rule bounds what linear modes hold; of what turns and bends no theorem says that its energy never
// grows. A chain without springs that whips in chaos, too fast to be followed, rises above its start by 0.2 %
// at 1/60 s, 0.5 % at 1/240 s and 0.1 % at 1/960 s; stiff ones do not.
TEST(TwoStages, ChainsHardlyGainEnergy) {
  struct Whip {
    double k, h, most;
  };
  for (const Whip& c : {Whip{0, 1.0 / 60, 1e-2},
                        {0, 1.0 / 240, 1e-2},
                        {1, 1.0 / 60, 1e-3},
                        {1e3, 1.0 / 60, 0},
                        {1e6, 1.0 / 60, 0}}) {
    Scene scene = Of(testing::Chain(6, 0.1, 0.2, c.k, 0, true), Vector3(0, 0, -kGravity));
    StartAt(scene, VectorX::LinSpaced(6, -0.2, 0.2), VectorX::LinSpaced(6, -1, 5));
    FullSimulation s = Start(scene, c.h, FullIntegrator::kTwoStages);
    const double start = s.Energy(), moving = std::abs(start) + s.KineticEnergy();
    double most = 0;
    for (int i = 0; i < 4 / c.h; ++i) {
      const FullStepReport report = s.Step();
      ASSERT_TRUE(report.converged) << c.k << " " << i;
      most = std::max(most, s.Energy() - start);
    }
    EXPECT_LT(most, (c.most + 1e-9) * moving) << c.k;
  }
}

// Momenta are what a stage steps, so they are kept, also by what turns over.
TEST(TwoStages, AngularMomentumOfATumblingBodyIsKept) {
  Scene scene = Spinning().scene;
  scene.gravity.setZero();
  for (const double h : {1.0 / 60, 1.0 / 240}) {
    FullSimulation s = Start(scene, h, FullIntegrator::kTwoStages);
    const Vector6 before = s.Momentum();
    const double energy = s.KineticEnergy();
    double turned = 0, most = 0, least = 0;
    for (int i = 0; i < 5 / h; ++i) {
      ASSERT_TRUE(s.Step().converged);
      turned = std::max(turned, (s.Pose(0).rotation().col(1) - Elsewhere().rotation().col(1)).norm());
      most = std::max(most, s.KineticEnergy() / energy - 1);
      least = std::min(least, s.KineticEnergy() / energy - 1);
    }
    EXPECT_GT(turned, 1.9);                                            // its middle axis has turned over
    EXPECT_LT((s.Momentum() - before).norm(), 1e-10 * before.norm());  // rounding of 1200 steps
    // Its energy falls, in these five seconds by 1.2e-5 at 1/60 s and by a 64th of that at 1/240 s.
    EXPECT_LT(most, 1e-12);
    EXPECT_GT(least, -2e-5 * std::pow(60 * h, 3));
  }
}

// About its centre of mass, since where that is errs by the square of the step.
TEST(TwoStages, MomentumOfAFloatingMechanismIsKept) {
  Scene scene = Floating().scene;
  scene.gravity.setZero();
  FullSimulation s = Start(scene, 1.0 / 60, FullIntegrator::kTwoStages);
  const auto momentum = [&] {
    const Mechanism& m = s.mechanism(0);
    Vector3 center = Vector3::Zero();
    for (int b = 0; b < m.num_bodies(); ++b) {
      const SpatialInertia& I = m.body(BodyIndex(b)).inertia_B;
      center += I.mass / m.total_mass() * (s.Pose(b) * I.center);
    }
    Vector6 p = s.Momentum();
    p.head<3>() -= center.cross(p.tail<3>());
    return p;
  };
  const Vector6 before = momentum();
  Advance(s, 2);
  EXPECT_LT((momentum() - before).norm(), 1e-6 * before.norm());  // Newton's 1e-9 a step over 120 steps
}

// A free body and a floating mechanism of one body are the same thing.
TEST(TwoStages, AFreeBodyMovesAsAMechanismOfOne) {
  const Scene free = Spinning().scene;
  const FreeBodyDef& body = free.free_bodies[0];
  MechanismBuilder builder("one", BaseKind::kFloating, body.inertia);
  Scene one = Of(builder.definition(), free.gravity);
  const auto& start = free.keyframes[0].free_bodies[0];
  Vector6 V;
  const Matrix3 R_T = start.X_WB.rotation().transpose();
  V << R_T * start.omega_W, R_T * start.velocity_W;
  one.mechanisms[0].X_WR = start.X_WB;
  StartAt(one, VectorX(), VectorX(), V);
  FullSimulation a = Start(free, 1.0 / 60, FullIntegrator::kTwoStages),
                 b = Start(one, 1.0 / 60, FullIntegrator::kTwoStages);
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(a.Step().converged && b.Step().converged);
  // Newton's 1e-9 a step over 60 steps, which a turn about the middle axis makes exp(5) times as large in a
  // second.
  EXPECT_LT((a.Pose(0).rotation() - b.Pose(0).rotation()).norm(), 1e-5);
  EXPECT_LT((a.Pose(0).translation() - b.Pose(0).translation()).norm(), 1e-6);
}

// Its weight turns nothing that flies, however fast.
TEST(TwoStages, ADriftChangesNothing) {
  const auto shape = [](double speed) {
    Scene scene = Floating().scene;
    scene.keyframes[0].mechanisms[0].V_R.tail<3>() += Vector3(speed, 0.5 * speed, 0);
    FullSimulation s = Start(scene, 1.0 / 60, FullIntegrator::kTwoStages);
    Advance(s, 1);
    return s.Displacements(0);
  };
  EXPECT_LT((shape(50) - shape(0)).norm(), 1e-6);  // Newton's 1e-9 a step
}

TEST(TwoStages, PushesThatAreAbsurdAreReported) {
  FullSimulation s = Start(Of(testing::Chain(3, 0.1, 0.1, 1)), 1.0 / 60, FullIntegrator::kTwoStages);
  s.ApplyWrench(1, Vector3(0, 1e308, 0), Vector3::Zero(), Vector3(1e3, 0, 0));  // its moment overflows
  const FullStepReport report = s.Step();
  EXPECT_FALSE(report.finite);
  EXPECT_FALSE(report.converged);
  EXPECT_TRUE(s.Pose(1).IsFinite());
  EXPECT_EQ(s.steps(), 0);
  EXPECT_TRUE(s.Step().converged);
  EXPECT_EQ(s.Energy(), 0);
}

}  // namespace
}  // namespace fork1s::reference_test
