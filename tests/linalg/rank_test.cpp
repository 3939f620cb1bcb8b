// Ranks, null spaces and bases by the one policy.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "linalg/null_space.hpp"
#include "linalg/spectrum.hpp"
#include "random_matrix.hpp"

namespace fork1s {
namespace {

using testing::RandomMatrix;

// Q with orthonormal columns, by Gram and Schmidt twice: nothing of what is tested.
MatrixX Orthonormal(Eigen::Index rows, Eigen::Index cols, std::mt19937& engine) {
  MatrixX Q = RandomMatrix(rows, cols, engine);
  for (Eigen::Index j = 0; j < cols; ++j)
    for (int pass = 0; pass < 2; ++pass) {
      for (Eigen::Index k = 0; k < j; ++k) Q.col(j) -= Q.col(k).dot(Q.col(j)) * Q.col(k);
      Q.col(j).normalize();
    }
  return Q;
}

// Singular values as given.
MatrixX WithSingularValues(const VectorX& sigma, Eigen::Index rows, Eigen::Index cols, std::mt19937& engine) {
  const Eigen::Index k = sigma.size();
  return Orthonormal(rows, k, engine) * sigma.asDiagonal() * Orthonormal(cols, k, engine).transpose();
}

TEST(RankPolicy, ThresholdLeavesAThousandForChainedDecisions) {
  // τ = sqrt(1000 ν): after a decision at the threshold the next one's noise ν/τ is a thousand below it.
  const double rounding = kRankThreshold * kRankThreshold / kClearGap;
  EXPECT_NEAR(kRankThreshold / (rounding / kRankThreshold), kClearGap, 1e-9);
  EXPECT_GT(rounding, 4 * std::numeric_limits<double>::epsilon());
}

TEST(RankPolicy, DoubtfulWithinTheBandOnly) {
  const auto decide = [](std::initializer_list<double> values) {
    VectorX sigma(static_cast<Eigen::Index>(values.size()));
    std::copy(values.begin(), values.end(), sigma.data());
    return DecideRank(sigma);
  };
  EXPECT_EQ(decide({}).value, 0);
  EXPECT_FALSE(decide({}).doubtful());
  EXPECT_FALSE(decide({1, 0.5, 1e-15}).doubtful());
  EXPECT_EQ(decide({1, 0.5, 1e-15}).value, 2);
  EXPECT_FALSE(decide({1, 4e-5, 2e-8}).doubtful());
  EXPECT_TRUE(decide({1, 2e-5}).doubtful());
  EXPECT_TRUE(decide({1, 0.1, 1e-7}).doubtful());
  EXPECT_TRUE(decide({1e-7}).doubtful());
  EXPECT_EQ(decide({1e-7}).value, 0);
  EXPECT_DOUBLE_EQ(decide({1, 1e-3, 1e-9}).gap(), 1e6);
}

TEST(NullSpaceOf, RandomMatricesOfKnownRank) {
  std::mt19937 engine(4);
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE(trial);
    const Eigen::Index m = 1 + static_cast<Eigen::Index>(engine() % 30),
                       n = 1 + static_cast<Eigen::Index>(engine() % 30);
    const Eigen::Index r = static_cast<Eigen::Index>(engine() % static_cast<unsigned>(std::min(m, n) + 1));
    VectorX sigma(r);
    for (Eigen::Index i = 0; i < r; ++i)
      sigma(i) = std::pow(10.0, -3.0 * static_cast<double>(engine()) / 4294967295.0);
    const MatrixX A = WithSingularValues(sigma, m, n, engine);
    const NullSpace space = ComputeNullSpace(A);
    ASSERT_EQ(space.rank.value, r);
    EXPECT_EQ(space.unseen.cols(), n - r);
    EXPECT_FALSE(space.rank.doubtful());
    EXPECT_EQ(space.doubtful.size(), 0);
    // Rounding of 30 terms near 1.
    if (n > r) {
      EXPECT_LT((A * space.unseen).cwiseAbs().maxCoeff(), 1e-13);
    }
    MatrixX both(n, n);
    both << space.seen, space.unseen;
    EXPECT_LT((both.transpose() * both - MatrixX::Identity(n, n)).cwiseAbs().maxCoeff(), 1e-13);
    // The independent rows span the others.
    MatrixX rows(static_cast<Eigen::Index>(space.independent_rows.size()), n);
    for (std::size_t i = 0; i < space.independent_rows.size(); ++i)
      rows.row(static_cast<Eigen::Index>(i)) = A.row(space.independent_rows[i]);
    EXPECT_EQ(ComputeNullSpace(rows).rank.value, r);
    EXPECT_EQ(RangeBasis(A).cols(), r);
  }
}

TEST(NullSpaceOf, ADoubtNamesItsDirection) {
  std::mt19937 engine(5);
  const MatrixX U = Orthonormal(6, 3, engine), V = Orthonormal(5, 3, engine);
  for (const double weak : {1e-5, 2e-6, 5e-7, 1e-7}) {
    const MatrixX A = U * Vector3(1, 0.3, weak).asDiagonal() * V.transpose();
    const NullSpace space = ComputeNullSpace(A);
    EXPECT_TRUE(space.rank.doubtful()) << weak;
    EXPECT_EQ(space.rank.value, weak > kRankThreshold ? 3 : 2);
    ASSERT_EQ(space.doubtful.size(), 5);
    // The weak vector is known to rounding over its singular value.
    EXPECT_NEAR(std::abs(space.doubtful.dot(V.col(2))), 1, 1e-6);
  }
}

TEST(NullSpaceOf, EmptyAndZeroMatrices) {
  EXPECT_EQ(ComputeNullSpace(MatrixX(0, 4)).unseen.cols(), 4);
  EXPECT_EQ(ComputeNullSpace(MatrixX::Zero(3, 4)).unseen.cols(), 4);
  EXPECT_EQ(ComputeNullSpace(MatrixX(3, 0)).rank.value, 0);
  EXPECT_EQ(RangeBasis(MatrixX(3, 0)).cols(), 0);
}

// Roots of stiffness on the motions that loops leave: many rows with one entry, some with three, some that fill
// half the columns. Divide and conquer (Eigen 3.4's BDCSVD) gives wrong vectors for 13 of these 400, by up to
// their whole length, for others with other compiler flags; frequencies came out 2.6 % low.
TEST(SingularSpectrumOf, RootsOfStiffness) {
  std::mt19937 engine(8);
  const auto uniform = [&] { return 2.0 * static_cast<double>(engine()) / 4294967295.0 - 1; };
  const auto below = [&](Eigen::Index count) {
    return static_cast<Eigen::Index>(engine() % static_cast<unsigned>(count));
  };
  for (int trial = 0; trial < 400; ++trial) {
    const Eigen::Index n = 18 + below(16), left = n - below(8), half = n / 2, dropped = n - left;
    MatrixX root = MatrixX::Zero(n + 8, n);
    for (Eigen::Index i = 0; i < n; ++i) root(i, i) = 8 + 6 * uniform();
    for (Eigen::Index row = n; row < n + 2; ++row)
      for (int k = 0; k < 3; ++k) root(row, below(n)) += 10 * uniform();
    root.bottomRows(6).leftCols(half) = 5 * RandomMatrix(6, half, engine);
    MatrixX Z = MatrixX::Identity(n, n).rightCols(left);
    if (trial % 2) {
      Z.setZero();
      Z.topLeftCorner(half, half - dropped) = Orthonormal(half, half - dropped, engine);
      Z.bottomRightCorner(n - half, n - half).setIdentity();
    }
    const MatrixX G = root * Z;
    const SingularSpectrum right = RightSingular(G), other = LeftSingular(G.transpose());
    for (const auto* s : {&right, &other}) {
      const MatrixX W = G * s->vectors * s->values.cwiseInverse().asDiagonal();
      // Ratios of singular values stay below 100.
      EXPECT_LT((W.transpose() * W - MatrixX::Identity(left, left)).cwiseAbs().maxCoeff(), 1e-11) << trial;
    }
    EXPECT_LT((SingularValues(G) - right.values).norm(), 1e-11 * right.values(0)) << trial;
  }
}

TEST(Bases, GradedRowsKeepTheirOwnDigits) {
  // Springs 1e18 apart: what the weak one resists must come out to rounding all the same.
  std::mt19937 engine(6);
  for (int trial = 0; trial < 50; ++trial) {
    const MatrixX rows = RandomMatrix(7, 4, engine);
    VectorX weight(7);
    for (Eigen::Index i = 0; i < 7; ++i)
      weight(i) = i < 4 ? std::pow(10.0, 2.0 * static_cast<double>(i)) : 1e-3;
    const MatrixX B = weight.asDiagonal() * rows;
    const MatrixX W = OrthonormalisingFactor(B), Q = B * W;
    // Forming Q rounds by weights of 1e6 and the condition of the strong rows.
    const VectorX sigma = SingularValues(rows.topRows(4));
    const double rounding = 1e-9 * sigma(0) / sigma(3);
    EXPECT_LT((Q.transpose() * Q - MatrixX::Identity(4, 4)).cwiseAbs().maxCoeff(), rounding) << trial;
    const MatrixX basis = GradedRangeBasis(B);
    EXPECT_LT((basis.transpose() * basis - MatrixX::Identity(4, 4)).cwiseAbs().maxCoeff(), 1e-13);
    EXPECT_LT((B - basis * (basis.transpose() * B))
                  .cwiseQuotient(B.cwiseAbs().rowwise().maxCoeff().replicate(1, 4))
                  .cwiseAbs()
                  .maxCoeff(),
              1e-9);
  }
}

TEST(Bases, ComplementAndEchelon) {
  std::mt19937 engine(7);
  const MatrixX Y = Orthonormal(9, 4, engine), rest = OrthogonalComplement(Y);
  ASSERT_EQ(rest.cols(), 5);
  EXPECT_LT((Y.transpose() * rest).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_EQ(OrthogonalComplement(MatrixX(3, 0)), MatrixX(MatrixX::Identity(3, 3)));
  // Two motions of different fingers, mixed, come apart again.
  MatrixX fingers = MatrixX::Zero(6, 2);
  fingers.col(0).head<2>() << 1, -1;
  fingers.col(1).tail<3>() << 0.5, 1, 0.25;
  MatrixX mix(2, 2);
  mix << 0.6, -0.8, 0.8, 0.6;
  const MatrixX apart = EchelonBasis(fingers * mix);
  for (Eigen::Index k = 0; k < 2; ++k) {
    EXPECT_NEAR(apart.col(k).cwiseAbs().maxCoeff(), 1, 1e-15);
    const bool first = apart.col(k).head<2>().norm() > 0.5;
    EXPECT_EQ(first ? apart.col(k).tail<3>().norm() : apart.col(k).head<2>().norm(), 0);
  }
}

}  // namespace
}  // namespace fork1s
