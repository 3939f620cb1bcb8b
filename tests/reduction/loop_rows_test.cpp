// Rows of loops by closure against the dense Jacobian, and what depends on what.
#include <gtest/gtest.h>
#include <fork1s/reduction/reduced_model.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;
using testing::RandomSource;

// Two legs of a bench: a base with `count` four-bars that have nothing in common.
MechanismDef FourBars(int count) {
  MechanismBuilder builder("four-bars");
  std::vector<std::string> interfaces;
  for (int k = 0; k < count; ++k) {
    const auto name = [&](const char* what) { return what + std::to_string(k); };
    const Vector3 at(0, 0.5 * k, 0);
    const auto link = [&](const char* what, BodyIndex parent, const Vector3& p, double length) {
      BodyDef body;
      body.name = name(what);
      body.parent = parent;
      body.X_PB = RigidTransform(p);
      body.inertia = testing::Rod(0.1 * length, length);
      const BodyIndex b = builder.AddBody(body);
      builder.AddJoint(JointDef::Hinge(name(what) + "_pin", b, Vector3::UnitY()).WithSpring(10 + k, 0.1));
      return b;
    };
    const BodyIndex crank = link("crank", builder.base(), at, 0.1);
    const BodyIndex coupler = link("coupler", crank, Vector3(0.1, 0, 0), 0.2);
    const BodyIndex rocker = link("rocker", builder.base(), at + Vector3(0.2, 0, 0.05), 0.15);
    ClosureDef pin =
        ClosureDef::Connect(name("pin"), coupler, rocker, Vector3(0.2, 0, 0), Vector3(0.1, 0, -0.05));
    builder.AddClosure(pin);
    interfaces.push_back(name("rocker"));
  }
  builder.SetInterfaces(interfaces);
  return builder.definition();
}

MatrixX DenseRows(const Mechanism& m, const VectorX& q, const LoopRows& rows) {
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  MatrixX all, A(rows.size(), m.num_coordinates());
  ClosureJacobian(m, kinematics, q, all);
  for (int i = 0; i < rows.size(); ++i) A.row(i) = all.row(rows.row(i));
  return A;
}

void ExpectDense(const Mechanism& m, const std::vector<int>& kept, unsigned seed) {
  const LoopRows rows(m, kept);
  ASSERT_EQ(rows.size(), static_cast<int>(kept.size()));
  const VectorX q = testing::RandomCoordinates(m, seed, 0.2);
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  const MatrixX A = DenseRows(m, q, rows), B = DenseRows(m, VectorX::Zero(q.size()), rows);
  VectorX a, b;
  rows.Fill(m, kinematics, q, a);
  ComputeKinematics(m, VectorX::Zero(q.size()), kinematics);
  rows.Fill(m, kinematics, VectorX::Zero(q.size()), b);

  // Products of some ten numbers in another order.
  constexpr double kRounding = 1e-13;
  RandomSource random(seed);
  VectorX x = random.Vector(m.num_coordinates(), 1), y;
  rows.Apply(a, x, y);
  EXPECT_LE((y - A * x).norm(), kRounding * (1 + A.norm())) << seed;
  VectorX moved = x;
  rows.SubtractTransposed(b, y, moved);
  EXPECT_LE((moved - (x - B.transpose() * y)).norm(), kRounding * (1 + B.norm() * y.norm())) << seed;
  // A whole four of columns and some, and more room in Y than they take.
  RowMatrixX X(m.num_coordinates(), 6), Y(rows.size(), 8);
  for (int i = 0; i < 6; ++i) X.col(i) = random.Vector(m.num_coordinates(), 1);
  rows.Apply(a, X, Y);
  EXPECT_LE((Y.leftCols(6) - A * X).norm(), kRounding * (1 + A.norm())) << seed;
  EXPECT_TRUE(Y.rightCols(2).isZero(0));
  RowMatrixX X_moved = X;
  rows.SubtractTransposed(b, Y, X_moved);
  EXPECT_LE((X_moved - (X - B.transpose() * Y.leftCols(6))).norm(), kRounding * (1 + B.norm() * Y.norm()))
      << seed;

  LoopFactor factor(rows);
  factor.Compute(rows, a, b);
  if (!factor.ok()) return;  // rows drawn at random may depend on each other
  const MatrixX AB = A * B.transpose();
  VectorX solved = y, transposed = y;
  RowMatrixX solved_rows = Y;
  factor.SolveInPlace(solved);
  factor.SolveTransposedInPlace(transposed);
  factor.SolveInPlace(solved_rows);
  const double size = AB.norm();
  EXPECT_LE((AB * solved - y).norm(), kRounding * (1 + size * solved.norm())) << seed;
  EXPECT_LE((AB.transpose() * transposed - y).norm(), kRounding * (1 + size * transposed.norm())) << seed;
  EXPECT_LE((AB * solved_rows - Y).norm(), kRounding * (1 + size * solved_rows.norm())) << seed;
}

