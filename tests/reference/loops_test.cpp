// Loops: kept closed to rounding, also those that close more often than needed.
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

// Rounding along the loop's path; the residual of the last Newton step is squared once more.
constexpr double kClosed = 1e-12;

TEST(Loops, FourBarStaysClosed) {
  Scene scene = Of(testing::FourBar().Definition(), Vector3(0, -9.81, 0));
  FullSimulation s = Start(scene, 1.0 / 60);
  for (int i = 0; i < 120; ++i) {
    const FullStepReport report = s.Step();
    ASSERT_TRUE(report.converged) << i;
    EXPECT_LT(report.joint_gap, kClosed) << i;
  }
  EXPECT_LT(s.JointGaps().front().gap, kClosed);
}

TEST(Loops, PoseThatIsOpenIsClosedFirst) {
  Scene scene = Of(testing::FourBar().Definition());
  StartAt(scene, Vector3(0.3, 0, 0), VectorX::Zero(3));
  FullSimulation s = Start(scene, 0.01);
  EXPECT_LT(s.JointGaps().front().gap, kClosed);
}

TEST(Loops, RatesThatALoopForbidsAreProjected) {
  Scene scene = Of(testing::FourBar().Definition());
  StartAt(scene, VectorX::Zero(3), Vector3(1, 0, 0));
  FullSimulation s = Start(scene, 0.01);
  const Mechanism& m = s.mechanism(0);
  Kinematics k(m);
  ComputeKinematics(m, s.Displacements(0), k);
  MatrixX A;
  ClosureJacobian(m, k, s.Displacements(0), A);
  EXPECT_LT((A * s.Rates(0)).norm(), 1e-12);
  EXPECT_GT(s.Rates(0).norm(), 0.1);
}

TEST(Loops, ThatCannotCloseAreRefused) {
  MechanismDef def = testing::FourBar().Definition();
  def.closures[0].X_BJ.translation().x() += 10;
  const auto refused = FullSimulation::Create(Of(def));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kModel);
}

// Five rods of 1 kg and 1 m along six edges of a cube, the sixth is the ground; axes across neighbouring
// edges.
MechanismDef Bricard(double stiffness) {
  const Vector3 corner[] = {{0, 0, 0}, {1, 0, 0}, {1, -1, 0}, {1, -1, 1}, {0, -1, 1}, {0, 0, 1}};
  const Vector3 axis[] = {Vector3::UnitY(), Vector3::UnitZ(), Vector3::UnitX(),
                          Vector3::UnitY(), Vector3::UnitZ(), Vector3::UnitX()};
  MechanismBuilder builder("bricard");
  BodyIndex parent = builder.base();
  for (int i = 0; i < 5; ++i) {
    const Vector3 along = corner[i + 1] - corner[i];
    BodyDef rod;
    rod.name = "rod" + std::to_string(i + 1);
    rod.parent = parent;
    rod.X_PB = RigidTransform(i == 0 ? corner[0] : Vector3(corner[i] - corner[i - 1]));
    rod.inertia.mass = 1;
    rod.inertia.center = along / 2;
    rod.inertia.rotational = (Matrix3::Identity() - 0.999 * along * along.transpose()) / 12;
    parent = builder.AddBody(rod);
    builder.AddJoint(JointDef::Hinge("hinge" + std::to_string(i + 1), parent, axis[i]).WithSpring(stiffness));
  }
  // The closing hinge turns about z of its frame, here along x.
  const Matrix3 R = Eigen::AngleAxisd(M_PI / 2, Vector3::UnitY()).matrix();
  ClosureDef last = ClosureDef::Weld("hinge6", builder.base(), parent, RigidTransform(R, corner[5]),
                                     RigidTransform(R, Vector3(corner[5] - corner[4])));
  last.rigid(2) = false;
  builder.AddClosure(last);
  return builder.definition();
}

TEST(Bricard, KeepsItsOneFreedomAndItsEnergy) {
  // Five hinges, five closing equations, and yet one freedom: one equation repeats the others.
  EXPECT_EQ(Start(Of(Bricard(1)), 0.01).Frequencies(0).size(), 1u);

  FullSimulation s = Start(Of(Bricard(0), Vector3(0, -9.81, 0)), 1.0 / 240);
  double before = s.Energy();
  const double start = before;
  for (int i = 0; i < 240; ++i) {
    const FullStepReport report = s.Step();
    ASSERT_TRUE(report.converged) << i << " " << report.residual;
    EXPECT_LT(report.joint_gap, 1e-9) << i;
    EXPECT_LE(s.Energy(), before + 1e-9) << i;
    before = s.Energy();
  }
  // It has folded by a radian, and implicit Euler took one per cent of the 4 J that moved.
  EXPECT_GT(s.Displacements(0)(0), 0.8);
  EXPECT_GT(before - start, -0.05);
}

TEST(Loops, ClosureForcesHoldAWeight) {
  // A bar hinged at one end, its other end connected to the ground: either side carries half the weight.
  MechanismDef def = testing::Chain(1, 1, 2, 0);
  def.closures.push_back(
      ClosureDef::Connect("end", BodyIndex(0), BodyIndex(1), Vector3(1, 0, 0), Vector3(1, 0, 0)));
  def.closures[0].rigid << false, false, false, false, true, false;
  FullSimulation s = Start(Of(def, Vector3(0, -10, 0)), 0.01);
  Advance(s, 0.1);
  const VectorX force = s.ClosureForces(0);
  ASSERT_EQ(force.size(), 1);
  EXPECT_NEAR(force(0), 10, 1e-9);  // at rest: rounding
}

}  // namespace
}  // namespace fork1s::reference_test
