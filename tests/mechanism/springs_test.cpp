#include "support.hpp"

#include <gtest/gtest.h>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "linalg/spectrum.hpp"
#include "mechanism/coordinate_scaling.hpp"

namespace fork1s::mechanism_test {
namespace {

TEST(SpringForce, IsMinusTheSlopeOfTheEnergy) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    for (double size : {0.0, 1e-6, 0.3, 0.8}) {
      const VectorX q = RandomCoordinates(m, seed, size);
      const Kinematics k = At(m, q);
      VectorX tau;
      SpringForce(m, k, q, tau);
      const double scale = 1 + SpringEnergy(m, k, q) + tau.norm();  // up to 1000 J and more
      Differentiate(
          q, [&](const VectorX& p) { return MatrixX::Constant(1, 1, SpringEnergy(m, At(m, p), p)); },
          [&](Eigen::Index i, const MatrixX& slope) {
            EXPECT_NEAR(tau(i), -slope(0, 0), 10 * kDifference * scale) << "seed " << seed;
          });
    }
  }
}

TEST(SpringForce, VanishesWhereEverythingIsUnloaded) {
  RandomMechanismOptions options = Everything();
  options.rest = false;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, options);
    const VectorX q = VectorX::Zero(m.num_coordinates());
    VectorX tau;
    SpringForce(m, At(m, q), q, tau);
    // Closing frames coincide to 1e-15; times 200 N/m.
    EXPECT_LE(tau.norm(), 1e-11);
    EXPECT_LE(SpringEnergy(m, At(m, q), q), 1e-20);
  }
}

// k (ℓ - end) + k₂ (ℓ - end)² + k₃ (ℓ - end)³ beyond either end of its range, and nothing within.
TEST(SpringForce, OfASlackSpring) {
  Mechanism::Spring s;
  s.stiffness = 9;
  s.higher_stiffness = {2, 5};
  s.rest = 0.1;
  s.slack = 0.2;
  EXPECT_FALSE(s.is_linear());
  for (const auto& [at, beyond, side] :
       {std::tuple(-0.2, -0.3, -1), {0.1, 0.0, 0}, {0.2, 0.0, 0}, {0.6, 0.3, 1}}) {
    EXPECT_EQ(s.SideOf(at), side) << at;
    EXPECT_NEAR(s.Force(at), -(9 * beyond + 2 * beyond * beyond + 5 * std::pow(beyond, 3)), 1e-15) << at;
    EXPECT_NEAR(s.Energy(at),
                4.5 * beyond * beyond + 2 * std::pow(beyond, 3) / 3 + 5 * std::pow(beyond, 4) / 4, 1e-15);
    EXPECT_NEAR(s.StiffnessAt(at), side == 0 ? 0 : 9 + 4 * beyond + 15 * beyond * beyond, 1e-14) << at;
  }
}

TEST(StiffnessMatrix, IsMinusTheSlopeOfTheForceAtTheReference) {
  // Springy closures are unloaded there, so nothing geometric adds to A'KA.
  RandomMechanismOptions options = Everything();
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, options);
    const VectorX q = VectorX::Zero(m.num_coordinates());
    const MatrixX K = StiffnessMatrix(m, At(m, q), q);
    auto force = [&](const VectorX& p) {
      VectorX tau;
      SpringForce(m, At(m, p), p, tau);
      return tau;
    };
    Differentiate(q, force, [&](Eigen::Index i, const MatrixX& slope) {
      EXPECT_LE((K.col(i) + slope).norm(), 10 * kDifference * (1 + K.norm())) << "seed " << seed;
    });
  }
}

TEST(StiffnessMatrix, AndDampingAreSymmetricAndNowhereNegative) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    const VectorX q = RandomCoordinates(m, seed);
    const Kinematics k = At(m, q);
    for (const MatrixX& A : {StiffnessMatrix(m, k, q), DampingMatrix(m, k, q)}) {
      const double rounding = 1e-13 * A.norm();  // sums of outer products
      EXPECT_LE((A - A.transpose()).cwiseAbs().maxCoeff(), rounding);
      EXPECT_GE(EigenvaluesOf(A)(0), -rounding);
    }
  }
}

TEST(StiffnessMatrix, IsTheSquareOfItsRowsInOneUnit) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    RandomMechanismOptions options = Everything();
    options.unsprung = 0.2;
    const Mechanism m = RandomMechanism(seed, options);
    const VectorX q = RandomCoordinates(m, seed);
    const Kinematics k = At(m, q);
    const CoordinateScaling unit = ComputeCoordinateScaling(m, k);
    const SpringRows springs = ScaledSpringRows(m, k, q, unit);
    const MatrixX K = StiffnessMatrix(m, k, q), R = springs.weight.asDiagonal() * springs.rows *
                                                    unit.coordinate.cwiseInverse().asDiagonal();
    EXPECT_LE((R.transpose() * R - K).norm(), 1e-13 * K.norm());  // sums of outer products
  }
}

