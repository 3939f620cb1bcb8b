// The same numbers by the joint coordinates of the mechanism room, which knows no bodies' coordinates.
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <random_mechanism.hpp>

#include "linalg/solve.hpp"
#include "support.hpp"

namespace fork1s::reference_test {
namespace {

constexpr unsigned kSeeds = 20;

testing::RandomMechanismOptions Everything(unsigned seed) {
  testing::RandomMechanismOptions options;
  options.rigid_closures = seed % 3 ? 1 : 0;
  options.springy_closures = 1;
  options.couplings = 1;
  options.coupling_terms = 1;
  options.springs = 2;
  options.bent_springs = seed % 2 == 1;
  options.controls = 2;
  options.rest = true;
  return options;
}

// [M Aᵀ; A 0] [q̈; -λ] = [f; -Ȧ q̇] with all loads; Ȧ q̇ by difference along the motion.
VectorX ByJoints(const Mechanism& m, const VectorX& q, const VectorX& q_dot, const VectorX& u,
                 const Vector3& gravity_W) {
  Kinematics k(m);
  ComputeKinematics(m, q, k);
  const int n = m.num_coordinates(), c = m.num_constraints();
  MatrixX M, A, A_ahead;
  MassMatrix(m, k, M);
  ClosureJacobian(m, k, q, A);
  VectorX f, tau = VectorX::Zero(n);
  SpringForce(m, k, q, f);
  f -= DampingMatrix(m, k, q) * q_dot;
  AddControlForce(m, k, u, f);
  Matrix6X F = Matrix6X::Zero(6, m.num_bodies()), V = F, scratch = F;
  AddGravityWrenches(m, k, m.definition().X_WR.rotation().transpose() * gravity_W, F);
  SubtractVelocityWrenches(m, k, q, Vector6::Zero(), q_dot, VectorX::Zero(n), V, scratch, F);
  AccumulateGeneralizedForce(m, k.S, F, tau);
  SubtractArmatureForces(m, k, q, q_dot, VectorX::Zero(n), tau);
  constexpr double kStep = 1e-6;
  const VectorX ahead = q + kStep * q_dot, back = q - kStep * q_dot;
  MatrixX A_back;
  ComputeKinematics(m, ahead, k);
  ClosureJacobian(m, k, ahead, A_ahead);
  ComputeKinematics(m, back, k);
  ClosureJacobian(m, k, back, A_back);
  MatrixX K = MatrixX::Zero(n + c, n + c);
  K.topLeftCorner(n, n) = M;
  K.topRightCorner(n, c) = A.transpose();
  K.bottomLeftCorner(c, n) = A;
  VectorX right(n + c);
  right << f + tau, -(A_ahead - A_back) * q_dot / (2 * kStep);
  return LeastNormSolve(K, right, 1e-13).col(0).head(n);
}

// Relative distance of the two accelerations from a random state with rates up to `speed`.
double AccelerationError(unsigned seed, const testing::RandomMechanismOptions& options, double speed) {
  MechanismDef def = testing::RandomMechanismDef(seed, options);
  def.interfaces.clear();
  const auto m = testing::Share(def);
  testing::RandomSource random(seed);
  const Vector3 gravity(1, -2, -9);
  Scene scene = Of(m->definition(), gravity);
  StartAt(scene, random.Vector(m->num_coordinates(), 0.2), random.Vector(m->num_coordinates(), speed));
  const VectorX u = random.Vector(static_cast<int>(m->controls().size()), 1);
  auto acceleration = [&](double h) {
    FullSimulation s = Start(scene, h);
    s.SetControls(u);
    const VectorX before = s.Rates(0);
    EXPECT_TRUE(s.Step().finite);
    return VectorX((s.Rates(0) - before) / h);
  };
  FullSimulation s = Start(scene, 1);
  s.SetControls(u);
  const VectorX expected = ByJoints(*m, s.Displacements(0), s.Rates(0), s.controls(), gravity);
  const VectorX found = 2 * acceleration(2.5e-7) - acceleration(5e-7);
  return (found - expected).norm() / (1 + expected.norm());
}

// Stiff dampers make the step's own error 1e-3 of the acceleration at 5e-7 s; extrapolated to 0 its square is
// left, and rounding of the difference, 1e-16 / h of rates of size 1 with the conditioning of the loops.
constexpr double kExtrapolated = 1e-6;

TEST(TwoMethods, AccelerationFromRestUnderEveryLoad) {
  for (unsigned seed = 0; seed < kSeeds; ++seed)
    EXPECT_LT(AccelerationError(seed, Everything(seed), 0), kExtrapolated) << seed;
}

TEST(TwoMethods, AccelerationInMotion) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    EXPECT_LT(AccelerationError(seed, Everything(seed), 1), kExtrapolated) << seed;
  }
}

TEST(TwoMethods, PosesAreThoseOfTheJointDisplacements) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const auto m = testing::Share(testing::RandomMechanismDef(seed, Everything(seed)));
    Scene scene = Of(m->definition(), Vector3(0, 0, -9.81));
    scene.mechanisms[0].interfaces.clear();
    FullSimulation s = Start(scene, 1.0 / 240);
    for (int i = 0; i < 20; ++i) {
      const FullStepReport report = s.Step();
      ASSERT_TRUE(report.finite);
      EXPECT_LT(report.joint_gap, 1e-9) << i;
    }
    Kinematics k(*m);
    ComputeKinematics(*m, s.Displacements(0), k);
    const RigidTransform& X_WR = m->definition().X_WR;
    for (int b = 0; b < m->num_bodies(); ++b) {
      const RigidTransform expected = X_WR * k.X_RB[static_cast<std::size_t>(b)];
      // Rounding along a path of a dozen joints, times poses of some metres.
      EXPECT_LT((s.Pose(b).translation() - expected.translation()).norm(), 1e-11) << b;
      EXPECT_LT((s.Pose(b).rotation() - expected.rotation()).norm(), 1e-11) << b;
    }
  }
}

TEST(TwoMethods, FrequenciesOfRandomMechanisms) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    auto options = Everything(seed);
    options.base = seed % 2 ? BaseKind::kFloating : BaseKind::kFixed;
    const auto m = testing::Share(testing::RandomMechanismDef(seed, options));
    Scene scene = Of(m->definition());
    scene.mechanisms[0].interfaces.clear();
    FullSimulation s = Start(scene, 1.0 / 60);
    const auto found = s.Frequencies(0, 6), expected = FullFrequencies(*m, s.Displacements(0), 6);
    ASSERT_EQ(found.size(), expected.size());
    // Squares are right to 1e-15 of the largest, which light bodies on stiff joints raise to 1e9 times the
    // lowest.
    for (std::size_t i = 0; i < found.size(); ++i)
      EXPECT_NEAR(found[i], expected[i], 2e-6 * expected[i]) << i;
  }
}

TEST(Frequencies, TwoLinkArm) {
  // docs/validation.md: elbow at a right angle, 7.5693 and 19.8168 rad/s.
  MechanismDef def = testing::Chain(2, 1, 1, 100);
  def.bodies[2].X_PB.rotation() = Eigen::AngleAxisd(M_PI / 2, Vector3::UnitZ()).matrix();
  FullSimulation s = Start(Of(def), 0.01);
  const auto hertz = s.Frequencies(0);
  ASSERT_EQ(hertz.size(), 2u);
  // Half a unit of the last digit given.
  EXPECT_NEAR(2 * M_PI * hertz[0], 7.5693, 5e-5);
  EXPECT_NEAR(2 * M_PI * hertz[1], 19.8168, 5e-5);
}

}  // namespace
}  // namespace fork1s::reference_test
