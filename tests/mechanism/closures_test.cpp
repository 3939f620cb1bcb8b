#include "support.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace fork1s::mechanism_test {
namespace {

TEST(Closures, AreClosedAtTheReference) {
  int closures = 0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    const VectorX q = VectorX::Zero(m.num_coordinates());
    EXPECT_LE(ClosureGap(m, At(m, q), q), 1e-14);  // frames are computed to rounding
    VectorX c;
    ClosureResidual(m, At(m, q), q, c);
    ASSERT_EQ(c.size(), m.num_constraints());
    closures += m.num_constraints();
  }
  EXPECT_GT(closures, 100);  // the generator does make loops
}

TEST(Closures, JacobianIsTheDerivativeOfTheResidual) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    for (double size : {0.0, 1e-8, 1e-3, 0.2, 0.6}) {  // away from closed too
      const VectorX q = RandomCoordinates(m, seed, size);
      VectorX c;
      ClosureResidual(m, At(m, q), q, c);
      MatrixX A;
      ClosureJacobian(m, At(m, q), q, A);
      ASSERT_EQ(A.rows(), c.size());
      // Within 0.3 of half a turn the rotation vector bends too sharply for differences of this step.
      if (c.size() && c.cwiseAbs().maxCoeff() > std::numbers::pi - 0.3) continue;
      auto residual = [&](const VectorX& p) {
        VectorX r;
        ClosureResidual(m, At(m, p), p, r);
        return r;
      };
      Differentiate(q, residual, [&](Eigen::Index i, const MatrixX& slope) {
        EXPECT_LE((A.col(i) - slope).norm(), 10 * kDifference * (1 + A.norm()))
            << "seed " << seed << " size " << size;
      });
    }
  }
}

TEST(Closures, HearTheCoordinatesBetweenTheirBodiesAlone) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    const Mechanism m = RandomMechanism(seed, Everything());
    const VectorX q = RandomCoordinates(m, seed, 0.2);
    const Kinematics kinematics = At(m, q);
    MatrixX A;
    ClosureJacobian(m, kinematics, q, A);
    Eigen::Index row = 0;
    for (const ClosureDef& closure : m.closures()) {
      const std::vector<int> coordinates = ClosureCoordinates(m, closure);
      std::vector<int> rigid;
      for (int k = 0; k < 6; ++k)
        if (closure.rigid(k)) rigid.push_back(k);
      // Numbers between must come out as 0.
      const auto rows = static_cast<Eigen::Index>(rigid.size()), stride = (rows + 3) / 4 * 4;
      MatrixX columns = MatrixX::Constant(stride, static_cast<Eigen::Index>(coordinates.size()), 1e30);
      ClosureRows(m, closure, kinematics, rigid.data(), static_cast<int>(rows), static_cast<int>(stride),
                  columns.data());
      EXPECT_TRUE(columns.bottomRows(stride - rows).isZero(0)) << seed;
      // Joints that carry both bodies move its frames alike, and those of no body on the way not at all.
      const Matrix6X whole =
          BodyJacobian(m, kinematics, closure.body_b) - BodyJacobian(m, kinematics, closure.body_a);
      for (int i = 0; i < m.num_coordinates(); ++i)
        EXPECT_EQ(std::count(coordinates.begin(), coordinates.end(), i), whole.col(i).isZero(0) ? 0 : 1)
            << seed;
      for (Eigen::Index k = 0; k < rows; ++k) {
        VectorX expected = VectorX::Zero(m.num_coordinates());
        for (std::size_t i = 0; i < coordinates.size(); ++i)
          expected(coordinates[i]) = columns(k, static_cast<Eigen::Index>(i));
        // Where only a point is held it comes without the frames' turns, by other sums of some ten terms.
        EXPECT_LE((A.row(row++).transpose() - expected).norm(), 1e-14 * (1 + expected.norm())) << seed;
      }
    }
  }
}

TEST(Closures, GapIsALength) {
  MechanismBuilder builder("pair");
  RandomSource random(2);
  const BodyIndex a =
      builder.AddBody({"a", builder.base(), RigidTransform(Vector3(0.5, 0, 0)), random.Inertia(), {}});
  const BodyIndex b =
      builder.AddBody({"b", builder.base(), RigidTransform(Vector3(0, 0.3, 0)), random.Inertia(), {}});
  builder.AddJoint(JointDef::Free("free a", a));
  const JointIndex on_b = builder.AddJoint(JointDef::Free("free b", b));
  builder.AddClosure(ClosureDef::Weld("weld", a, b, RigidTransform(), RigidTransform(Vector3(0.5, -0.3, 0))));
  const MechanismDef def = builder.definition();
  const Mechanism welded = BuildOrThrow(def);
  EXPECT_EQ(welded.num_constraints(), 6);
  EXPECT_NEAR(welded.length_scale(), 0.4, 1e-15);
  VectorX q = VectorX::Zero(12);
  q(4) = 1e-3;  // a slides by 1 mm
  EXPECT_NEAR(ClosureGap(welded, At(welded, q), q), 1e-3, 1e-15);
  q(4) = 0;
  q(2) = 0.01;  // a turns on the spot by 0.01 rad
  EXPECT_NEAR(ClosureGap(welded, At(welded, q), q), 0.01 * 0.4, 1e-15);

  MechanismDef connected = def;
  connected.closures = {ClosureDef::Connect("pin", a, b, Vector3::Zero(), Vector3(0.5, -0.3, 0))};
  const Mechanism pinned = BuildOrThrow(connected);
  EXPECT_EQ(pinned.num_constraints(), 3);
  EXPECT_NEAR(ClosureGap(pinned, At(pinned, q), q), 0, 1e-15);  // it may turn about the pin

  MechanismDef coupled = def;
  coupled.closures.clear();
  CouplingDef c;
  c.name = "ratio";
  c.a = {on_b, 0};
  c.polynomial[0] = 0.02;
  coupled.couplings = {c};  // without b: q_a = 0.02 rad
  EXPECT_NEAR(ClosureGap(BuildOrThrow(coupled), At(welded, q), q), 0.02 * 0.4, 1e-15);
  coupled.couplings[0].a = {on_b, 3};  // a slide's mismatch is a length already
  EXPECT_NEAR(ClosureGap(BuildOrThrow(coupled), At(welded, q), q), 0.02, 1e-15);
}

