#include "support.hpp"

#include <gtest/gtest.h>
#include <numbers>

#include "linalg/spectrum.hpp"

namespace fork1s::mechanism_test {
namespace {

// Sums over eight bodies of up to 2 kg some metres away: 1e-16 * 8 * 2 * 10², with room.
constexpr double kInertiaRounding = 1e-12;

Matrix6 BodyInertia(const Mechanism& m, const Kinematics& k, int b) {
  // Ad⁻ᵀ I Ad⁻¹, another method than the one the library takes.
  const Matrix6 Ad = Adjoint(k.X_RB[static_cast<std::size_t>(b)].inverse());
  return Ad.transpose() * m.body(BodyIndex(b)).inertia_B.Matrix() * Ad;
}

TEST(MassMatrix, IsTheSumOverBodies) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    for (double size : {0.0, 0.5, 2.0}) {
      const VectorX q = RandomCoordinates(m, seed, size);
      const Kinematics k = At(m, q);
      const MatrixX map = JointVelocityMap(m, q);
      MatrixX expected = map.transpose() * m.armature().asDiagonal() * map;
      Matrix6 base = Matrix6::Zero();
      Matrix6X coupling = Matrix6X::Zero(6, m.num_coordinates());
      for (int b = 0; b < m.num_bodies(); ++b) {
        const Matrix6X J = BodyJacobian(m, k, BodyIndex(b));
        const Matrix6 I = BodyInertia(m, k, b);
        expected += J.transpose() * I * J;
        base += I;
        coupling += I * J;
      }
      const double scale = 1 + expected.cwiseAbs().maxCoeff() + base.cwiseAbs().maxCoeff();
      MatrixX M;
      MassMatrix(m, k, M);
      EXPECT_LE((M - expected).cwiseAbs().maxCoeff(), kInertiaRounding * scale) << "seed " << seed;
      EXPECT_LE((M - M.transpose()).cwiseAbs().maxCoeff(), kInertiaRounding * scale);
      EXPECT_GT(EigenvaluesOf(M)(0), 0) << "seed " << seed;

      Matrix6 M_00;
      Matrix6X M_0q;
      BaseInertia(m, k, M_00, M_0q);
      EXPECT_LE((M_00 - base).cwiseAbs().maxCoeff(), kInertiaRounding * scale);
      EXPECT_LE((M_0q - coupling).cwiseAbs().maxCoeff(), kInertiaRounding * scale);

      RandomSource random(seed);
      const VectorX x = random.Vector(m.num_coordinates(), 1);
      VectorX Mx;
      ApplyMass(m, k, x, Mx);
      EXPECT_LE((Mx - expected * x).cwiseAbs().maxCoeff(), kInertiaRounding * scale) << "seed " << seed;
    }
  }
}

TEST(MassMatrix, ReferenceInertiasAreThoseOfTheReferencePose) {
  const Mechanism m = RandomMechanism(5);
  const Kinematics k = At(m, VectorX::Zero(m.num_coordinates()));
  double mass = 0;
  for (int b = 0; b < m.num_bodies(); ++b) {
    EXPECT_LE((m.body(BodyIndex(b)).inertia_R0.Matrix() - BodyInertia(m, k, b)).norm(), kInertiaRounding);
    mass += m.body(BodyIndex(b)).inertia_B.mass;
  }
  EXPECT_NEAR(m.total_mass(), mass, kInertiaRounding);
}

// Two uniform rods of 1 kg and 1 m, elbow at 90 degrees, 100 N·m/rad in both joints.
Mechanism RightAngledArm() {
  MechanismBuilder builder("arm");
  SpatialInertia rod{1, Vector3(0.5, 0, 0), Vector3(0, 1.0 / 12, 1.0 / 12).asDiagonal()};
  const RigidTransform elbow(ExpRotation(Vector3(0, 0, 0.5 * std::numbers::pi)), Vector3(1, 0, 0));
  const BodyIndex upper = builder.AddBody({"upper", builder.base(), RigidTransform(), rod, {}});
  const BodyIndex lower = builder.AddBody({"lower", upper, elbow, rod, {}});
  builder.AddJoint(JointDef::Hinge("shoulder", upper, Vector3::UnitZ()).WithSpring(100));
  builder.AddJoint(JointDef::Hinge("elbow", lower, Vector3::UnitZ()).WithSpring(100));
  return BuildOrThrow(builder.definition());
}

TEST(MassMatrix, OfARightAngledArmHasItsKnownFrequencies) {
  const Mechanism arm = RightAngledArm();
  const Kinematics k = At(arm, Vector2::Zero());
  MatrixX M;
  MassMatrix(arm, k, M);
  // M11 = 1/3 + (1 + 1/4) + 1/12, M12 = M22 = 1/3 (the elbow's arm is square to the upper one).
  EXPECT_NEAR(M(0, 0), 5.0 / 3, 1e-15);
  EXPECT_NEAR(M(0, 1), 1.0 / 3, 1e-15);
  EXPECT_NEAR(M(1, 1), 1.0 / 3, 1e-15);
  const MatrixX K = StiffnessMatrix(arm, k, Vector2::Zero());
  const VectorX squares = EigenvaluesOf(K, M);
  EXPECT_NEAR(std::sqrt(squares(0)), 7.5693, 5e-5);  // as published, to its last digit
  EXPECT_NEAR(std::sqrt(squares(1)), 19.8168, 5e-5);
}

TEST(Stiffness, OfARightAngledArmAtItsTip) {
  // Tip at (1, 1): K_tip = J⁻ᵀ K J⁻¹ = [[100, 100], [100, 200]] N/m.
  const Mechanism arm = RightAngledArm();
  const Kinematics k = At(arm, Vector2::Zero());
  const Vector3 tip = k.X_RB[2] * Vector3(1, 0, 0);
  const Matrix6X J = BodyJacobian(arm, k, BodyIndex(2));
  const Eigen::Matrix2d J_tip = (J.bottomRows(3) - Skew(tip) * J.topRows(3)).topRows(2);
  const Eigen::Matrix2d from_tip = J_tip.inverse(), K = StiffnessMatrix(arm, k, Vector2::Zero());
  const Eigen::Matrix2d K_tip = from_tip.transpose() * K * from_tip;
  Eigen::Matrix2d expected;
  expected << 100, 100, 100, 200;
  EXPECT_LE((K_tip - expected).norm(), 1e-11);  // entries of 100 through two inverses
}

}  // namespace
}  // namespace fork1s::mechanism_test
