// One linkage written down differently answers alike: ranks, free directions, refusals and compliance.
#include <gtest/gtest.h>

#include <string>

#include "compare.hpp"
#include "random_linkage.hpp"

namespace fork1s::linkages {
namespace {

constexpr unsigned kLinkages = 300;

// What must not change, and the compliance in the world where it is compared.
void ExpectSame(const Methods& a, const Methods& b, const MatrixX& to_a) {
  EXPECT_EQ(a.mobility(), b.mobility());
  EXPECT_EQ(a.plain.interface_rank, b.plain.interface_rank);
  EXPECT_EQ(a.walk.rank, b.walk.rank) << "walk";
  EXPECT_EQ(a.dense.rank, b.dense.rank) << "dense";
  ASSERT_EQ(a.model.has_value(), b.model.has_value());
  if (a.model) {
    EXPECT_EQ(a.linkage.mechanism->num_coordinates() - a.model->loop_rank(),
              b.linkage.mechanism->num_coordinates() - b.model->loop_rank());
    EXPECT_EQ(a.model->num_free, b.model->num_free);
  } else {
    EXPECT_EQ(a.model.error().code, b.model.error().code);
  }
  EXPECT_EQ(a.frequencies.size(), b.frequencies.size());
  const MatrixX P = ProjectOff(a.plain.free_d, a.size);
  const double floor = a.plain.interface_rank > 0 ? 0 : 1e-4 * a.plain.open_compliance * a.size * a.size;
  auto compare = [&](const InterfaceCompliance& x, const InterfaceCompliance& y, const char* method) {
    const MatrixX there = to_a * y.C * to_a.transpose();
    EXPECT_LT(RelativeDifference(P * there * P.transpose(), P * x.C * P.transpose(), a.size, floor), kSame)
        << method;
    EXPECT_LT(SpanDistance(to_a * y.free, x.free, a.size), kSame) << method;
  };
  compare(a.walk, b.walk, "walk");
  compare(a.dense, b.dense, "dense");
}

// Displacements of stacked bodies: turned by R, lengths times `scale`.
MatrixX Change(std::size_t bodies, const Matrix3& R, double scale) {
  MatrixX change =
      MatrixX::Zero(6 * static_cast<Eigen::Index>(bodies), 6 * static_cast<Eigen::Index>(bodies));
  for (Eigen::Index i = 0; i < change.rows(); i += 3) change.block<3, 3>(i, i) = R * (i % 6 < 3 ? 1 : scale);
  return change;
}

template <class Vary>
void ForLinkages(const Vary& vary) {
  int compared = 0;
  for (unsigned seed = 0; seed < kLinkages; ++seed) {
    const Sketch s = RandomLinkage(seed);
    const Methods reference(s, {.keep_order = true});
    if (!reference.plain.well_posed) continue;
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " " << s.family);
    ++compared;
    vary(seed, s, reference);
  }
  EXPECT_GT(compared, 0.9 * kLinkages);
}

TEST(LinkageInvariance, SpanningTreeAndOrderOfBodiesAndJoints) {
  ForLinkages([](unsigned seed, const Sketch& s, const Methods& reference) {
    const MatrixX same = Change(s.interfaces.size(), Matrix3::Identity(), 1);
    for (unsigned k = 1; k < 4; ++k) ExpectSame(reference, Methods(s, {.seed = 1000 * k + seed}), same);
  });
}

TEST(LinkageInvariance, Names) {
  ForLinkages([](unsigned, const Sketch& s, const Methods& reference) {
    const Methods other(s, {.other_names = true, .keep_order = true});
    ExpectSame(reference, other, Change(s.interfaces.size(), Matrix3::Identity(), 1));
    if (!reference.model && !other.model) {
      EXPECT_EQ(JointOf(reference.model.error()).substr(1), JointOf(other.model.error()).substr(4));
    }
  });
}

TEST(LinkageInvariance, UnitOfLength) {
  ForLinkages([](unsigned, const Sketch& s, const Methods& reference) {
    for (const double unit : {1e3, 1e-3}) {
      const Methods other(Scaled(s, unit), {.keep_order = true});
      ExpectSame(reference, other, Change(s.interfaces.size(), Matrix3::Identity(), 1 / unit));
    }
  });
}

TEST(LinkageInvariance, FrameOfTheBase) {
  ForLinkages([](unsigned seed, const Sketch& s, const Methods& reference) {
    const Sketch moved = WithRoot(s, RandomPose(seed, s.size * (seed % 2 ? 1 : 30)));
    ExpectSame(reference, Methods(moved, {.keep_order = true}),
               Change(s.interfaces.size(), Matrix3::Identity(), 1));
  });
}

TEST(LinkageInvariance, PlaceInTheWorld) {
  ForLinkages([](unsigned seed, const Sketch& s, const Methods& reference) {
    const RigidTransform X = RandomPose(seed, 100 * s.size);
    const Sketch moved = Moved(s, X * s.X_WS);
    ExpectSame(reference, Methods(moved, {.keep_order = true}),
               Change(s.interfaces.size(), X.rotation().transpose(), 1));
  });
}

}  // namespace
}  // namespace fork1s::linkages
