#include "support.hpp"

#include <gtest/gtest.h>
#include <cmath>
#include <numbers>

namespace fork1s::mechanism_test {
namespace {

constexpr double kPi = std::numbers::pi;
// Products of up to ten poses of a few metres: 1e-16 * 10 * 5, with room.
constexpr double kPoseRounding = 1e-13;

TEST(Poses, OfATwoLinkArmInClosedForm) {
  const double l1 = 0.7, l2 = 0.4;
  MechanismBuilder builder("arm");
  SpatialInertia I{1.0, Vector3(0.2, 0, 0), Matrix3::Identity() * 0.01};
  const BodyIndex upper = builder.AddBody({"upper", builder.base(), RigidTransform(), I, {}});
  const BodyIndex lower = builder.AddBody({"lower", upper, RigidTransform(Vector3(l1, 0, 0)), I, {}});
  const BodyIndex tip = builder.AddBody({"tip", lower, RigidTransform(Vector3(l2, 0, 0)), {}, {}});
  builder.AddJoint(JointDef::Hinge("shoulder", upper, Vector3::UnitZ()));
  builder.AddJoint(JointDef::Hinge("elbow", lower, Vector3::UnitZ()));
  const Mechanism arm = BuildOrThrow(builder.definition());
  ASSERT_EQ(arm.num_coordinates(), 2);
  EXPECT_NEAR(arm.length_scale(), (l1 + l2) / 2, 1e-15);
  for (double a : {-7.0, -1.0, -1e-8, 0.0, 0.3, kPi / 2, kPi, 5.0})
    for (double b : {-2.0, 0.0, 1e-6, 1.0, kPi}) {
      const Kinematics k = At(arm, Vector2(a, b));
      const Vector3 p = k.X_RB[tip.u()].translation();
      EXPECT_LE(
          (p - Vector3(l1 * std::cos(a) + l2 * std::cos(a + b), l1 * std::sin(a) + l2 * std::sin(a + b), 0))
              .norm(),
          kPoseRounding);
      EXPECT_LE((LogRotation(k.X_RB[tip.u()].rotation()).cwiseAbs() -
                 Vector3(0, 0, std::abs(std::remainder(a + b, 2 * kPi))))
                    .norm(),
                10 * kPoseRounding);
    }
}

TEST(Poses, StackedJointsComposeFromTheParentOut) {
  MechanismBuilder builder("wrist");
  RandomSource random(1);
  const RigidTransform X_PB = random.Pose(0.3);
  const Vector3 anchor(0.1, -0.2, 0.05);
  const BodyIndex hand = builder.AddBody({"hand", builder.base(), X_PB, random.Inertia(), {}});
  builder.AddJoint(UniversalJoint("wrist", hand, Vector3::UnitX(), Vector3::UnitY(), anchor));
  builder.AddJoint(JointDef::Slide("reach", hand, Vector3(0, 0, 3)));  // axes need not have unit length
  const Mechanism m = BuildOrThrow(builder.definition());
  const RigidTransform turn(
      Matrix3(Eigen::AngleAxisd(0.4, Vector3::UnitX()) * Eigen::AngleAxisd(-1.1, Vector3::UnitY())),
      Vector3::Zero());
  const RigidTransform expected = X_PB * RigidTransform(anchor) * turn * RigidTransform(Vector3(-anchor)) *
                                  RigidTransform(Vector3(0, 0, 0.25));
  const Kinematics k = At(m, Vector3(0.4, -1.1, 0.25));
  EXPECT_LE((PoseMatrix(k.X_RB[1]) - PoseMatrix(expected)).norm(), kPoseRounding);
}

TEST(Poses, AreProductsOfExponentialsInTheBodyFrames) {
  // X_PB(q) = X_PB0 Π Exp(Σ screw_B q), straight from the definition.
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    const MechanismDef& def = m.definition();
    const VectorX q = RandomCoordinates(m, seed, 2.0);
    const Kinematics k = At(m, q);
    for (std::size_t b = 1; b < def.bodies.size(); ++b) {
      RigidTransform X = k.X_RB[def.bodies[b].parent.u()] * def.bodies[b].X_PB;
      for (const Mechanism::Joint& joint : m.joints()) {
        if (joint.body.u() != b) continue;
        Vector6 x = Vector6::Zero();
        const JointDef& j = def.joints[m.definition().FindJoint(joint.name).u()];
        for (int i = 0; i < joint.size; ++i)
          x += j.freedoms[static_cast<std::size_t>(i)].screw_B * q(joint.offset + i);
        X = X * Exp(x);
      }
      EXPECT_LE((PoseMatrix(X) - PoseMatrix(k.X_RB[b])).norm(), 10 * kPoseRounding) << "seed " << seed;
    }
  }
}

TEST(Poses, AtTheReferenceAreTheReference) {
  const Mechanism m = RandomMechanism(3, Everything());
  const Kinematics k = At(m, VectorX::Zero(m.num_coordinates()));
  for (std::size_t b = 0; b < m.bodies().size(); ++b)
    EXPECT_EQ(PoseMatrix(k.X_RB[b]), PoseMatrix(m.bodies()[b].X_RB0));
  EXPECT_EQ(k.S, m.screws());
}

TEST(Poses, DoNotDependOnTheOrderInWhichJointsWereAdded) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    RandomMechanismOptions options;
    MechanismDef shuffled = RandomMechanismDef(seed, options);
    const Mechanism m = BuildOrThrow(shuffled);
    RandomSource random(seed);
    // Move one body's joints to the end; its own joints stay in their order.
    const BodyIndex body = shuffled.joints[static_cast<std::size_t>(random.Below(m.num_joints()))].body;
    std::stable_partition(shuffled.joints.begin(), shuffled.joints.end(),
                          [&](const JointDef& j) { return j.body != body; });
    const Mechanism again = BuildOrThrow(shuffled);
    const VectorX q = RandomCoordinates(m, seed);
    EXPECT_EQ(m.screws(), again.screws());
    EXPECT_EQ(At(m, q).S, At(again, q).S);
  }
}

