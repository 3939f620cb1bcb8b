// Load columns of the reduced model: which loads' static answers it has, and that they are right.
#include <gtest/gtest.h>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

#include "linalg/solve.hpp"

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;

const Vector3 kSlanted(1, -2, -9.81);  // m/s², gravity

ReductionLoads LoadsOf(const Mechanism& m) {
  ReductionLoads loads;
  loads.gravity_R = kSlanted;
  loads.controls = VectorX::Constant(static_cast<Eigen::Index>(m.controls().size()), 0.3);
  loads.wrenches_R = Matrix6X::Constant(6, m.num_bodies(), 0.1);
  return loads;
}

ReducedModel Reduced(const std::shared_ptr<const Mechanism>& m, const ReductionLoads* loads, int modes = 0) {
  ReductionOptions options;
  options.modes = modes;
  options.promote_hidden = true;
  auto model = Reduce(m, VectorX::Zero(m->num_coordinates()), options, loads);
  if (!model) throw std::runtime_error(model.error().Text());
  return std::move(*model);
}

VectorX JointForces(const Mechanism& m, const Kinematics& kinematics, Matrix6X wrenches_R) {
  VectorX tau = VectorX::Zero(m.num_coordinates());
  AccumulateGeneralizedForce(m, kinematics.S, wrenches_R, tau);
  return tau;
}

// Joint forces whose static answers the load columns of `m` at q = 0 must hold, n x .: total, weight, then
// accelerations of the base (as inertial forces of single bodies) and of free directions.
MatrixX ForcesOf(const Mechanism& m, const ReducedModel& model, const ReductionLoads& loads) {
  const VectorX q = VectorX::Zero(m.num_coordinates());
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  std::vector<VectorX> forces;
  Matrix6X F = loads.wrenches_R;
  AddGravityWrenches(m, kinematics, loads.gravity_R, F);
  VectorX total;
  SpringForce(m, kinematics, q, total);
  total += JointForces(m, kinematics, F);
  AddControlForce(m, kinematics, loads.controls, total);
  forces.push_back(total);
  F.setZero();
  AddGravityWrenches(m, kinematics, loads.gravity_R, F);
  forces.push_back(JointForces(m, kinematics, F));
  if (m.base() != BaseKind::kFixed)
    for (int axis = 0; axis < 6; ++axis) {
      for (int b = 0; b < m.num_bodies(); ++b)
        F.col(b) =
            Transform(kinematics.X_RB[static_cast<std::size_t>(b)], m.body(BodyIndex(b)).inertia_B).Matrix() *
            Vector6::Unit(axis);
      forces.push_back(JointForces(m, kinematics, F));
    }
  MatrixX M;
  MassMatrix(m, kinematics, M);
  for (const int i : model.FreeColumns()) forces.push_back(M * model.Q.col(i));
  MatrixX all(q.size(), static_cast<Eigen::Index>(forces.size()));
  for (std::size_t i = 0; i < forces.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = forces[i];
  return all;
}

// The static answers of what the interface does not feel, of a model without load columns, are within Q.
void ExpectHoldsAnswers(const std::shared_ptr<const Mechanism>& m) {
  const ReductionLoads loads = LoadsOf(*m);
  const ReducedModel without = Reduced(m, nullptr), with = Reduced(m, &loads);
  ASSERT_EQ(without.num_loads, 0);
  ASSERT_EQ(with.size(), with.num_free + with.num_elastic + with.num_modes + with.num_loads);
  ASSERT_EQ(with.column_names.size(), static_cast<std::size_t>(with.size()));
  if (!without.has_complement) return;
  const MatrixX forces = ForcesOf(*m, with, loads);
  VectorX answer, left;
  for (Eigen::Index i = 0; i < forces.cols(); ++i) {
    SCOPED_TRACE("load " + std::to_string(i));
    ApplyComplement(without, forces.col(i), answer);
    if (with.has_complement)
      ApplyComplement(with, forces.col(i), left);
    else
      left.setZero(answer.size());
    // Work of the load on what is left out, beside that on its whole answer.
    EXPECT_LT(std::abs(forces.col(i).dot(left)), 1e-8 * std::abs(forces.col(i).dot(answer)) + 1e-13);
  }
  // Stiffness of the columns by the springs of the joints.
  Kinematics kinematics(*m);
  ComputeKinematics(*m, with.q_ref, kinematics);
  const MatrixX K = with.Q.transpose() * StiffnessMatrix(*m, kinematics, with.q_ref) * with.Q;
  EXPECT_LT((K - MatrixX(with.K_r.asDiagonal())).cwiseAbs().maxCoeff(), 1e-8);
}

void ExpectAllHoldAnswers(RandomMechanismOptions options) {
  options.interfaces = 1;
  options.rest = true;
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven})
    for (unsigned seed = 0; seed < 20; ++seed) {
      SCOPED_TRACE(std::to_string(static_cast<int>(base)) + ", seed " + std::to_string(seed));
      options.base = base;
      options.unsprung = seed % 2 ? 0.2 : 0;
      ExpectHoldsAnswers(std::make_shared<const Mechanism>(testing::RandomMechanism(seed, options)));
    }
}

TEST(LoadColumns, HoldStaticAnswersOfTrees) {
  RandomMechanismOptions options;
  options.bodies = 20;
  options.controls = 2;
  ExpectAllHoldAnswers(options);
}

TEST(LoadColumns, HoldStaticAnswersOfLoops) {
  RandomMechanismOptions options;
  options.bodies = 16;
  options.rigid_closures = 2;
  options.springy_closures = 1;
  options.springs = 2;
  ExpectAllHoldAnswers(options);
}

