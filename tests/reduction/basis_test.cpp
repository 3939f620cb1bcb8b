// The coordinates of a reduced model, which elimination makes, against what orthogonal decompositions and
// dense products give; and that a relinearization gives the bits of a first reduction.
#include <gtest/gtest.h>

#include <fork1s/reduction/compliance.hpp>
#include <memory>
#include <random_mechanism.hpp>

#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/spectrum.hpp"
#include "reduction/reduce_again.hpp"

namespace fork1s {
namespace {

constexpr unsigned kBases = 12;

testing::RandomMechanismOptions OfBasis(unsigned seed) {
  testing::RandomMechanismOptions options;
  options.bodies = seed % 2 ? 8 : 22;
  options.rigid_closures = 2;
  options.springy_closures = seed % 3 == 0 ? 1 : 0;
  options.couplings = 1;
  options.coupling_terms = 1;
  options.springs = seed % 3;
  options.interfaces = 2;
  options.unsprung = seed % 4 == 3 ? 0.2 : 0;  // then bases are found the careful way, in part
  // The last few have springs of very different stiffness.
  if (seed >= kBases - 3) options.stiffness_low = 1e-2, options.stiffness_high = 1e4;
  return options;
}

ReducedModel ReducedTo(const std::shared_ptr<const Mechanism>& mechanism, const VectorX& q, int modes) {
  ReductionOptions options;
  options.modes = modes;
  options.promote_hidden = true;
  auto model = Reduce(mechanism, q, options);
  EXPECT_TRUE(model) << model.error().Text();
  return *model;
}

double Largest(const MatrixX& A) { return A.size() == 0 ? 0 : A.cwiseAbs().maxCoeff(); }

struct Case {
  std::shared_ptr<const Mechanism> mechanism;
  VectorX q;
  Kinematics kinematics;