TEST(LoopRows, AreThoseOfTheDenseJacobian) {
  RandomMechanismOptions options;
  options.bodies = 14;
  options.rigid_closures = 3;
  options.couplings = 2;
  options.coupling_terms = 2;
  int rows = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const Mechanism m = testing::RandomMechanism(seed, options);
    RandomSource random(seed + 50);
    std::vector<int> kept;
    for (int i = 0; i < m.num_constraints(); ++i)
      if (random.Chance(0.8)) kept.push_back(i);
    rows += static_cast<int>(kept.size());
    ExpectDense(m, kept, seed);
  }
  EXPECT_GT(rows, 100);
}

TEST(LoopRows, WhatIsSingularGivesNoNumbers) {
  const Mechanism m = testing::BuildOrThrow(FourBars(1));
  // The row across the plane of a four-bar depends on nothing.
  const LoopRows rows(m, {0, 1, 2});
  Kinematics kinematics(m);
  const VectorX q = VectorX::Zero(3);
  ComputeKinematics(m, q, kinematics);
  VectorX a, x = VectorX::Ones(3);
  rows.Fill(m, kinematics, q, a);
  LoopFactor factor(rows);
  factor.Compute(rows, a, a);
  EXPECT_FALSE(factor.ok());
  factor.SolveInPlace(x);
  EXPECT_TRUE(x.array().isNaN().all());
}

TEST(LoopRows, LoopsWithNothingInCommonAreGroupsOfTheirOwn) {
  const auto m = testing::Share(FourBars(3));
  const auto model = Reduce(m, VectorX::Zero(9));
  ASSERT_TRUE(model) << model.error().Text();
  const auto groups = model->loops.GroupCoordinates();
  ASSERT_EQ(groups.size(), 3u);
  for (int g = 0; g < 3; ++g)
    EXPECT_EQ(groups[static_cast<std::size_t>(g)], (std::vector<int>{3 * g, 3 * g + 1, 3 * g + 2}));
  // Each has one freedom, and a column of Q that moves it alone.
  ASSERT_EQ(model->size(), 3);
  for (int g = 0; g < 3; ++g)
    for (int k = 0; k < 3; ++k) EXPECT_EQ(model->Q.block(3 * g, k, 3, 1).isZero(0), g != k) << g << k;
}

// Three fingers of unlike joints on one palm: the interface feels less than all of each, and modes are left
// out.
TEST(Parts, FingersHaveColumnsOfTheirOwn) {
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kDriven, BaseKind::kFloating}) {
    MechanismBuilder builder("hand", base, testing::Ball(0.3, 0.05));
    std::vector<std::string> tips;
    std::vector<int> finger_of;
    std::vector<BodyIndex> ends(3, builder.base());
    RandomSource random(3);
    // Joints of the fingers in turns, so that none has coordinates that stand together.
    for (int j = 0; j < 9; ++j)
      for (int f = 0; f < 3; ++f) {
        BodyDef body;
        body.name = "f" + std::to_string(f) + "_" + std::to_string(j);
        body.parent = ends[static_cast<std::size_t>(f)];
        body.X_PB = RigidTransform(j == 0 ? Vector3(0.1 * f, 0, 0) : Vector3(0, 0, 0.03));
        body.inertia = testing::Ball(0.01, 0.01);
        const BodyIndex b = builder.AddBody(body);
        builder.AddJoint(
            JointDef::Hinge("j" + body.name, b, random.Direction()).WithSpring(random.Uniform(1, 4), 0.01));
        ends[static_cast<std::size_t>(f)] = b;
        finger_of.push_back(f);
        if (j == 8) tips.push_back(body.name);
      }
    builder.SetInterfaces(tips);
    const auto m = testing::Share(builder.definition());
    ReductionOptions options;
    options.modes = 4;
    const auto model = Reduce(m, VectorX::Zero(27), options);
    ASSERT_TRUE(model) << model.error().Text();
    EXPECT_GE(model->num_elastic, 15);
    EXPECT_LT(model->num_elastic, 27);
    EXPECT_EQ(model->num_modes, 4);
    int last = 0;
    for (int k = 0; k < model->size(); ++k) {
      int finger = -1;
      for (int i = 0; i < 27; ++i)
        if (model->Q(i, k) != 0) {
          if (finger < 0) finger = finger_of[static_cast<std::size_t>(i)];
          EXPECT_EQ(finger_of[static_cast<std::size_t>(i)], finger) << k;
        }
      EXPECT_GE(finger, last) << "columns of a finger stand together";
      last = finger;
    }
    // Zeros between fingers are exact where the base is held: contacts are solved finger by finger by them.
    for (int k = 0; k < model->size(); ++k)
      for (int l = 0; l < model->size(); ++l) {
        bool shared = false;
        for (int i = 0; i < 27; ++i)
          for (int j = 0; j < 27; ++j)
            shared =
                shared || (model->Q(i, k) != 0 && model->Q(j, l) != 0 &&
                           finger_of[static_cast<std::size_t>(i)] == finger_of[static_cast<std::size_t>(j)]);
        if (!shared) {
          EXPECT_EQ(model->M(k, l), 0);
          EXPECT_EQ(model->D(k, l), 0);
        }
      }
  }
}

}  // namespace
}  // namespace fork1s