// Against the equations of equilibrium K q + Aᵀ λ = g, A q = 0: with no modes all joints sag as far as they
// do.
TEST(LoadColumns, ShapeUnderWeightIsThatOfAllJoints) {
  for (const int closures : {0, 2})
    for (unsigned seed = 0; seed < 20; ++seed) {
      SCOPED_TRACE(std::to_string(closures) + " closures, seed " + std::to_string(seed));
      RandomMechanismOptions options;
      options.bodies = 16;
      options.interfaces = 1;
      options.rigid_closures = closures;
      const auto m = std::make_shared<const Mechanism>(testing::RandomMechanism(seed, options));
      const VectorX q = VectorX::Zero(m->num_coordinates());
      Kinematics kinematics(*m);
      ComputeKinematics(*m, q, kinematics);
      Matrix6X F = Matrix6X::Zero(6, m->num_bodies());
      AddGravityWrenches(*m, kinematics, kSlanted, F);
      const VectorX g = JointForces(*m, kinematics, F);
      MatrixX A;
      ClosureJacobian(*m, kinematics, q, A);
      const Eigen::Index n = q.size(), rows = A.rows();
      MatrixX saddle = MatrixX::Zero(n + rows, n + rows);
      saddle.topLeftCorner(n, n) = StiffnessMatrix(*m, kinematics, q);
      saddle.topRightCorner(n, rows) = A.transpose();
      saddle.bottomLeftCorner(rows, n) = A;
      VectorX rhs = VectorX::Zero(n + rows);
      rhs.head(n) = g;
      const VectorX expected = LeastNormSolve(saddle, rhs, 1e-12).col(0).head(n);
      ReductionLoads loads;
      loads.gravity_R = kSlanted;
      const ReducedModel model = Reduced(m, &loads);
      EXPECT_EQ(model.num_free, 0);
      const VectorX shape = model.Q * (model.Q.transpose() * g);
      EXPECT_LT((shape - expected).norm(), 1e-7 * expected.norm());
    }
}

// Two fingers of 12 links on a palm that is held: every column moves the joints of one.
TEST(LoadColumns, AreOfOneFingerEach) {
  MechanismBuilder builder("fingers");
  for (const char* finger : {"left", "right"}) {
    BodyIndex parent = builder.base();
    for (int i = 0; i < 12; ++i) {
      BodyDef link;
      link.name = finger + std::to_string(i);
      link.parent = parent;
      link.X_PB = RigidTransform(Vector3(0.02, finger[0] == 'l' && i == 0 ? 0.1 : 0, 0));
      link.inertia = testing::Rod(0.02, 0.02);
      parent = builder.AddBody(link);
      builder.AddJoint(JointDef::Hinge("j" + link.name, parent, Vector3::UnitY())
                           .WithSpring(finger[0] == 'l' ? 0.5 : 2, 0));
    }
  }
  builder.SetInterfaces({"left11", "right11"});
  const auto m = testing::Share(builder.definition());
  ReductionLoads loads;
  loads.gravity_R = Vector3(0, 0, -9.81);
  const ReducedModel model = Reduced(m, &loads);
  // Straight, the fingers turn neither by weight along them nor by weight along the hinges.
  EXPECT_EQ(model.num_loads, 2);
  for (int i = 0; i < model.size(); ++i) {
    SCOPED_TRACE(model.column_names[static_cast<std::size_t>(i)]);
    EXPECT_TRUE(model.Q.col(i).head(12).isZero(0) != model.Q.col(i).tail(12).isZero(0));
  }
  EXPECT_EQ(model.column_names[0], "elastic 1");
  EXPECT_EQ(model.column_names[2].substr(0, 15), "weight z (jleft");
  EXPECT_EQ(model.column_names[5].substr(0, 16), "weight z (jright");
}

// An arm that the interface sees carries a mote on a hinge of its own: what weight bends there is the mote's
// share of the weight's answer, and has a column from a millionth of it on.
TEST(LoadColumns, BeginAtAMillionthOfTheirAnswer) {
  for (const double share : {0.99e-6, 1.01e-6}) {
    MechanismBuilder builder("arm");
    BodyDef arm, mote;
    arm.name = "arm";
    arm.parent = builder.base();
    arm.inertia = testing::Ball(1, 0.1);
    arm.inertia.center = Vector3(0.1, 0, 0);
    mote.name = "mote";
    mote.parent = builder.AddBody(arm);
    mote.X_PB = RigidTransform(Vector3(0.2, 0, 0));
    mote.inertia = testing::Ball(share, 0.1);
    mote.inertia.center = Vector3(0.1, 0, 0);
    builder.AddJoint(JointDef::Hinge("shoulder", mote.parent, Vector3::UnitY()).WithSpring(2, 0));
    builder.AddJoint(JointDef::Hinge("own", builder.AddBody(mote), Vector3::UnitY()).WithSpring(2, 0));
    builder.SetInterfaces({"arm"});
    ReductionLoads loads;
    loads.gravity_R = Vector3(0, 0, -9.81);
    EXPECT_EQ(Reduced(testing::Share(builder.definition()), &loads).num_loads, share > 1e-6 ? 1 : 0);
  }
}

// A column that is there already is not taken twice, and none are where no motion is left out.
TEST(LoadColumns, AreIndependent) {
  const auto m = testing::Share(testing::Chain(10, 0.1, 0.2, 3));
  ReductionLoads loads;
  loads.gravity_R = Vector3(0, -9.81, 0);
  EXPECT_EQ(Reduced(m, &loads, 100).num_loads, 0);
  const ReducedModel model = Reduced(m, &loads);
  // Stretched out along x, weight along x and along the hinges turns none of them.
  EXPECT_EQ(model.num_loads, 1);
  EXPECT_EQ(model.M.rows(), model.num_elastic + 1);
}

}  // namespace
}  // namespace fork1s
