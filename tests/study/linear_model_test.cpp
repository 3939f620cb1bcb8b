// Equations of motion to first order, of random mechanisms: by differences of poses and of energy, by statics.
#include "study/linear_model.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/reduction/compliance.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

namespace fork1s {
namespace {

using testing::RandomSource;

constexpr unsigned kSeeds = 12;

PosedMechanism RandomPosed(unsigned seed, BaseKind base) {
  testing::RandomMechanismOptions options;
  options.bodies = 8;
  options.base = base;
  options.rest = true;
  options.controls = 2;
  options.springs = 1;
  options.rigid_closures = seed % 2 == 0 ? 1 : 0;
  MechanismDef definition = testing::RandomMechanismDef(seed, options);
  RandomSource random(seed + 1000);
  definition.X_WR = random.Pose(1);
  PosedMechanism posed;
  posed.mechanism = testing::Share(definition);
  posed.X_WR = definition.X_WR;
  posed.q = random.Vector(posed.mechanism->num_coordinates(), 0.1);
  CloseLoops(*posed.mechanism, posed.q);
  posed.loads.gravity_R = posed.X_WR.rotation().transpose() * Vector3(1, 2, -9.81);
  posed.loads.controls = random.Vector(static_cast<int>(posed.mechanism->controls().size()), 0.5);
  return posed;
}

// The mechanism with its coordinates displaced from the start by p, loops closed.
struct Displaced {
  Displaced(const PosedMechanism& posed, const ReducedModel& model, const VectorX& p) : configuration(model) {
    ReducedState state;
    state.z = p.head(model.size());
    state.w = VectorX::Zero(model.size());
    state.X_WR = X_WR = posed.X_WR;
    if (p.size() > model.size()) {
      const Vector6 base = p.tail<6>();
      X_WR = {Matrix3(ExpRotation(base.head<3>()) * X_WR.rotation()),
              Vector3(X_WR.translation() + base.tail<3>())};
    }
    Configure(model, state, configuration);
  }
  RigidTransform Pose(BodyIndex body) const { return X_WR * configuration.kinematics.X_RB[body.u()]; }

  // Of springs, weight and controls.
  double Energy(const PosedMechanism& posed) const {
    const Mechanism& m = *posed.mechanism;
    const Vector3 gravity_W = posed.X_WR.rotation() * posed.loads.gravity_R;
    double energy = SpringEnergy(m, configuration.kinematics, configuration.q);
    for (int b = 0; b < m.num_bodies(); ++b) {
      const Mechanism::Body& body = m.body(BodyIndex(b));
      energy -= body.weighed_mass * gravity_W.dot(Pose(BodyIndex(b)) * body.inertia_B.center);
    }
    for (std::size_t k = 0; k < m.controls().size(); ++k)
      energy -= posed.loads.controls(static_cast<Eigen::Index>(k)) * ControlLength(m, k);
    return energy;
  }
  // Times the gain: what a unit of the control does work along.
  double ControlLength(const Mechanism& m, std::size_t k) const {
    return m.controls()[k].gain *
           LengthOf(m, m.controls()[k].length, configuration.kinematics, configuration.q);
  }

