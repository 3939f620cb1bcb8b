// Mechanisms whose compliance and frequencies can be written down.
#include <gtest/gtest.h>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <mechanisms.hpp>

#include "linalg/spectrum.hpp"

namespace fork1s {
namespace {

using testing::Share;

InterfaceCompliance MustWalk(const Mechanism& m, const std::string& body, double tolerance) {
  const std::vector<BodyIndex> bodies{m.FindBody(body)};
  const VectorX q = VectorX::Zero(m.num_coordinates());
  const auto walk = WalkCompliance(m, q, bodies), dense = DenseCompliance(m, q, bodies);
  EXPECT_LT(ComplianceDifference(walk, dense, m.length_scale()), tolerance);
  EXPECT_TRUE(walk.doubts.empty());
  return walk;
}

TEST(ClosedForms, TwoLinkArm) {
  // l = m = 1, elbow at 90 degrees, both springs 100 N·m/rad.
  MechanismDef definition = testing::Chain(2, 1, 1, 100);
  definition.bodies[2].X_PB =
      RigidTransform(Matrix3(Eigen::AngleAxisd(M_PI / 2, Vector3::UnitZ()).matrix()), Vector3(1, 0, 0));
  const auto m = Share(definition);
  const MatrixX C = MustWalk(*m, "tip", 1e-12).C;
  const MatrixX K = C.block<2, 2>(3, 3).inverse();
  MatrixX expected(2, 2);
  expected << 100, 100, 100, 200;
  EXPECT_LT((K - expected).cwiseAbs().maxCoeff(), 1e-10);
  const auto full = FullFrequencies(*m, VectorX::Zero(2));
  const auto model = Reduce(m, VectorX::Zero(2));
  ASSERT_TRUE(model);
  const auto reduced = ReducedFrequencies(*model);
  ASSERT_EQ(full.size(), 2u);
  ASSERT_EQ(reduced.size(), 2u);
  const double known[2] = {7.5693, 19.8168};  // rad/s, five digits
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(2 * M_PI * full[i], known[i], 1e-4);
    EXPECT_NEAR(reduced[i], full[i], 1e-12 * full[i]);
  }
  EXPECT_TRUE(model->warnings.empty());  // that nothing was left out is no fault
}

TEST(ClosedForms, PlanarChainTip) {
  const auto m = Share(testing::Chain(10, 0.1, 0.1, 100));
  const InterfaceCompliance compliance = MustWalk(*m, "tip", 1e-12);
  const MatrixX& C = compliance.C;
  EXPECT_NEAR(C(4, 4), 0.0385, 1e-14);
  EXPECT_NEAR(C(4, 2), 0.055, 1e-14);
  EXPECT_NEAR(C(2, 2), 0.1, 1e-14);
  // A straight planar chain cannot be pushed along itself or out of its plane.
  EXPECT_EQ(compliance.rank, 2);
  EXPECT_EQ(StiffnessFromCompliance(compliance, m->length_scale()).size(), 0);
}

TEST(ClosedForms, CubicStewartPlatform) {
  const double a = 0.3, k = 1000;
  const auto m = Share(testing::CubicStewart(a, k));
  const MatrixX K = StiffnessFromCompliance(MustWalk(*m, "platform", 1e-9), m->length_scale());
  ASSERT_EQ(K.rows(), 6);
  EXPECT_LT((K.block<3, 3>(3, 3) - 2 * k * Matrix3::Identity()).cwiseAbs().maxCoeff(), 1e-8 * k);
  EXPECT_LT((K.block<3, 3>(0, 3)).cwiseAbs().maxCoeff(), 1e-8 * k * a);
  const Vector3 turning = PrincipalValues(K.block<3, 3>(0, 0));
  EXPECT_LT((turning - k * a * a * Vector3(0.5, 0.5, 2)).cwiseAbs().maxCoeff(), 1e-8 * k * a * a);
  const auto model = Reduce(m, VectorX::Zero(m->num_coordinates()));
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_EQ(model->loop_rank(), 15);
  EXPECT_EQ(model->size(), 6);
}

TEST(ClosedForms, FourBar) {
  const testing::FourBar bar;
  const auto m = Share(bar.Definition());
  // Rates for a crank that turns at 1 rad/s: C moves with the coupler and across the rocker.
  auto cross = [](const Vector2& u, const Vector2& v) { return u.x() * v.y() - u.y() * v.x(); };
  const Vector2 c = bar.C - bar.B, r = bar.C - bar.D, b = bar.B - bar.A;
  const double w_coupler = -cross(b, r) / cross(c, r);
  const double w_rocker = -cross(b, c) / cross(c, r);
  VectorX j(6);
  j << 0, 0, w_coupler, -b.y(), b.x(), 0;  // the coupler's frame is at B
  const double k = bar.k_A + bar.k_D * w_rocker * w_rocker;
  const MatrixX C = MustWalk(*m, "coupler", 1e-10).C;
  EXPECT_LT((C - j * j.transpose() / k).cwiseAbs().maxCoeff(), 1e-12 * C.cwiseAbs().maxCoeff());

  // One freedom: half the inertia of three rods, each about its own centre plus its centre's motion.
  auto rod = [](const Vector2& along, double w, const Vector2& v_from) {
    const Vector2 turned(-along.y(), along.x());
    return 0.1 * ((v_from + 0.5 * w * turned).squaredNorm() + along.squaredNorm() / 12 * w * w);
  };
  const double inertia = rod(b, 1, {0, 0}) + rod(c, w_coupler, {-b.y(), b.x()}) + rod(r, w_rocker, {0, 0});
  const auto full = FullFrequencies(*m, VectorX::Zero(3));
  ASSERT_EQ(full.size(), 1u);
  EXPECT_NEAR(full[0], std::sqrt(k / inertia) / (2 * M_PI), 1e-10 * full[0]);
  const auto model = Reduce(m, VectorX::Zero(3));
  ASSERT_TRUE(model);
  EXPECT_EQ(model->loop_rank(), 2);  // three rows, one of them across the plane
  ASSERT_EQ(model->size(), 1);
  EXPECT_NEAR(ReducedFrequencies(*model).at(0), full[0], 1e-10 * full[0]);
}

}  // namespace
}  // namespace fork1s
