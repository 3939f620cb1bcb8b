// Forces at points that are fixed in a body: their energy, momentum and stiffness in two-stage steps.
#include <algorithm>
#include <cmath>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustCreate;
using testing::MustStart;
using testing::TwoStage;

// A constant force at a point of a body; its potential is -F·x.
struct ConstantForce {
  BodyIndex body;
  Vector3 point_B, force_W;

  void Apply(MechanismDynamics& m) const {
    m.AddWrench(body, force_W, Vector3::Zero(), m.BodyPose(body) * point_B);
  }
  double Energy(const MechanismDynamics& m) const {
    return m.KineticEnergy() + m.PotentialEnergy(Vector3::Zero()) - force_W.dot(m.BodyPose(body) * point_B);
  }
};

// Largest change of energy [J] in `time` seconds.
double EnergyError(World& world, const std::vector<ConstantForce>& forces, double h, double time) {
  MechanismDynamics& m = world.mechanisms()[0];
  const auto energy = [&] {
    double e = m.KineticEnergy() + m.PotentialEnergy(Vector3::Zero());
    for (const ConstantForce& f : forces) e -= f.force_W.dot(m.BodyPose(f.body) * f.point_B);
    return e;
  };
  const double start = energy();
  double largest = 0;
  for (int i = 0; i < std::lround(time / h); ++i) {
    for (const ConstantForce& f : forces) f.Apply(m);
    const StepReport report = world.Step(TwoStage(h));
    EXPECT_TRUE(report.finite);
    EXPECT_EQ(report.halving, HalvingCause::kNone);
    largest = std::max(largest, std::abs(energy() - start));
  }
  return largest;
}

const Matrix3 kTurned = ExpRotation(Vector3(0.4, -0.7, 1.1));

// A rod on a hinge swings about the direction of the force as a pendulum does: from 1.2 rad never beyond it.
TEST(AppliedForces, ARodUnderAConstantForceSwingsAsAPendulum) {
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kTurned})
    for (const double length : {0.05, 0.5, 5.0})
      for (const double offset : {0.0, 0.3})
        for (const double swing : {0.5, 1.0}) {  // share of 1/60 s by which the period scales
          MechanismDef rod = testing::Chain(1, length, 1, 0);
          rod.X_WR = RigidTransform(R, Vector3(0.3, -2, 1));
          // Torque / inertia = 30/s² by the factor: 1/60 s resolves the swing.
          const double magnitude = 30 * swing * length / 3;
          const auto run = [&](double h) {
            World world = MustStart(rod, VectorX::Constant(1, 1.2), VectorX::Zero(1));
            const ConstantForce force{BodyIndex(1), Vector3(length, 0, offset * length),
                                      magnitude * (R * Vector3::UnitX())};
            return EnergyError(world, {force}, h, 8) / (magnitude * length);
          };
          SCOPED_TRACE("length " + std::to_string(length) + " offset " + std::to_string(offset));
          const double coarse = run(1.0 / 60), fine = run(1.0 / 240);
          EXPECT_LT(coarse, 0.02);       // of F L, where the frozen lever went over the top, 1.36 F L
          EXPECT_GT(coarse / fine, 12);  // 16 by second order
        }
}

// In 30 s the amplitude neither grows nor shrinks, where the lever of the start of each step took the rod
// over the top.
TEST(AppliedForces, ARodUnderAConstantForceKeepsItsAmplitude) {
  constexpr double kAmplitude = 1.2,
                   kOmega2 = 10;  // rad, and 1/s²: torque over inertia per sine of the angle
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kTurned})
    for (const double length : {0.05, 0.5})
      for (const double h : {1.0 / 30, 1.0 / 60, 1.0 / 240}) {
        SCOPED_TRACE(::testing::Message() << "length " << length << ", h " << h);
        MechanismDef rod = testing::Chain(1, length, 1, 0);
        rod.X_WR = RigidTransform(R, Vector3(0.3, -2, 1));
        World world = MustStart(rod, VectorX::Constant(1, kAmplitude), VectorX::Zero(1));
        MechanismDynamics& m = world.mechanisms()[0];
        const ConstantForce force{BodyIndex(1), Vector3(length, 0, 0),
                                  kOmega2 * length / 3 * (R * Vector3::UnitX())};
        double largest = 0, late = 0;
        for (int i = 0; i * h < 30; ++i) {
          force.Apply(m);
          ASSERT_TRUE(world.Step(TwoStage(h)).finite) << i;
          const double angle = std::abs(m.configuration().q(0));
          largest = std::max(largest, angle);
          if (i * h > 26) late = std::max(late, angle);
        }
        EXPECT_LT(largest, kAmplitude * (1 + 1e-6));
        EXPECT_GT(late,
                  kAmplitude * (1 - kOmega2 * h * h / 8));  // steps miss the turning point by h/2 at most
      }
}

