// Dampers, armature, dry friction and motors of ball joints act on the angular velocity: closed forms.
#include <fork1s/mechanism/kinematics.hpp>

#include <cmath>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::RandomSource;
using testing::Share;
using testing::Still;

constexpr double kSpinnerInertia = 1e-3;  // kg·m²

// A sphere of inertia kSpinnerInertia that hangs in its centre.
MechanismDef Spinner(double damping, double armature,
                     const std::vector<std::pair<Vector3, double>>& motors = {}) {
  MechanismBuilder builder("spinner");
  BodyDef body;
  body.name = "b";
  body.parent = builder.base();
  body.inertia.mass = 0.1;
  body.inertia.rotational = kSpinnerInertia * Matrix3::Identity();
  const JointIndex joint = builder.AddJoint(
      JointDef::Ball("j", builder.AddBody(body)).WithSpring(0, damping).WithArmature(armature));
  builder.SetInterfaces({"b"});
  MechanismDef def = builder.definition();
  for (std::size_t i = 0; i < motors.size(); ++i) {
    ControlDef motor;
    motor.name = "m" + std::to_string(i);
    for (int k = 0; k < 3; ++k)
      if (motors[i].first(k) != 0) motor.terms.emplace_back(FreedomRef{joint, k}, motors[i].first(k));
    motor.gain = 1;
    motor.initial = motors[i].second;
    def.controls.push_back(motor);
  }
  return def;
}

StepOptions SecondOrder(double h = 1.0 / 60) {
  StepOptions options = Still(h);
  options.integrator = Integrator::kTwoStage;
  return options;
}

// θ̇ that turns at ω (body axes) in the pose θ.
Vector3 Rates(const Vector3& theta, const Vector3& omega) { return DexpInverseRotation(-theta) * omega; }

Vector3 BodyRate(const World& world) {
  const MechanismDynamics& m = world.mechanisms()[0];
  return m.BodyPose(BodyIndex(1)).rotation().transpose() * m.BodyVelocity(BodyIndex(1)).head<3>();
}

// ω = ω_0 exp(-d t/(I + a)) whatever the pose; it turns by |ω_0| (1 - e^..)(I + a)/d about a fixed axis.
TEST(BallJoint, DampedSpinBeyondHalfPiDecaysAsInEveryPose) {
  const double d = 2e-3, a = 5e-4, time = 1;
  for (unsigned seed = 0; seed < 6; ++seed) {
    RandomSource random(seed);
    const Vector3 theta = random.Uniform(1.6, 3.0) * random.Direction(), omega = 2 * random.Direction();
    const Matrix3 R_0 = ExpRotation(theta);
    const double rate = d / (kSpinnerInertia + a), turn = (1 - std::exp(-rate * time)) / rate;
    double last = 0;
    for (const int steps : {60, 240}) {
      World world = MustStart(Spinner(d, a), theta, Rates(theta, omega));
      for (int i = 0; i < steps; ++i) world.Step(SecondOrder(time / steps));
      const Vector3 off = BodyRate(world) - omega * std::exp(-rate * time);
      const Matrix3 R = world.mechanisms()[0].BodyPose(BodyIndex(1)).rotation();
      const double error = off.norm() + LogRotation((R_0 * ExpRotation(turn * omega)).transpose() * R).norm();
      EXPECT_LT(error, 2e-3 * 60 / steps) << "seed " << seed << ", " << steps << " steps";
      if (steps == 240) {
        EXPECT_LT(error, 0.3 * last) << "seed " << seed;
      }
      last = error;
    }
  }
}

TEST(BallJoint, MotorAtTwoRadiansTurnsAboutTheAxisOfTheBody) {
  const double torque = 2e-3, time = 0.2;
  for (unsigned seed = 0; seed < 6; ++seed) {
    RandomSource random(seed);
    const Vector3 theta = 2 * random.Direction(), gear = random.Direction();
    World world = MustStart(Spinner(0, 0, {{gear, torque}}), theta, Vector3::Zero());
    for (int i = 0; i < 40; ++i) world.Step(SecondOrder(time / 40));
    // An axis of the body about which it turns stays where it is.
    EXPECT_LT((BodyRate(world) - torque * time / kSpinnerInertia * gear).norm(),
              1e-4 * torque * time / kSpinnerInertia)
        << "seed " << seed;
    const Matrix3 R = world.mechanisms()[0].BodyPose(BodyIndex(1)).rotation();
    const Vector3 turn = 0.5 * torque / kSpinnerInertia * time * time * gear;
    EXPECT_LT(LogRotation((ExpRotation(theta) * ExpRotation(turn)).transpose() * R).norm(), 2e-4)
        << "seed " << seed;
  }
}

