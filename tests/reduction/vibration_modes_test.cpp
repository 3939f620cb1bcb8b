// Shapes of vibrations against their equation, and pairs of shapes that change their order under load.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "mechanisms.hpp"
#include "reduction/tangent_stiffness.hpp"

namespace fork1s {
namespace {

using testing::Share;

// Masts of 1.5 kg on hinges about y, the mass 0.4 m above or below, on a sledge along x of 20 kg.
struct MastOnSledge {
  double stiffness, height;
};
std::shared_ptr<const Mechanism> Sledge(const std::vector<MastOnSledge>& masts) {
  MechanismBuilder builder("sledge");
  BodyDef body;
  body.name = "sledge";
  body.parent = builder.base();
  body.inertia = testing::Ball(20, 0.1);
  const BodyIndex sledge = builder.AddBody(body);
  builder.AddJoint(JointDef::Slide("sledge", sledge, Vector3::UnitX()).WithSpring(1e4, 0));
  for (const MastOnSledge& mast : masts) {
    body.name = "mast" + std::to_string(builder.definition().bodies.size());
    body.parent = sledge;
    body.inertia = {1.5, Vector3(0, 0, mast.height), 0.002 * Matrix3::Identity()};
    const BodyIndex at = builder.AddBody(body);
    builder.AddJoint(JointDef::Hinge(body.name, at, Vector3::UnitY()).WithSpring(mast.stiffness, 0));
  }
  builder.SetInterfaces({"sledge"});
  return Share(builder.definition());
}

VibrationModes UnderWeight(const Mechanism& m, const VectorX& q, double g, int count = 8) {
  StaticsOptions options;
  options.gravity_R = Vector3(0, 0, -g);
  return ComputeTangentModes(m, q, ComputeTangentStiffness(m, q, {}, options), count);
}

TEST(VibrationModes, ShapesSolveTheEquationOfMotion) {
  for (const int without_spring : {-1, 2}) {
    MechanismDef definition = testing::Chain(6, 0.1, 0.1, 2, 0, true);
    if (without_spring >= 0)
      definition.joints[static_cast<std::size_t>(without_spring)].freedoms[0].stiffness = 0;
    const auto m = Share(definition);
    const int n = m->num_coordinates();
    const VectorX q = VectorX::Zero(n);
    Kinematics kinematics(*m);
    ComputeKinematics(*m, q, kinematics);
    MatrixX M, K = 2 * MatrixX::Identity(n, n);
    MassMatrix(*m, kinematics, M);
    if (without_spring >= 0) K(without_spring, without_spring) = 0;
    for (const VibrationModes& modes : {ComputeSpringModes(*m, q), UnderWeight(*m, q, 0)}) {
      ASSERT_EQ(modes.hertz.size(), without_spring >= 0 ? 5u : 6u);
      ASSERT_EQ(modes.shapes.cols(), static_cast<Eigen::Index>(modes.hertz.size()));
      for (Eigen::Index i = 0; i < modes.shapes.cols(); ++i) {
        const VectorX x = modes.shapes.col(i), Kx = K * x;
        const double omega = 2 * std::numbers::pi * modes.hertz[static_cast<std::size_t>(i)];
        EXPECT_LT((Kx - omega * omega * (M * x)).norm(), 1e-7 * Kx.norm());  // differences resolve K to 1e-9
      }
    }
  }
}

// A mast that stands loses stiffness by its weight and one that hangs gains it.
TEST(VibrationModes, ModesThatChangeTheirOrderUnderLoadArePairedByShape) {
  const auto m = Sledge({{10, 0.4}, {8, -0.4}});
  const VectorX q = VectorX::Zero(3);
  const VibrationModes springs = ComputeSpringModes(*m, q), loaded = UnderWeight(*m, q, 9.81);
  ASSERT_EQ(springs.hertz.size(), 3u);
  ASSERT_EQ(loaded.hertz.size(), 3u);
  EXPECT_GT(std::abs(springs.shapes(2, 0)), 3 * std::abs(springs.shapes(1, 0)));  // the one that hangs
  EXPECT_GT(std::abs(loaded.shapes(1, 0)), 3 * std::abs(loaded.shapes(2, 0)));    // the one that stands
  const auto pairs = PairModesByShape(*m, q, springs, loaded);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[0].mode, 1);
  EXPECT_EQ(pairs[1].mode, 0);
  EXPECT_EQ(pairs[2].mode, 2);
  for (const ModePair& pair : pairs) {
    EXPECT_GT(pair.agreement, 0.9);
    EXPECT_LE(pair.agreement, 1 + 1e-12);
  }
  // The lowest of each alone are different modes.
  const auto lowest = PairModesByShape(*m, q, ComputeSpringModes(*m, q, 1), UnderWeight(*m, q, 9.81, 1));
  ASSERT_EQ(lowest.size(), 1u);
  EXPECT_EQ(lowest[0].mode, -1);
  // Without load each mode is its own.
  const auto same = PairModesByShape(*m, q, springs, UnderWeight(*m, q, 0));
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(same[static_cast<std::size_t>(i)].mode, i);
    EXPECT_NEAR(same[static_cast<std::size_t>(i)].agreement, 1, 1e-9);
  }
}

TEST(VibrationModes, NothingIsPairedWithAnUnstableEquilibrium) {
  const auto m = Sledge({{5, 0.4}});
  const VectorX q = VectorX::Zero(2);
  const auto pairs = PairModesByShape(*m, q, ComputeSpringModes(*m, q), UnderWeight(*m, q, 9.81));
  ASSERT_EQ(pairs.size(), 2u);
  for (const ModePair& pair : pairs) EXPECT_EQ(pair.mode, -1);
}

}  // namespace
}  // namespace fork1s