// Ground, crank, coupler, rocker; a parallelogram, so that the answer is known at every crank angle.
Mechanism FourBar(double rocker_length) {
  MechanismBuilder builder("four-bar");
  const SpatialInertia I{0.3, Vector3(0.1, 0, 0), Matrix3::Identity() * 1e-3};
  const double width = 0.4, height = 0.25;
  const BodyIndex crank = builder.AddBody({"crank", builder.base(), RigidTransform(), I, {}});
  const BodyIndex coupler = builder.AddBody({"coupler", crank, RigidTransform(Vector3(0, height, 0)), I, {}});
  const BodyIndex rocker =
      builder.AddBody({"rocker", builder.base(), RigidTransform(Vector3(width, 0, 0)), I, {}});
  builder.AddJoint(JointDef::Hinge("crank pin", crank, Vector3::UnitZ()).WithSpring(10));
  builder.AddJoint(JointDef::Hinge("coupler pin", coupler, Vector3::UnitZ()));
  builder.AddJoint(JointDef::Hinge("rocker pin", rocker, Vector3::UnitZ()));
  // The hinge that closes the loop: all but the turn about z.
  ClosureDef pin = ClosureDef::Weld("closing pin", coupler, rocker, RigidTransform(Vector3(width, 0, 0)),
                                    RigidTransform(Vector3(0, rocker_length, 0)));
  pin.rigid(2) = false;
  builder.AddClosure(pin);
  return BuildOrThrow(builder.definition());
}

TEST(CloseLoops, BringsAParallelogramBack) {
  const Mechanism m = FourBar(0.25);
  RandomSource random(3);
  for (double angle : {-1.2, -0.5, 0.0, 0.4, 1.0})
    for (int i = 0; i < 5; ++i) {
      VectorX q = Vector3(angle, -angle, angle) + random.InBox(0.15);
      const double gap = CloseLoops(m, q);
      EXPECT_LT(gap, 1e-10);
      EXPECT_EQ(gap, ClosureGap(m, At(m, q), q));
      EXPECT_NEAR(q(1), -q(0), 1e-9);  // the coupler stays level,
      EXPECT_NEAR(q(2), q(0), 1e-9);   // the rocker parallel to the crank
    }
}

TEST(CloseLoops, MovesUnsprungPinsRatherThanTheSpring) {
  const Mechanism m = FourBar(0.25);
  VectorX q = Vector3(0.3, 0, 0);
  EXPECT_LT(CloseLoops(m, q), 1e-10);
  // The metric is k on the sprung crank and 1e-3 k on the pins: they do the moving.
  EXPECT_NEAR(q(0), 0.3, 0.02);
}

TEST(CloseLoops, ClosesALoopThatIsOpenAtItsReference) {
  const Mechanism m = FourBar(0.3);  // 5 cm too long
  VectorX q = VectorX::Zero(3);
  EXPECT_NEAR(ClosureGap(m, At(m, q), q), 0.05, 1e-15);
  EXPECT_LT(CloseLoops(m, q), 1e-10);
  // Law of cosines: the pin is 0.3 from the rocker's foot and 0.4 from the crank's end.
  const Kinematics k = At(m, q);
  EXPECT_NEAR((k.X_RB[2] * Vector3(0.4, 0, 0) - Vector3(0.4, 0, 0)).norm(), 0.3, 1e-10);
  EXPECT_NEAR((k.X_RB[3] * Vector3(0, 0.3, 0) - k.X_RB[2].translation()).norm(), 0.4, 1e-10);
}

TEST(CloseLoops, TellsTheGapThatCannotBeClosed) {
  const Mechanism m = FourBar(2.0);  // longer than the other three together
  VectorX q = VectorX::Zero(3);
  const double gap = CloseLoops(m, q);
  EXPECT_GT(gap, 0.5);
  EXPECT_TRUE(q.allFinite());
}

TEST(CloseLoops, BringsRandomMechanismsBack) {
  int tried = 0;
  for (unsigned seed = 0; seed < 2 * kSeeds; ++seed) {
    RandomMechanismOptions options;
    options.rigid_closures = 2;
    options.couplings = 1;
    options.unsprung = 0.3;
    const Mechanism m = RandomMechanism(seed, options);
    if (m.num_constraints() == 0) continue;
    ++tried;
    VectorX q = RandomCoordinates(m, seed, 0.1);
    EXPECT_LT(CloseLoops(m, q), 1e-10)
        << "seed " << seed << ", started at "
        << ClosureGap(m, At(m, RandomCoordinates(m, seed, 0.1)), RandomCoordinates(m, seed, 0.1));
    EXPECT_LT(q.cwiseAbs().maxCoeff(), 1) << "seed " << seed;  // it stays near
  }
  EXPECT_GT(tried, static_cast<int>(kSeeds));
}

TEST(CloseLoops, LeavesTreesAlone) {
  const Mechanism m = RandomMechanism(1);
  VectorX q = RandomCoordinates(m, 1);
  const VectorX before = q;
  EXPECT_EQ(CloseLoops(m, q), 0);
  EXPECT_EQ(q, before);
}

}  // namespace
}  // namespace fork1s::mechanism_test