TEST(BallJoint, ArmatureCarriesItsMomentum) {
  // Free of forces an inertia of I + a about each axis keeps ω, and its energy is ½ (I + a) ω².
  const double a = 2e-3;
  for (unsigned seed = 0; seed < 6; ++seed) {
    RandomSource random(seed);
    const Vector3 theta = random.Uniform(1.6, 3.0) * random.Direction(), omega = 2 * random.Direction();
    const double energy = 0.5 * (kSpinnerInertia + a) * omega.squaredNorm();
    World world = MustStart(Spinner(0, a), theta, Rates(theta, omega));
    EXPECT_NEAR(world.mechanisms()[0].KineticEnergy(), energy, 1e-12 * energy) << "seed " << seed;
    for (int i = 0; i < 120; ++i) world.Step(SecondOrder());
    // Of second order in the turn of a step, 0.03 rad.
    EXPECT_NEAR(world.mechanisms()[0].KineticEnergy(), energy, 2e-4 * energy) << "seed " << seed;
    EXPECT_LT((BodyRate(world) - omega).norm(), 1e-4 * omega.norm()) << "seed " << seed;
  }
}

TEST(BallJoint, DryFrictionSlowsEachComponentEvenly) {
  MechanismDef def = Spinner(0, 0);
  const double torque = 1e-3, time = 0.5;
  for (int k = 0; k < 3; ++k)
    def.frictions.push_back({"f" + std::to_string(k), {{FreedomRef{JointIndex(0), k}, 1.0}}, torque, {}});
  for (unsigned seed = 0; seed < 4; ++seed) {
    RandomSource random(seed);
    const Vector3 theta = random.Uniform(1.6, 3.0) * random.Direction(), omega(2, -1.5, 0.2);
    World world = MustStart(def, theta, Rates(theta, omega));
    for (int i = 0; i < 60; ++i) world.Step(SecondOrder(time / 60));
    // Torques ∓1e-3 N·m take 1 rad/s² off each component until that rests.
    EXPECT_LT((BodyRate(world) - Vector3(1.5, -1, 0)).norm(), 0.02) << "seed " << seed;
  }
}

TEST(BallJoint, KineticEnergyIsThatOfTheBodiesAndRotors) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    testing::RandomMechanismOptions options;
    options.bodies = 5;
    const auto m = Share(testing::RandomMechanismDef(seed, options));
    const VectorX q = testing::RandomCoordinates(*m, seed, 1.2),
                  q_dot = RandomSource(seed).Vector(m->num_coordinates(), 1);
    World world = MustStart(m->definition(), q, q_dot);
    const MechanismDynamics& dynamics = world.mechanisms()[0];
    if (dynamics.model().num_coordinates() != dynamics.model().size()) continue;  // joint rates are not kept
    double energy = 0.5 * m->armature().dot((testing::JointVelocityMap(*m, q) * q_dot).cwiseAbs2());
    for (int b = 0; b < m->num_bodies(); ++b) {
      const SpatialInertia& I = m->body(BodyIndex(b)).inertia_B;
      const RigidTransform X = dynamics.BodyPose(BodyIndex(b));
      const Vector6 V = dynamics.BodyVelocity(BodyIndex(b));
      const Vector3 w = X.rotation().transpose() * V.head<3>(), v = X.rotation().transpose() * V.tail<3>();
      energy += 0.5 * I.mass * (v + w.cross(I.center)).squaredNorm() + 0.5 * w.dot(I.rotational * w);
    }
    EXPECT_NEAR(dynamics.KineticEnergy(), energy, 1e-10 * energy) << "seed " << seed;
  }
}