// Loops: a four-bar without springs turns round and round under forces on its coupler and its crank.
TEST(AppliedForces, ALoopKeepsItsEnergyToSecondOrder) {
  testing::FourBar bar;
  bar.k_A = bar.k_D = 0;
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kTurned})
    for (const double scale : {1.0, 30.0}) {
      MechanismDef def = bar.Definition();
      def.X_WR = RigidTransform(R, Vector3(0.3, -2, 1));
      const auto run = [&](double h) {
        World world = MustCreate(def);
        const Mechanism& m = world.mechanisms()[0].mechanism();
        const std::vector<ConstantForce> forces = {
            {m.FindBody("coupler"), Vector3(0.1, 0.05, 0.2), scale * (R * Vector3(0.02, 0.005, 0.1))},
            {m.FindBody("crank"), Vector3(0.05, -0.02, 0), scale * (R * Vector3(-0.005, 0.01, 0))}};
        return EnergyError(world, forces, h, 2) / (0.02 * scale * 0.1);
      };
      // The frequency grows with the root of the force.
      const double h = 1.0 / 60 / std::sqrt(scale), coarse = run(h), fine = run(h / 4);
      SCOPED_TRACE("scale " + std::to_string(scale));
      EXPECT_LT(coarse, 0.02);
      EXPECT_GT(coarse / fine, 10);
    }
}

// Momentum grows by F t exactly; energy less the work is constant to second order.
TEST(AppliedForces, AFloatingMechanismGainsTheImpulseAndTheWork) {
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kTurned})
    for (const double magnitude : {1.0, 20.0}) {
      MechanismDef def = testing::Walker(BaseKind::kFloating, 6, 0);
      def.X_WR = RigidTransform(R, Vector3(0.3, -2, 1));
      double errors[2];
      for (const int k : {0, 1}) {
        const double h = 1.0 / 120 / (k == 0 ? 1 : 4);
        World world = MustCreate(def);
        MechanismDynamics& m = world.mechanisms()[0];
        const int n = m.mechanism().num_bodies();
        const std::vector<ConstantForce> forces = {
            {BodyIndex(n - 1), Vector3(0.15, 0.02, 0.01), magnitude * (R * Vector3(0.3, 0.5, 1))},
            {BodyIndex(0), Vector3(0.1, -0.05, 0.02), magnitude * (R * Vector3(-0.2, 0.8, 0.3))}};
        errors[k] = EnergyError(world, forces, h, 1);
        const Vector3 impulse = 1.0 * (forces[0].force_W + forces[1].force_W);
        // Rounding of 120 to 480 steps.
        EXPECT_LT((testing::Momentum(m).tail<3>() - impulse).norm(), 1e-11 * impulse.norm());
      }
      EXPECT_GT(errors[0] / errors[1], 8);
    }
}

