// Joint velocities ν of joints with a rotation vector.
#include <gtest/gtest.h>

#include "support.hpp"

namespace fork1s::mechanism_test {
namespace {

Mechanism BallOnly(const Vector3& damping = Vector3::Zero(), const Vector3& armature = Vector3::Zero()) {
  MechanismBuilder builder("ball");
  BodyDef body{"b", builder.base(), RigidTransform(Vector3(0.1, 0.2, 0)), {}, {}};
  body.inertia.mass = 0.1;
  body.inertia.rotational = 1e-3 * Matrix3::Identity();
  JointDef joint = JointDef::Ball("j", builder.AddBody(body));
  for (std::size_t i = 0; i < 3; ++i) {
    joint.freedoms[i].damping = damping(static_cast<Eigen::Index>(i));
    joint.freedoms[i].armature = armature(static_cast<Eigen::Index>(i));
  }
  builder.AddJoint(joint);
  return BuildOrThrow(builder.definition());
}

TEST(AngularVelocityMap, IsTheRateOfTheRelativeRotationInAxesOfTheBody) {
  // R(t) = R_parentᵀ R_body along q + t q̇; [ω]x = Rᵀ Ṙ by differences of fourth order.
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    for (const double size : {1e-6, 0.5, 1.5}) {
      const VectorX q = RandomCoordinates(m, seed, size);
      const VectorX q_dot = RandomSource(seed).Vector(m.num_coordinates(), 1);
      const Kinematics k = At(m, q);
      VectorX nu;
      ComputeJointVelocities(m, k, q_dot, nu);
      VectorX expected = q_dot;
      for (const Mechanism::Rotation& rotation : m.rotations()) {
        const Mechanism::Joint& joint = m.joint(rotation.joint);
        const auto R = [&](double t) -> Matrix3 {
          const Kinematics at = At(m, q + t * q_dot);
          const Matrix3 R_j = at.P[rotation.joint.u()].rotation();
          return joint.previous < 0
                     ? R_j
                     : Matrix3(at.P[static_cast<std::size_t>(joint.previous)].rotation().transpose() * R_j);
        };
        const double h = 1e-3;
        const Matrix3 rate = R(0).transpose() * (8 * (R(h) - R(-h)) - (R(2 * h) - R(-2 * h))) / (12 * h);
        const Vector3 omega(rate(2, 1), rate(0, 2), rate(1, 0));
        const Vector3 along = rotation.axes.inverse() * omega;
        for (int i = 0; i < 3; ++i) expected(rotation.coordinates[static_cast<std::size_t>(i)]) = along(i);
      }
      EXPECT_LE((nu - expected).norm(), kDifference * (1 + expected.norm())) << "seed " << seed;
      EXPECT_LE((nu - JointVelocityMap(m, q) * q_dot).norm(), 1e-12 * (1 + nu.norm())) << "seed " << seed;
    }
  }
}

TEST(JointAccelerations, AreTheDerivativeOfJointVelocities) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    RandomSource random(seed);
    const VectorX q = RandomCoordinates(m, seed, 1), q_dot = random.Vector(m.num_coordinates(), 1),
                  q_ddot = random.Vector(m.num_coordinates(), 1);
    const auto nu = [&](double t) -> VectorX {
      const VectorX q_t = q + t * q_dot + 0.5 * t * t * q_ddot;
      return JointVelocityMap(m, q_t) * (q_dot + t * q_ddot);
    };
    const double h = 1e-3;
    const VectorX expected = (8 * (nu(h) - nu(-h)) - (nu(2 * h) - nu(-2 * h))) / (12 * h);
    VectorX nu_dot;
    ComputeJointAccelerations(m, At(m, q), q, q_dot, q_ddot, nu_dot);
    EXPECT_LE((nu_dot - expected).norm(), 1e-8 * (1 + expected.norm())) << "seed " << seed;
  }
}

TEST(CoordinateForces, WorkAsTheForcesOnJointVelocities) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    RandomSource random(seed);
    const VectorX q = RandomCoordinates(m, seed, 1), q_dot = random.Vector(m.num_coordinates(), 1);
    VectorX f = random.Vector(m.num_coordinates(), 1), nu;
    const Kinematics k = At(m, q);
    ComputeJointVelocities(m, k, q_dot, nu);
    const double power = f.dot(nu);
    ConvertToCoordinateForces(m, k, f);
    EXPECT_NEAR(f.dot(q_dot), power, 1e-13 * (1 + f.norm() * q_dot.norm())) << "seed " << seed;
  }
}

TEST(BallJoint, DamperAtTwoRadiansDissipatesByAngularVelocity) {
  const Mechanism m = BallOnly(Vector3(0.5, 0.5, 0.5), Vector3(0.1, 0.1, 0.1));
  // 2 rad about x, θ̇ about y: J_r of a rotation by φ square to the axis has the length 2 sin(φ/2)/φ.
  const Vector3 q(2, 0, 0), q_dot(0, 1, 0);
  const double square = std::pow(2 * std::sin(1.0) / 2, 2);
  EXPECT_NEAR(q_dot.dot(DampingMatrix(m, At(m, q), q) * q_dot), 0.5 * square, 1e-15);
  MatrixX M;
  MassMatrix(m, At(m, q), M);
  EXPECT_NEAR(q_dot.dot(M * q_dot), (0.1 + 1e-3) * square, 1e-15);
}