TEST(Poses, FreedomReferencesFollowSortedJoints) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    RandomMechanismOptions options = Everything();
    options.joints_in_order = false;
    const MechanismDef def = RandomMechanismDef(seed, options);
    const Mechanism m = BuildOrThrow(def);
    for (int j = 1; j < m.num_joints(); ++j) {
      EXPECT_FALSE(m.joint(JointIndex(j)).body < m.joint(JointIndex(j - 1)).body);
      EXPECT_EQ(m.joint(JointIndex(j)).offset,
                m.joint(JointIndex(j - 1)).offset + m.joint(JointIndex(j - 1)).size);
      EXPECT_LT(m.joint(JointIndex(j)).previous, j);
    }
    // A reference named a joint in the caller's order; the coordinate must belong to the joint of that name.
    auto check = [&](const FreedomRef& ref, int coordinate) {
      const Mechanism::Joint& joint = m.joint(m.CoordinateJoint(coordinate));
      EXPECT_EQ(joint.name, def.joints[ref.joint.u()].name);
      EXPECT_EQ(coordinate - joint.offset, ref.freedom);
      EXPECT_EQ(m.CoordinateName(coordinate).find(joint.name), 0u);
    };
    for (std::size_t i = 0; i < def.couplings.size(); ++i) {
      check(def.couplings[i].a, m.couplings()[i].a);
      check(def.couplings[i].b, m.couplings()[i].b);
      for (std::size_t t = 0; t < def.couplings[i].terms.size(); ++t)
        check(def.couplings[i].terms[t].first, m.couplings()[i].terms[t].first);
    }
    for (std::size_t i = 0; i < def.springs.size(); ++i)
      for (std::size_t t = 0; t < def.springs[i].terms.size(); ++t)
        check(def.springs[i].terms[t].first, m.springs()[i].length.terms[t].first);
    for (std::size_t i = 0; i < def.controls.size(); ++i) {
      // Terms on rotations stand in a path.
      const Mechanism::Length& length = m.controls()[i].length;
      if (length.path < 0) {
        for (std::size_t t = 0; t < def.controls[i].terms.size(); ++t)
          check(def.controls[i].terms[t].first, length.terms[t].first);
      } else if (def.controls[i].terms.size() == 1) {
        check(def.controls[i].terms[0].first,
              m.paths()[static_cast<std::size_t>(length.path)].rates[0].first);
      }
    }
    // The result's own definition builds the same mechanism again.
    const Mechanism again = BuildOrThrow(m.definition());
    EXPECT_EQ(again.screws(), m.screws());
    EXPECT_EQ(again.stiffness(), m.stiffness());
  }
}