TEST(DampingMatrix, IsTheStiffnessMatrixOfTheDampersOnJointVelocities) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    MechanismDef def = RandomMechanismDef(seed, Everything());
    const Mechanism m = BuildOrThrow(def);
    for (JointDef& j : def.joints)
      for (FreedomDef& f : j.freedoms) std::swap(f.stiffness, f.damping);
    for (SpringDef& s : def.springs) {
      std::swap(s.stiffness, s.damping);
      s.higher_stiffness = {};
    }
    for (ClosureDef& c : def.closures) std::swap(c.stiffness, c.damping);
    const Mechanism swapped = BuildOrThrow(def);
    const VectorX q = RandomCoordinates(m, seed);
    const Kinematics k = At(m, q);
    def.closures.clear();
    const MatrixX all = StiffnessMatrix(swapped, k, q), of_joints = StiffnessMatrix(BuildOrThrow(def), k, q),
                  map = JointVelocityMap(m, q),
                  expected = all - of_joints + map.transpose() * of_joints * map;
    EXPECT_LE((DampingMatrix(m, k, q) - expected).norm(), 1e-13 * expected.norm()) << "seed " << seed;
  }
}

TEST(DampingMatrix, SeesClosuresThatOnlyDamp) {
  MechanismDef def = RandomMechanismDef(4);
  ClosureDef damper;
  damper.name = "damper";
  damper.body_a = BodyIndex(0);
  damper.body_b = BodyIndex(1);
  damper.damping(5) = 3;
  def.closures.push_back(damper);
  const Mechanism m = BuildOrThrow(def);
  def.closures.clear();
  const Mechanism without = BuildOrThrow(def);
  const VectorX q = RandomCoordinates(m, 4);
  const MatrixX D = DampingMatrix(m, At(m, q), q);
  EXPECT_GT((D - DampingMatrix(without, At(m, q), q)).norm(), 0.01);
  EXPECT_EQ(StiffnessMatrix(m, At(m, q), q), StiffnessMatrix(without, At(m, q), q));
}

TEST(StiffnessMatrix, ShapeIsToldRightly) {
  RandomMechanismOptions options;
  const Mechanism tree = RandomMechanism(1, options);
  EXPECT_TRUE(tree.is_tree());
  EXPECT_TRUE(tree.has_diagonal_stiffness());
  options.springs = 1;
  EXPECT_FALSE(RandomMechanism(1, options).has_diagonal_stiffness());
  options.springs = 0;
  options.springy_closures = 1;
  EXPECT_FALSE(RandomMechanism(1, options).has_diagonal_stiffness());
  EXPECT_FALSE(RandomMechanism(1, options).is_tree());
  EXPECT_EQ(RandomMechanism(1, options).num_constraints(), 0);
}

TEST(ControlForce, OfASetpointBalancesTheSpringThere) {
  // A servo of gain k on a joint of stiffness k holds the joint at u.
  MechanismDef def = RandomMechanismDef(6);
  RandomSource random(6);
  for (std::size_t j = 0; j < def.joints.size(); ++j)
    for (std::size_t f = 0; f < def.joints[j].freedoms.size(); ++f) {
      ControlDef c;
      c.name = "servo";
      c.terms = {{FreedomRef{JointIndex(j), static_cast<int>(f)}, 1.0}};
      c.gain = def.joints[j].freedoms[f].stiffness;
      c.is_setpoint = true;
      def.controls.push_back(c);
    }
  for (double factor : {1.0, 1e-3, 1e6}) {
    const Mechanism m = BuildOrThrow(ScaleStiffness(def, factor));
    const VectorX u = random.Vector(m.num_coordinates(), 1);
    VectorX tau;
    SpringForce(m, At(m, u), u, tau);
    AddControlForce(m, At(m, u), u, tau);
    EXPECT_LE(tau.norm(), 1e-13 * m.stiffness().norm());  // k u - k u
  }
}

TEST(ControlForce, SumsTermsAndControls) {
  RandomMechanismOptions options;
  options.controls = 4;
  const Mechanism m = RandomMechanism(8, options);
  RandomSource random(8);
  const VectorX u = random.Vector(4, 2), q = RandomCoordinates(m, 8, 1);
  VectorX tau = VectorX::Ones(m.num_coordinates()), expected = tau;
  for (Eigen::Index c = 0; c < 4; ++c) {
    const ControlDef& control = m.definition().controls[static_cast<std::size_t>(c)];
    VectorX force = VectorX::Zero(q.size());
    for (const auto& [ref, w] : control.terms)
      force(m.joint(ref.joint).offset + ref.freedom) += control.gain * w * u(c);
    // Set points act on θ as springs do, motors on ω.
    expected += control.is_setpoint ? force : VectorX(JointVelocityMap(m, q).transpose() * force);
  }
  AddControlForce(m, At(m, q), u, tau);
  EXPECT_LE((tau - expected).norm(), 1e-13 * expected.norm());
}