TEST(BallJoint, ALengthAlongAPathAndARotationIsRefused) {
  MechanismBuilder builder("both");
  BodyDef body{"b", builder.base(), RigidTransform(), {}, {}};
  body.inertia.mass = 1;
  body.inertia.rotational = Matrix3::Identity();
  const JointIndex joint = builder.AddJoint(JointDef::Ball("j", builder.AddBody(body)));
  MechanismDef def = builder.definition();
  PathDef path;
  path.name = "rope";
  path.elements.resize(2);
  path.elements[0].body = BodyIndex(0);
  path.elements[1].body = BodyIndex(1);
  path.elements[0].X_BE = RigidTransform(Vector3(1, 0, 0));
  def.paths.push_back(path);
  def.frictions.push_back({"rub", {{FreedomRef{joint, 0}, 1.0}}, 1, {0, 1}});
  const auto built = BuildMechanism(def);
  ASSERT_FALSE(built);
  EXPECT_NE(built.error().Text().find("rub"), std::string::npos);
}

MechanismDef WithAngle(MechanismDef def, BodyIndex on, BodyIndex from, const RigidTransform& X_on,
                       const RigidTransform& X_from) {
  PathDef path;
  path.name = "angle";
  path.kind = PathKind::kAngle;
  path.elements.resize(2);
  path.elements[0].body = on;
  path.elements[0].X_BE = X_on;
  path.elements[1].body = from;
  path.elements[1].X_BE = X_from;
  def.paths = {path};
  def.length_limits = {{"cone", {}, -1, 1, {0, 1}}};
  return def;
}

// Of any two frames of a tree: the trace of their rotation, and arms by differences.
TEST(AnglePath, IsThatOfTheRotation_AndItsArmsAreTheDerivative) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    RandomMechanismOptions options;
    options.bodies = 6;
    RandomSource random(seed);
    const BodyIndex on(1 + random.Below(6)), from((on.value() + 1 + random.Below(6)) % 7);
    const RigidTransform X_on = random.Pose(0.3), X_from = random.Pose(0.3);
    const Mechanism m = BuildOrThrow(WithAngle(RandomMechanismDef(seed, options), on, from, X_on, X_from));
    const VectorX q = RandomCoordinates(m, seed);
    const Kinematics k = At(m, q);
    const Matrix3 R = ((k.X_RB[from.u()] * X_from).inverse() * (k.X_RB[on.u()] * X_on)).rotation();
    EXPECT_NEAR(std::cos(k.paths[0].length), 0.5 * (R.trace() - 1), 1e-12) << seed;
    // The angle bends by its inverse, and at π it is a corner.
    if (k.paths[0].length < 0.3 || k.paths[0].length > M_PI - 0.3) continue;
    VectorX arms = VectorX::Zero(q.size());
    for (const auto& [coordinate, arm] : k.paths[0].arms) arms(coordinate) = arm;
    Differentiate(
        q, [&](const VectorX& p) { return MatrixX::Constant(1, 1, At(m, p).paths[0].length); },
        [&](Eigen::Index i, const MatrixX& by_q) {
          EXPECT_NEAR(arms(i), by_q(0, 0), 1e-7) << seed << " " << i;
        });
  }
}

TEST(AnglePath, AtNoTurnHasNoArms_AndTheAxisFromThereToHalfATurn) {
  MechanismBuilder builder("ball");
  BodyDef body{"b", builder.base(), RigidTransform(), {}, {}};
  body.inertia.mass = 1;
  body.inertia.rotational = Matrix3::Identity();
  builder.AddJoint(JointDef::Ball("j", builder.AddBody(body)));
  const Mechanism m = BuildOrThrow(
      WithAngle(builder.definition(), BodyIndex(1), BodyIndex(0), RigidTransform(), RigidTransform()));
  EXPECT_TRUE(m.length_limits()[0].is_of_joint);
  EXPECT_TRUE(m.IsAngle(m.length_limits()[0].length));
  const Vector3 axis = Vector3(2, -1, 3).normalized();
  for (const double angle : {0.0, 0.9e-9, 1.1e-9, 1e-6, 1.0, 3.14}) {
    const Kinematics k = At(m, angle * axis);
    EXPECT_NEAR(k.paths[0].length, angle, 1e-15 + 1e-12 * angle);
    Vector3 arms = Vector3::Zero();
    for (const auto& [coordinate, arm] : k.paths[0].arms) arms(coordinate) = arm;
    // By as much of the axis as rounding of the rotation leaves.
    if (angle < 1e-9)
      EXPECT_EQ(arms, Vector3::Zero()) << angle;
    else
      EXPECT_LT((arms - axis).norm(), 1e-12 + 1e-15 / angle) << angle;
  }
}

}  // namespace
}  // namespace fork1s::mechanism_test