  explicit Case(unsigned seed)
      : mechanism(std::make_shared<const Mechanism>(testing::RandomMechanism(seed, OfBasis(seed)))),
        q(VectorX::Zero(mechanism->num_coordinates())),
        kinematics(*mechanism) {
    ComputeKinematics(*mechanism, q, kinematics);
  }
};

TEST(Basis, KeepsLoopsClosedAndStretchesSpringsByOne) {
  for (unsigned seed = 0; seed < kBases; ++seed) {
    SCOPED_TRACE(seed);
    const Case c(seed);
    MatrixX A;
    ClosureJacobian(*c.mechanism, c.kinematics, c.q, A);
    const MatrixX K = StiffnessMatrix(*c.mechanism, c.kinematics, c.q);
    for (const int modes : {1, 1000}) {
      const ReducedModel model = ReducedTo(c.mechanism, c.q, modes);
      for (Eigen::Index k = 0; k < model.Q.cols(); ++k)
        EXPECT_LT(Largest(Times(A, model.Q.col(k))), 1e-11 * Largest(A) * Largest(model.Q.col(k)));
      EXPECT_LT(Largest(Congruence(K, model.Q) - MatrixX(model.K_r.asDiagonal())), 1e-9);
    }
  }
}

TEST(Basis, IsTheComplianceOfOrthogonalDecompositions) {
  int compared = 0;
  for (unsigned seed = 0; seed < kBases; ++seed) {
    SCOPED_TRACE(seed);
    const Case c(seed);
    const ReducedModel model = ReducedTo(c.mechanism, c.q, 1000);
    if (model.num_free > 0) continue;
    const MatrixX response = InterfaceResponse(*c.mechanism, c.q, model.interfaces);
    MatrixX J(response.rows(), c.q.size());
    for (std::size_t e = 0; e < model.interfaces.size(); ++e) {
      auto rows = J.middleRows(6 * static_cast<Eigen::Index>(e), 6);
      rows = BodyJacobian(*c.mechanism, c.kinematics, model.interfaces[e]);
      rows.bottomRows(3) -= Skew(c.kinematics.X_RB[model.interfaces[e].u()].translation()) * rows.topRows(3);
    }
    // World axes turn both triples of a row of bodies alike.
    const MatrixX ours = Times(J, TimesTransposed(model.Q, model.Q));
    EXPECT_LT(Largest(TransposedTimes(ours, ours) - TransposedTimes(response, response)),
              1e-8 * Largest(TransposedTimes(response, response)));
    ++compared;
  }
  EXPECT_GT(compared, 6);
}

TEST(Basis, ComplementIsWhatTheModelLeavesOfAllMotions) {
  int compared = 0;
  for (unsigned seed = 0; seed < kBases; ++seed) {
    SCOPED_TRACE(seed);
    const Case c(seed);
    const ReducedModel all = ReducedTo(c.mechanism, c.q, 1000), some = ReducedTo(c.mechanism, c.q, 1);
    if (!some.has_complement) continue;
    const MatrixX Q_all = Columns(all.Q, all.SprungColumns()), Q_some = Columns(some.Q, some.SprungColumns());
    const MatrixX whole = TimesTransposed(Q_all, Q_all);
    EXPECT_LT(Largest(some.C_perp + TimesTransposed(Q_some, Q_some) - whole), 1e-9 * Largest(whole));
    ++compared;
  }
  EXPECT_GT(compared, 4);
}

// Among all motions that the interface does not feel the kept modes are those of largest inertia.
TEST(Basis, FewModesAreTheLowestOfAll) {
  int compared = 0;
  for (unsigned seed = 0; seed < kBases; seed += 2) {
    SCOPED_TRACE(seed);
    const Case c(seed);
    constexpr int kModes = 2;
    const ReducedModel all = ReducedTo(c.mechanism, c.q, 1000), felt = ReducedTo(c.mechanism, c.q, 0),
                       some = ReducedTo(c.mechanism, c.q, kModes);
    const std::vector<int> sprung = all.SprungColumns();
    const auto e = static_cast<int>(sprung.size());
    if (some.num_modes < kModes || 4 * kModes >= e) continue;
    const MatrixX K = StiffnessMatrix(*c.mechanism, c.kinematics, c.q), Q = Columns(all.Q, sprung);
    const MatrixX Y = TransposedTimes(Q, Times(K, Columns(felt.Q, felt.SprungColumns())));
    const MatrixX P = MatrixX::Identity(e, e) - TimesTransposed(Y, Y);
    const VectorX mu = EigenvaluesOf(Congruence(RowsAndColumns(all.M, sprung, sprung), P));
    const MatrixX y = TransposedTimes(Q, Times(K, Columns(some.Q, some.SprungColumns())));
    const VectorX kept = EigenvaluesOf(
        Congruence(RowsAndColumns(all.M, sprung, sprung), Times(P, y)));  // 0 for what the interface feels
    for (int k = 1; k <= kModes; ++k) EXPECT_NEAR(kept(kept.size() - k), mu(e - k), 1e-9 * mu(e - 1)) << k;
    ++compared;
  }
  EXPECT_GT(compared, 2);
}

TEST(Basis, InertiaAlongItIsThatOfTheJoints) {
  for (unsigned seed = 0; seed < kBases; ++seed) {
    SCOPED_TRACE(seed);
    const Case c(seed);
    for (const int modes : {1, 1000}) {
      const ReducedModel model = ReducedTo(c.mechanism, c.q, modes);
      MatrixX M;
      MassMatrix(*c.mechanism, c.kinematics, M);
      Matrix6 M_00;
      Matrix6X M_0q;
      BaseInertia(*c.mechanism, c.kinematics, M_00, M_0q);
      EXPECT_LT(Largest(model.M - Congruence(M, model.Q)), 1e-12 * Largest(model.M));
      EXPECT_EQ(model.M, model.M.transpose());
      EXPECT_LT(Largest(model.M_0z - Times(M_0q, model.Q)), 1e-12 * Largest(model.M_0z));
      EXPECT_LT(Largest(model.M_00 - M_00), 1e-12 * Largest(M_00));
      for (int b = 0; b < c.mechanism->num_bodies(); ++b)
        EXPECT_LT(Largest(model.T_of(BodyIndex(b)) -
                          Times(BodyJacobian(*c.mechanism, c.kinematics, BodyIndex(b)), model.Q)),
                  1e-12 * Largest(model.T));
    }
  }
}

TEST(Basis, TakenAnewHasTheBitsOfMade) {
  for (unsigned seed = 0; seed < kBases; ++seed) {
    SCOPED_TRACE(seed);
    const Case c(seed);
    const ReducedModel first = ReducedTo(c.mechanism, c.q, 2);
    VectorX q = testing::RandomCoordinates(*c.mechanism, seed);
    CloseLoops(*c.mechanism, q);
    ReductionOptions options;
    options.modes = 2;
    options.interfaces = first.interfaces;
    const auto made = Reduce(c.mechanism, q, options);
    Kinematics kinematics(*c.mechanism);
    ComputeKinematics(*c.mechanism, q, kinematics);
    const auto anew = ReduceAgain(first, q, kinematics, options);
    ASSERT_EQ(made.has_value(), anew.has_value());
    if (!made) continue;
    EXPECT_EQ(made->Q, anew->Q);
    EXPECT_EQ(made->M, anew->M);
    EXPECT_EQ(made->C_perp, anew->C_perp);
    EXPECT_EQ(made->loop_rows, anew->loop_rows);
    EXPECT_EQ(made->B, anew->B);
    const VectorX x = testing::RandomSource(seed).Vector(static_cast<int>(q.size()), 1);
    VectorX y_made, y_anew;
    made->loops.Apply(made->B, x, y_made);
    anew->loops.Apply(anew->B, x, y_anew);
    EXPECT_EQ(y_made, y_anew);
  }
}

}  // namespace
}  // namespace fork1s