// A muscle on a hinge, of length 0.1 q.
Mechanism MuscleOnHinge() {
  MechanismBuilder builder("arm");
  const BodyIndex body =
      builder.AddBody({"link", builder.base(), {}, {1, Vector3::Zero(), Matrix3::Identity() * 0.1}, {}});
  const JointIndex hinge = builder.AddJoint(JointDef::Hinge("hinge", body, Vector3::UnitZ()));
  ControlDef control;
  control.name = "nerve";
  control.terms = {{FreedomRef{hinge, 0}, 0.1}};
  builder.AddControl(control);
  MechanismDef def = builder.definition();
  MuscleDef muscle;
  muscle.name = "flexor";
  muscle.terms = control.terms;
  muscle.control = control.name;
  muscle.force = 100;
  muscle.length_lower = -0.06, muscle.length_upper = 0.06;
  def.muscles = {muscle};
  return BuildOrThrow(def);
}

TEST(MuscleForce, DerivativesAreDifferences) {
  const Mechanism m = MuscleOnHinge();
  const Mechanism::Muscle& muscle = m.muscles()[0];
  const Mechanism::Spring& passive = m.PassivePart(0);
  constexpr double kStep = 1e-7;  // m and m/s: rounded to 1e-7 of a force of 100 N over 0.4 m
  int rising = 0, falling = 0;
  RandomSource random(3);
  for (int i = 0; i < 500; ++i) {
    const double at = random.Uniform(-0.25, 0.4), rate = random.Uniform(-0.8, 0.4);
    const double by_length = (muscle.Force(at + kStep, rate) - muscle.Force(at - kStep, rate)) / (2 * kStep);
    const double by_rate = (muscle.Force(at, rate + kStep) - muscle.Force(at, rate - kStep)) / (2 * kStep);
    // A kink of the slope within the difference: 8 F0/(optimum lmax - 1)² times the step.
    EXPECT_NEAR(muscle.ForceByLength(at, rate), by_length, 2e-2);
    EXPECT_NEAR(muscle.ForceByRate(at, rate), by_rate, 2e-2);
    EXPECT_LE(muscle.ForceByRate(at, rate), 0);
    EXPECT_NEAR(passive.StiffnessAt(at),
                (passive.Force(at - kStep) - passive.Force(at + kStep)) / (2 * kStep), 2e-2);
    EXPECT_NEAR(passive.Force(at), (passive.Energy(at - kStep) - passive.Energy(at + kStep)) / (2 * kStep),
                1e-4);
    rising += by_length<-1, falling += by_length> 1;
  }
  EXPECT_GT(std::min(rising, falling), 20);
  // At the optimum, by definition.
  EXPECT_NEAR(muscle.Force(muscle.zero + muscle.optimum, 0), -100, 1e-12);
  EXPECT_EQ(muscle.Force(muscle.zero + muscle.optimum, -1.5 * muscle.optimum), 0);
}

TEST(MuscleForce, StandsWithControlsAtRestAndWithTheRateBeyond) {
  const Mechanism m = MuscleOnHinge();
  const VectorX q = VectorX::Constant(1, 0.3), q_dot = VectorX::Constant(1, -2.0),
                a = VectorX::Constant(1, 0.7);
  const Mechanism::Muscle& muscle = m.muscles()[0];
  VectorX tau = VectorX::Zero(1);
  AddControlForce(m, At(m, q), a, tau);
  EXPECT_NEAR(tau(0), 0.1 * 0.7 * muscle.Force(0.03, 0), 1e-14);
  AddMuscleRateForce(m, At(m, q), a, q_dot, tau);
  EXPECT_NEAR(tau(0), 0.1 * 0.7 * muscle.Force(0.03, -0.2), 1e-14);
  EXPECT_LT(tau(0), -0.1);
}

TEST(ScaleStiffness, ScalesSpringsDampersAndServosAlike) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const MechanismDef def = RandomMechanismDef(seed, Everything());
    const Mechanism m = BuildOrThrow(def), scaled = BuildOrThrow(ScaleStiffness(def, 4));
    const VectorX q = RandomCoordinates(m, seed);
    const Kinematics k = At(m, q);
    // Powers of two scale without rounding.
    EXPECT_EQ(StiffnessMatrix(scaled, k, q), 4 * StiffnessMatrix(m, k, q));
    EXPECT_EQ(DampingMatrix(scaled, k, q), 2 * DampingMatrix(m, k, q));
    EXPECT_EQ(SpringEnergy(scaled, k, q), 4 * SpringEnergy(m, k, q));
    EXPECT_EQ(scaled.armature(), m.armature());
    for (std::size_t i = 0; i < def.controls.size(); ++i)
      EXPECT_EQ(scaled.controls()[i].gain, (def.controls[i].is_setpoint ? 4 : 1) * def.controls[i].gain);
  }
}

TEST(ScaleStiffness, RefusesFactorsThatMakeNoSprings) {
  const MechanismDef def = RandomMechanismDef(1);
  EXPECT_THROW(ScaleStiffness(def, -1), std::invalid_argument);
  EXPECT_THROW(ScaleStiffness(def, NAN), std::invalid_argument);
  EXPECT_THROW(ScaleStiffness(def, INFINITY), std::invalid_argument);
  EXPECT_NO_THROW(ScaleStiffness(def, 0));
}

}  // namespace
}  // namespace fork1s::mechanism_test
