// What counts as a gap of a joint.
#include <fork1s/mechanism/kinematics.hpp>
#include <recovery/support.hpp>

namespace fork1s {
namespace {

using testing::LargestGap;
using testing::Share;

std::vector<RigidTransform> Poses(const Mechanism& m, const VectorX& q) {
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  return kinematics.X_RB;
}

MechanismDef OneBody(const std::vector<JointDef>& joints) {
  MechanismBuilder builder("one");
  BodyDef body;
  body.name = "body";
  body.parent = builder.base();
  body.X_PB = RigidTransform(Vector3(0.1, 0.2, 0));
  body.inertia = testing::Ball(1, 0.1);
  const BodyIndex b = builder.AddBody(body);
  for (JointDef joint : joints) {
    joint.body = b;
    builder.AddJoint(joint.WithSpring(10));
  }
  builder.SetInterfaces({"body"});
  return builder.definition();
}

// How far a pose is displaced from one that the joints allow.
double GapAfter(const Mechanism& m, const VectorX& q, const Vector3& shift_R) {
  auto X_RB = Poses(m, q);
  X_RB[1].translation() += shift_R;
  return LargestGap(m, X_RB);
}

TEST(JointGaps, ADisplacedHingeIsApartByTheShift) {
  const auto m = Share(OneBody({JointDef::Hinge("h", BodyIndex(1), Vector3::UnitZ(), Vector3(0.05, 0, 0))}));
  const VectorX q = VectorX::Constant(1, 0.8);
  EXPECT_LT(GapAfter(*m, q, Vector3::Zero()), 1e-15);
  EXPECT_NEAR(GapAfter(*m, q, Vector3(0.003, -0.004, 0)), 0.005, 1e-15);
  EXPECT_NEAR(GapAfter(*m, q, Vector3(0, 0, 0.002)), 0.002, 1e-15);
}

TEST(JointGaps, ASlideHasNoneAlongItsAxis) {
  const auto m = Share(OneBody({JointDef::Slide("s", BodyIndex(1), Vector3::UnitX())}));
  const VectorX q = VectorX::Constant(1, 0.3);
  EXPECT_LT(GapAfter(*m, q, Vector3(0.01, 0, 0)), 1e-15);
  EXPECT_NEAR(GapAfter(*m, q, Vector3(0.01, 0.002, 0)), 0.002, 1e-15);
}

TEST(JointGaps, TwoHingesWithDifferentAnchors) {
  // Axes that do not meet have no common point: the gap is what no displacement of the two can explain.
  const auto m =
      Share(OneBody({JointDef::Hinge("h1", BodyIndex(1), Vector3::UnitZ(), Vector3(-0.1, 0, 0)),
                     JointDef::Hinge("h2", BodyIndex(1), Vector3::UnitY(), Vector3(0.1, 0, 0.05))}));
  for (const auto& [a, b] : {std::pair{0.0, 0.0}, {0.3, -0.2}, {1.2, 0.9}, {-2.0, 1.0}}) {
    VectorX q(2);
    q << a, b;
    // Newton on the two displacements ends at rounding.
    EXPECT_LT(GapAfter(*m, q, Vector3::Zero()), 1e-12) << a << ' ' << b;
    const double gap = GapAfter(*m, q, Vector3(0.001, 0.002, -0.002));
    EXPECT_GT(gap, 1e-4);
    EXPECT_LE(gap, 0.003 * (1 + 1e-6));  // at most the shift itself
  }
  // One exponential of both screws is off by their bracket.
  const auto model = testing::MustReduce(m);
  std::vector<RigidTransform> X_RB;
  double before = 0;
  for (double angle : {0.05, 0.1}) {
    RecoverPosesTwist(model, testing::Deflected(model, VectorX::Ones(2), angle), X_RB);
    const double gap = LargestGap(*m, X_RB);
    EXPECT_GT(gap, 0);
    if (before > 0) {
      // Of this second-order error the two turns make up for most.
      EXPECT_GT(gap / before, 3.7);
    }
    before = gap;
  }
}

TEST(JointGaps, ParallelHingesLeaveNone) {
  // Two parallel axes: any place in the plane can be reached to first order.
  const auto m = Share(OneBody({JointDef::Hinge("h1", BodyIndex(1), Vector3::UnitZ(), Vector3(-0.1, 0, 0)),
                                JointDef::Hinge("h2", BodyIndex(1), Vector3::UnitZ(), Vector3(0.1, 0, 0))}));
  VectorX q(2);
  q << 0.7, -0.4;
  EXPECT_LT(GapAfter(*m, q, Vector3::Zero()), 1e-12);
  EXPECT_NEAR(GapAfter(*m, q, Vector3(0, 0, 0.002)), 0.002, 1e-9);
}

TEST(JointGaps, ClosuresCountTheirRigidDirections) {
  const auto m = Share(testing::FourBar().Definition());
  auto X_RB = Poses(*m, VectorX::Zero(3));
  EXPECT_LT(LargestGap(*m, X_RB), 1e-15);
  // Turning the rocker alone opens C by its length times the angle.
  const testing::FourBar bar;
  VectorX q = VectorX::Zero(3);
  q(2) = 0.01;
  X_RB = Poses(*m, q);
  const auto gaps = MeasureJointGaps(*m, X_RB);
  EXPECT_EQ(gaps.front().name, "C");
  EXPECT_NEAR(gaps.front().gap, 2 * std::sin(0.005) * (bar.C - bar.D).norm(), 1e-14);
}

TEST(JointGaps, LargestFirst) {
  const auto m = Share(testing::Chain(5, 0.1, 0.1, 30));
  auto X_RB = Poses(*m, VectorX::Zero(5));
  X_RB[3].translation().y() += 0.01;
  X_RB[5].translation().y() += 0.02;
  const auto gaps = MeasureJointGaps(*m, X_RB);
  ASSERT_GE(gaps.size(), 5u);
  for (std::size_t i = 1; i < gaps.size(); ++i) EXPECT_GE(gaps[i - 1].gap, gaps[i].gap);
  EXPECT_EQ(gaps.front().name, "joint5");
}

}  // namespace
}  // namespace fork1s