TEST(Jacobian, IsTheDerivativeOfThePoses) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed);
    for (double size : {0.0, 1e-8, 1e-3, 0.2, 1.0, 3.0}) {
      const VectorX q = RandomCoordinates(m, seed, size);
      const Kinematics k = At(m, q);
      for (int b = 0; b < m.num_bodies(); ++b) {
        const Matrix6X J = BodyJacobian(m, k, BodyIndex(b));
        const MatrixX inverse = PoseMatrix(k.X_RB[static_cast<std::size_t>(b)].inverse());
        const double scale = 1 + k.X_RB[static_cast<std::size_t>(b)].translation().norm() + size * size;
        Differentiate(
            q, [&](const VectorX& p) { return PoseMatrix(At(m, p).X_RB[static_cast<std::size_t>(b)]); },
            [&](Eigen::Index i, const MatrixX& slope) {
              const MatrixX V = slope * inverse;  // [V], spatial
              Vector6 twist;
              twist << V(2, 1), V(0, 2), V(1, 0), V(0, 3), V(1, 3), V(2, 3);
              EXPECT_LE((twist - J.col(i)).norm(), kDifference * scale)
                  << "seed " << seed << " body " << b << " coordinate "
                  << m.CoordinateName(static_cast<int>(i));
            });
      }
    }
  }
}

TEST(GeneralizedForce, IsTheSumOfTransposedJacobians) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed);
    const Kinematics k = At(m, RandomCoordinates(m, seed));
    RandomSource random(seed);
    Matrix6X F(6, m.num_bodies());
    for (int b = 0; b < m.num_bodies(); ++b) F.col(b) = random.Six(2);
    const VectorX start = random.Vector(m.num_coordinates(), 1);  // the call adds
    VectorX expected = start;
    for (int b = 0; b < m.num_bodies(); ++b)
      expected += BodyJacobian(m, k, BodyIndex(b)).transpose() * F.col(b);
    const Vector6 total = F.rowwise().sum();
    VectorX tau = start;
    AccumulateGeneralizedForce(m, k.S, F, tau);
    EXPECT_LE((tau - expected).norm(), 10 * kPoseRounding * (1 + expected.norm()));
    EXPECT_LE((F.col(0) - total).norm(), kPoseRounding * 10);
  }
}

TEST(GeneralizedForce, OfGravityIsTheSlopeOfThePotential) {
  const Vector3 g(1.3, -2.1, -9.2);
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed);
    const VectorX q = RandomCoordinates(m, seed);
    auto minus_potential = [&](const VectorX& p) {
      const Kinematics k = At(m, p);
      double sum = 0;
      for (std::size_t b = 0; b < m.bodies().size(); ++b)
        sum += m.bodies()[b].inertia_B.mass * g.dot(k.X_RB[b] * m.bodies()[b].inertia_B.center);
      return MatrixX::Constant(1, 1, sum);
    };
    Matrix6X F = Matrix6X::Zero(6, m.num_bodies());
    const Kinematics k = At(m, q);
    AddGravityWrenches(m, k, g, F);
    VectorX tau = VectorX::Zero(m.num_coordinates());
    AccumulateGeneralizedForce(m, k.S, F, tau);
    // Potentials are about ten times a length here: 8 kg * 10 m/s².
    Differentiate(q, minus_potential, [&](Eigen::Index i, const MatrixX& slope) {
      EXPECT_NEAR(tau(i), slope(0, 0), 100 * kDifference) << "seed " << seed;
    });
  }
}

}  // namespace
}  // namespace fork1s::mechanism_test