TEST(AppliedForces, AFreeBodyGainsTheImpulseAndTheWork) {
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kTurned})
    for (const double scale : {0.01, 1.0}) {  // of lengths
      Scene scene;
      scene.free_bodies.push_back(
          testing::BoxBody("box", 2, scale * Vector3(0.1, 0.2, 0.4), Vector3(0.2, 0.1, 0.5), 0.5));
      scene.free_bodies[0].X_WB.rotation() = R;
      scene.free_bodies[0].inertia.center = scale * Vector3(0.02, -0.05, 0.03);
      const Vector3 points[] = {scale * Vector3(0.1, 0.15, -0.3), scale * Vector3(-0.05, 0, 0.4)};
      const Vector3 force[] = {scale * Vector3(1, -3, 2), scale * Vector3(-2, 1, 1)};
      double errors[2];
      for (const int k : {0, 1}) {
        const double h = 1.0 / 60 / (k == 0 ? 1 : 4);
        World world = MustCreate(scene);
        FreeBody& body = world.free_bodies()[0];
        const auto energy = [&] {
          return body.KineticEnergy() - force[0].dot(body.pose() * points[0]) -
                 force[1].dot(body.pose() * points[1]);
        };
        const double start = energy();
        errors[k] = 0;
        for (int i = 0; i < std::lround(5 / h); ++i) {
          for (const int p : {0, 1}) body.AddWrench(force[p], Vector3::Zero(), body.pose() * points[p]);
          EXPECT_EQ(world.Step(TwoStage(h)).halving, HalvingCause::kNone);
          errors[k] = std::max(errors[k], std::abs(energy() - start) / (scale * scale));
        }
        const Vector3 impulse = 5 * (force[0] + force[1]);
        EXPECT_LT((2 * body.velocity_of_center() - impulse).norm(), 1e-11 * impulse.norm());
      }
      EXPECT_GT(errors[0] / errors[1], 8);
    }
}

// A pure moment is constant in world axes, however the body turns: angular momentum grows by M t exactly.
TEST(AppliedForces, APureMomentStaysInWorldAxes) {
  const Vector3 moment(0.3, -0.2, 0.5);
  Scene scene;
  scene.free_bodies.push_back(testing::BoxBody("box", 2, Vector3(0.1, 0.2, 0.4), Vector3::Zero(), 0.5));
  scene.mechanisms.push_back(testing::Walker(BaseKind::kFloating, 60, 0.5));
  World world = MustCreate(scene);
  FreeBody& body = world.free_bodies()[0];
  MechanismDynamics& m = world.mechanisms()[0];
  const double h = 1.0 / 240;
  for (int i = 0; i < 240; ++i) {
    body.AddWrench(Vector3::Zero(), moment, Vector3(1, 2, 3));
    m.AddWrench(BodyIndex(m.mechanism().num_bodies() - 1), Vector3::Zero(), 0.1 * moment, Vector3(1, 2, 3));
    EXPECT_TRUE(world.Step(TwoStage(h)).finite);
  }
  const Vector3 spin = body.pose().rotation() * (body.inertia().rotational * body.omega_B());
  EXPECT_LT((spin - moment).norm(), 1e-11);
  EXPECT_LT((testing::Spin(m) - 0.1 * moment).norm(), 1e-7);  // the residual of a stage
}

// A light chain under tension: the force is stiff by F/length across it, up to b² K = 2e5 times the inertia.
TEST(AppliedForces, TensionIsSolvedForAtAnyForce) {
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
    for (const double force : {1e2, 1e4, 1e6}) {
      MechanismDef def = testing::Chain(4, 0.1, 0.01, 0, 0, true);
      def.base = base;
      if (base == BaseKind::kFloating) def.bodies[0].inertia = testing::Ball(1, 0.05);
      const int n = testing::Share(def)->num_coordinates();
      World world = MustStart(def, VectorX::LinSpaced(n, 0.05, -0.1), VectorX::Zero(n));
      MechanismDynamics& m = world.mechanisms()[0];
      const BodyIndex tip = m.mechanism().FindBody("tip");
      int iterations = 0, halved = 0;
      double swing = 0;
      for (int i = 0; i < 60; ++i) {
        m.AddWrench(tip, Vector3(force, 0, 0), Vector3::Zero(), m.BodyPose(tip).translation());
        if (base == BaseKind::kFloating)
          m.AddWrench(BodyIndex(0), Vector3(-force, 0, 0), Vector3::Zero(),
                      m.BodyPose(BodyIndex(0)).translation());
        const StepReport report = world.Step(TwoStage(1.0 / 60));
        EXPECT_TRUE(report.finite);
        iterations = std::max(iterations, report.max_stage_iterations);
        halved += report.halving != HalvingCause::kNone ? 1 : 0;
        const Vector3 span = m.BodyPose(tip).translation() - m.BodyPose(BodyIndex(0)).translation();
        swing = std::max(swing, std::hypot(span.y(), span.z()));
      }
      EXPECT_LE(iterations, 6);  // 10 and a halving of every step without the stiffness
      EXPECT_LE(halved, 1);      // the first, in which the chain straightens at once
      EXPECT_LT(swing, 0.02);    // of 0.4 m, as at the start
    }
}