// A servo along one component of the rotation vector, at its bound for most of the time.
TEST(BallJoint, ABoundedServoWithDamperGivesNoEnergy) {
  for (const double stiffness : {0.1, 10.0, 1e3})
    for (const double bound : {5e-4, 2e-3})
      for (const double h : {1.0 / 60, 1.0 / 240})
        for (int component = 0; component < 3; ++component) {
          SCOPED_TRACE(::testing::PrintToString(stiffness) + " N m/rad, bound " +
                       ::testing::PrintToString(bound) + ", h " + ::testing::PrintToString(h) +
                       ", component " + std::to_string(component));
          MechanismDef def = Spinner(0, 0);
          def.bodies[1].inertia.rotational = Vector3(0.5, 1, 1.2).asDiagonal() * kSpinnerInertia;
          const std::vector<std::pair<FreedomRef, double>> terms = {
              {FreedomRef{JointIndex(0), component}, 1.0}};
          ControlDef target;
          target.name = "servo";
          target.terms = terms;
          target.gain = stiffness;
          target.is_setpoint = true;
          target.initial = 0.5;
          def.controls.push_back(target);
          const double damping = std::sqrt(stiffness * kSpinnerInertia);
          def.springs.push_back({"servo", terms, stiffness, damping, 0, {}});
          ForceLimitDef limit;
          limit.name = "servo";
          limit.terms = terms;
          limit.inputs.emplace_back("servo", 1.0);
          limit.stiffness = stiffness;
          limit.damping = damping;
          limit.lower = -bound;
          limit.upper = bound;
          def.force_limits.push_back(limit);
          World world = MustStart(def, Vector3(0.2, 1.2, -0.7), Vector3(1, 2, -1));
          StepOptions step = Still(h);
          step.integrator = Integrator::kTwoStage;
          const auto energy = [&] { return world.KineticEnergy() + world.PotentialEnergy(step.gravity); };
          world.mechanisms()[0].controls()(0) = target.initial;
          const double start = energy();
          double most_kinetic = world.KineticEnergy(), most = start;
          int at_bound = 0;
          for (int i = 0; i * h < 1; ++i) {
            const StepReport report = world.Step(step);
            ASSERT_TRUE(report.finite);
            at_bound += report.forces_at_bound;
            most = std::max(most, energy());
            most_kinetic = std::max(most_kinetic, world.KineticEnergy());
          }
          EXPECT_GT(at_bound, 0);
          // It turns by 0.1 rad a step of 1/60 s, where SDIRK2 gains 1e-3; it falls with the square of the
          // step.
          EXPECT_LT(most - start, 2e-3 * std::pow(60 * h, 2) * most_kinetic);
        }
}

// A rotation vector that something acts on is no longer replaced by the one of the same pose below half a
// turn.
TEST(BallJoint, ASpringOnTheRotationVectorKeepsItsEnergyBeyondHalfATurn) {
  enum class Element { kSecondFreedom, kTendon, kServo };
  for (const Element element : {Element::kSecondFreedom, Element::kTendon, Element::kServo})
    for (const double stiffness : {1e-5, 1e-4, 3e-4})
      for (const double h : {1.0 / 60, 1.0 / 240})
        for (const Integrator integrator : {Integrator::kTwoStage}) {
          SCOPED_TRACE(std::to_string(static_cast<int>(element)) + ", " +
                       ::testing::PrintToString(stiffness) + " N m/rad, h " + ::testing::PrintToString(h) +
                       ", " + Name(integrator));
          MechanismDef def = Spinner(0, 0);
          const std::vector<std::pair<FreedomRef, double>> terms = {{FreedomRef{JointIndex(0), 1}, 1.0}};
          if (element == Element::kSecondFreedom) def.joints[0].freedoms[1].stiffness = stiffness;
          if (element == Element::kTendon) def.springs.push_back({"tendon", terms, stiffness, 0, 0, {}});
          if (element == Element::kServo) {
            ControlDef servo;
            servo.name = "servo";
            servo.terms = terms;
            servo.gain = stiffness;
            servo.is_setpoint = true;
            def.controls.push_back(servo);
            def.springs.push_back({"servo", terms, stiffness, 0, 0, {}});
          }
          // Turns to 4 rad and no farther: the energy at the start carries it to ω sqrt(I/k) at least.
          World world =
              MustStart(def, Vector3::Zero(), Vector3(0, 4 * std::sqrt(stiffness / kSpinnerInertia), 0));
          StepOptions step = Still(h);
          step.integrator = integrator;
          const double start = world.KineticEnergy() + world.PotentialEnergy(step.gravity);
          double largest_angle = 0, largest_error = 0;
          for (int i = 0; i < 200; ++i) {
            world.Step(step);
            largest_angle = std::max(largest_angle, world.mechanisms()[0].configuration().q.norm());
            largest_error = std::max(
                largest_error,
                std::abs(world.KineticEnergy() + world.PotentialEnergy(step.gravity) - start) / start);
          }
          if (200 * h > 1.6 / std::sqrt(stiffness / kSpinnerInertia)) {
            EXPECT_NEAR(largest_angle, 4, 0.05);
          }
          EXPECT_LT(largest_error,
                    1e-2);  // of the linear oscillator; 0.17 where the vector was replaced at half a turn
        }
}

}  // namespace
}  // namespace fork1s