  Configuration configuration;
  RigidTransform X_WR;
};

Vector6 Difference(const RigidTransform& to, const RigidTransform& from) {
  Vector6 out;
  out << LogRotation(to.rotation() * from.rotation().transpose()), to.translation() - from.translation();
  return out;
}

TEST(LinearModel, IsTheDerivativeOfPosesLengthsAndEnergy) {
  // Central differences: their error is of the order h², 1e-8, times third derivatives; rounding leaves 1e-12.
  constexpr double kChange = 1e-4, kTolerance = 1e-6;
  unsigned with_potential = 0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const PosedMechanism posed = RandomPosed(seed, seed % 3 == 0 ? BaseKind::kFixed : BaseKind::kFloating);
    const Mechanism& m = *posed.mechanism;
    const auto reduced = ReduceAtStart(posed);
    ASSERT_TRUE(reduced) << reduced.error().Text();
    const LinearModel linear = ComputeLinearModel(posed, *reduced);
    const Eigen::Index s = linear.M.rows();
    ASSERT_EQ(s, reduced->size() + (m.base() == BaseKind::kFloating ? 6 : 0));
    // Coordinates are scaled by their stiffness: displacements of the order 1/√K.
    const double size = std::max(1.0, linear.C.cwiseAbs().maxCoeff());
    // Controls of ball joints act on the angular velocity, which is the rate of no length.
    const bool has_potential =
        std::all_of(m.controls().begin(), m.controls().end(),
                    [&](const Mechanism::Control& c) { return m.HasPotential(c.length); });
    with_potential += has_potential;
    for (Eigen::Index k = 0; k < s; ++k) {
      SCOPED_TRACE(linear.coordinates.names[static_cast<std::size_t>(k)]);
      const VectorX p = kChange * VectorX::Unit(s, k);
      const Displaced plus(posed, *reduced, p), minus(posed, *reduced, -p);
      for (std::size_t i = 0; i < reduced->interfaces.size(); ++i) {
        const BodyIndex body = reduced->interfaces[i];
        const Vector6 moved = Difference(plus.Pose(body), minus.Pose(body)) / (2 * kChange);
        EXPECT_LT((linear.C.block<6, 1>(6 * static_cast<Eigen::Index>(i), k) - moved).norm(),
                  kTolerance * size);
      }
      const VectorX q = (plus.configuration.q - minus.configuration.q) / (2 * kChange);
      EXPECT_LT((linear.C.col(k).tail(q.size()) - q).norm(), kTolerance * size);
      for (std::size_t i = 0; i < m.controls().size(); ++i) {
        const double work = (plus.ControlLength(m, i) - minus.ControlLength(m, i)) / (2 * kChange);
        if (m.HasPotential(m.controls()[i].length)) {
          EXPECT_NEAR(linear.B(k, static_cast<Eigen::Index>(i)), work, kTolerance * (size + std::abs(work)));
        }
      }
      if (!has_potential) continue;
      const double force = -(plus.Energy(posed) - minus.Energy(posed)) / (2 * kChange);
      EXPECT_NEAR(linear.f(k), force, kTolerance * (linear.f.norm() + size));
    }
  }
  EXPECT_GE(with_potential, kSeeds / 2);
}

TEST(LinearModel, StaticGainIsTheComplianceOfTheInterface) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const PosedMechanism posed = RandomPosed(seed, BaseKind::kFixed);
    const auto reduced = ReduceAtStart(posed);
    ASSERT_TRUE(reduced) << reduced.error().Text();
    const auto space = ToStateSpace(ComputeLinearModel(posed, *reduced));
    ASSERT_TRUE(space) << space.error().Text();
    const MatrixX C = WalkCompliance(*posed.mechanism, posed.q, reduced->interfaces).C;
    const LinearModel linear = ComputeLinearModel(posed, *reduced);
    const MatrixX gain = linear.C.topRows(C.rows()) * linear.B.rightCols(C.cols());  // K is 1
    ASSERT_EQ(reduced->num_free, 0);
    // What the interface feels less than 1e-4 of the most is no coordinate: the square of that of the compliance.
    EXPECT_LT((gain - C).norm(), 1e-8 * C.norm());
    // The same through A, which solves with the inertia.
    VectorX x = VectorX::Zero(space->A.rows());
    x.head(linear.M.rows()) = linear.B.rightCols(C.cols()).col(0);
    EXPECT_LE((space->A * x + space->B.col(linear.B.cols() - C.cols())).norm(),
              1e-9 * space->B.col(linear.B.cols() - C.cols()).norm());
  }
}

TEST(LinearModel, InertiaIsThatOfAllJoints) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const PosedMechanism posed = RandomPosed(seed, BaseKind::kFloating);
    const auto reduced = ReduceAtStart(posed);
    ASSERT_TRUE(reduced) << reduced.error().Text();
    const LinearModel linear = ComputeLinearModel(posed, *reduced);
    // Twice the kinetic energy of random rates, body by body in the world, and of armatures.
    const Eigen::Index s = linear.M.rows();
    const VectorX rates = RandomSource(seed).Vector(static_cast<int>(s), 1);
    constexpr double kChange = 1e-5;
    const Displaced plus(posed, *reduced, kChange * rates), minus(posed, *reduced, -kChange * rates),
        here(posed, *reduced, 0 * rates);
    double energy = 0;
    const Mechanism& m = *posed.mechanism;
    for (int b = 0; b < m.num_bodies(); ++b) {
      const SpatialInertia& I = m.body(BodyIndex(b)).inertia_B;
      const Vector3 v =
          (plus.Pose(BodyIndex(b)) * I.center - minus.Pose(BodyIndex(b)) * I.center) / (2 * kChange);
      const Vector6 V = Difference(plus.Pose(BodyIndex(b)), minus.Pose(BodyIndex(b))) / (2 * kChange);
      const Vector3 omega = here.Pose(BodyIndex(b)).rotation().transpose() * V.head<3>();
      energy += I.mass * v.squaredNorm() + omega.dot(I.rotational * omega);
    }
    const VectorX q_dot = (plus.configuration.q - minus.configuration.q) / (2 * kChange);
    VectorX nu(q_dot.size());
    ComputeJointVelocities(m, here.configuration.kinematics, q_dot, nu);
    energy += nu.dot(m.armature().cwiseProduct(nu));
    EXPECT_NEAR(rates.dot(linear.M * rates), energy, 1e-6 * energy);
  }
}

TEST(LinearModel, AMotionWithoutInertiaIsRefused) {
  LinearModel linear;
  linear.mechanism = "lamp";
  linear.M = linear.D = linear.K = MatrixX::Zero(1, 1);
  linear.B = MatrixX::Zero(1, 0);
  linear.C = MatrixX::Zero(0, 1);
  linear.f = VectorX::Zero(1);
  const auto space = ToStateSpace(linear);
  ASSERT_FALSE(space);
  EXPECT_EQ(space.error().code, ErrorCode::kNumerics);
  EXPECT_NE(space.error().Text().find("mechanism 'lamp': has a motion without inertia"), std::string::npos);
}

}  // namespace
}  // namespace fork1s