// The other way round the force is a negative stiffness, beyond what 1/60 s resolves: steps are halved, none
// is undone, and no energy comes from nowhere.
TEST(AppliedForces, CompressionBucklesAChainWithoutAGainOfEnergy) {
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kTurned})
    for (const double force : {1.0, 10.0}) {
      MechanismDef def = testing::Chain(4, 0.1, 0.01, 0, 0, true);
      def.X_WR = RigidTransform(R, Vector3(0.3, -2, 1));
      World world = MustStart(def, Vector4(0.05, 0, -0.05, -0.1), VectorX::Zero(4));
      MechanismDynamics& m = world.mechanisms()[0];
      const ConstantForce push{m.mechanism().FindBody("tip"), Vector3::Zero(), R * Vector3(-force, 0, 0)};
      const double start = push.Energy(m);
      for (int i = 0; i < 60; ++i) {
        push.Apply(m);
        EXPECT_TRUE(world.Step(TwoStage(1.0 / 60)).finite);
        EXPECT_LT(push.Energy(m) - start,
                  0.005 * 0.8 * force);  // of the work from end to end; 0.003 measured
      }
    }
}

// A ball that rolls to and fro under a force at its top: friction that holds does no work.
TEST(AppliedForces, ABallThatRollsKeepsItsEnergy) {
  for (const double scale : {1.0, 10.0})
    for (const double force : {0.5, 1.0}) {
      const double r = 0.02 * scale;
      double errors[2];
      for (const int k : {0, 1}) {
        // 18/s is the frequency at 1 N and 0.02 m.
        const double h = (k == 0 ? 1.0 / 240 : 1.0 / 960) * std::sqrt(scale);
        Scene scene;
        scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
        scene.free_bodies.push_back(testing::BallBody("ball", 0.1, r, Vector3(0, 0, r), 0.8));
        World world = MustCreate(scene);
        FreeBody& body = world.free_bodies()[0];
        const Vector3 force_W(0.1 * force, 0, -force), top(0, 0, r);
        const auto energy = [&] {
          return body.KineticEnergy() + 0.981 * body.center_W().z() - force_W.dot(body.pose() * top);
        };
        const double start = energy();
        errors[k] = 0;
        for (int i = 0; i < std::lround(1 / h); ++i) {
          body.AddWrench(force_W, Vector3::Zero(), body.pose() * top);
          StepOptions step = TwoStage(h);
          step.gravity = Vector3(0, 0, -9.81);
          EXPECT_EQ(world.Step(step).halving, HalvingCause::kNone);
          errors[k] = std::max(errors[k], std::abs(energy() - start) / (2 * r * force));
        }
      }
      EXPECT_LT(errors[0], 2e-3);
      EXPECT_GT(errors[0] / errors[1], 8) << errors[0];  // 16 by second order
    }
}

// At 1/60 s a push of 10 N is stiff: b² F r is 8 times the inertia about the contact.
TEST(AppliedForces, ABallUnderAHardPushGainsNoEnergy) {
  for (const double scale : {1.0, 10.0})
    for (const double force : {1.0, 10.0, 100.0}) {
      const double r = 0.02 * scale, h = 1.0 / 60;
      Scene scene;
      scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
      scene.free_bodies.push_back(testing::BallBody("ball", 0.1, r, Vector3(0, 0, r), 0.8));
      scene.free_bodies[0].X_WB.rotation() = ExpRotation(Vector3(0.1, 0.3, 0));
      World world = MustCreate(scene);
      FreeBody& body = world.free_bodies()[0];
      const Vector3 force_W(0, 0, -force), top(0, 0, r);
      const auto energy = [&] {
        return body.KineticEnergy() + 0.981 * body.center_W().z() - force_W.dot(body.pose() * top);
      };
      const double start = energy();
      double gain = 0;
      for (int i = 0; i < 300; ++i) {
        body.AddWrench(force_W, Vector3::Zero(), body.pose() * top);
        StepOptions step = TwoStage(h);
        step.gravity = Vector3(0, 0, -9.81);
        EXPECT_TRUE(world.Step(step).finite);
        gain = std::max(gain, energy() - start);
      }
      // Of the work from top to bottom.
      EXPECT_LT(gain, 0.01 * 2 * r * force) << scale << ' ' << force;
    }
}

}  // namespace
}  // namespace fork1s
