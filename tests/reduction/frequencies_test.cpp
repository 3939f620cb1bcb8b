// Vibration: modes complete the reduction, bounds hold, free motions drop out.
#include <gtest/gtest.h>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

#include "linalg/spectrum.hpp"

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;
using testing::Share;

constexpr unsigned kSeeds = 20;

RandomMechanismOptions Some(unsigned seed) {
  RandomMechanismOptions options;
  options.bodies = 10;
  options.interfaces = 1;
  options.base = seed % 2 ? BaseKind::kFloating : BaseKind::kFixed;
  if (seed % 4 >= 2) {
    options.rigid_closures = 1;
    options.springs = 1;
  }
  return options;
}

std::vector<double> Reduced(const std::shared_ptr<const Mechanism>& m, int modes, int count) {
  ReductionOptions options;
  options.modes = modes;
  options.rank_tolerance = 1e-9;
  const auto model = Reduce(m, VectorX::Zero(m->num_coordinates()), options);
  EXPECT_TRUE(model) << model.error().Text();
  return ReducedFrequencies(*model, count);
}

TEST(Frequencies, AllModesAreTheFullSpectrum) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const auto m = Share(testing::RandomMechanismDef(seed, Some(seed)));
    const auto full = FullFrequencies(*m, VectorX::Zero(m->num_coordinates()), 1000);
    const auto reduced = Reduced(m, 1000, 1000);
    ASSERT_EQ(full.size(), reduced.size());
    // An eigenvalue 1/ω² is right to 1e-15 of the largest: the highest frequencies lose digits by their ratio squared.
    for (std::size_t i = 0; i < full.size(); ++i) {
      const double ratio = full[i] / full[0];
      EXPECT_NEAR(reduced[i], full[i], (1e-10 + 1e-12 * ratio * ratio) * full[i]) << i;
    }
  }
}

TEST(Frequencies, ReducedLieAboveAndFallWithEveryMode) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    const auto m = Share(testing::RandomMechanismDef(seed, Some(seed)));
    const auto full = FullFrequencies(*m, VectorX::Zero(m->num_coordinates()), 6);
    std::vector<double> before;
    for (int modes = 0; modes < 8; modes += 2) {
      const auto now = Reduced(m, modes, 6);
      for (std::size_t i = 0; i < now.size(); ++i) {
        // Rayleigh: a subspace cannot vibrate slower. The slack is rounding.
        EXPECT_GT(now[i], full[i] * (1 - 1e-9)) << modes << " modes, number " << i;
        if (i < before.size()) {
          EXPECT_LT(now[i], before[i] * (1 + 1e-9)) << modes << " modes, number " << i;
        }
      }
      before = now;
    }
  }
}

TEST(Frequencies, FreeJointIsAFloatingBase) {
  // The walker on a floating base, and on an unsprung free joint that hangs on a fixed one.
  const auto floating = Share(testing::Walker(BaseKind::kFloating, 20, 0));
  MechanismDef definition = floating->definition();
  definition.base = BaseKind::kFixed;
  for (BodyDef& body : definition.bodies)
    body.parent = body.parent.valid() ? BodyIndex(body.parent.value() + 1) : BodyIndex(0);
  for (JointDef& joint : definition.joints) joint.body = BodyIndex(joint.body.value() + 1);
  definition.bodies[0].name = "torso";
  BodyDef ground;
  ground.name = "ground";
  definition.bodies.insert(definition.bodies.begin(), ground);
  definition.joints.push_back(JointDef::Free("free", BodyIndex(1)));
  const auto jointed = Share(definition);
  const VectorX q0 = VectorX::Zero(jointed->num_coordinates());
  ASSERT_EQ(q0.size(), 14);
  const auto a = FullFrequencies(*floating, VectorX::Zero(8)), b = FullFrequencies(*jointed, q0);
  ASSERT_EQ(a.size(), 8u);
  ASSERT_EQ(b.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(a[i], b[i], 1e-11 * a[i]);
  const auto model = Reduce(jointed, q0);
  ASSERT_TRUE(model) << model.error().Text();
  ASSERT_EQ(model->num_free, 6);
  const auto r = ReducedFrequencies(*model);
  ASSERT_EQ(r.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(a[i], r[i], 1e-11 * a[i]);
  // The six rigid motions: no spring feels them, to the last bit, and all bodies share them.
  Kinematics kinematics(*jointed);
  ComputeKinematics(*jointed, q0, kinematics);
  const MatrixX K = StiffnessMatrix(*jointed, kinematics, q0);
  const std::vector<int> free = model->FreeColumns();
  const MatrixX N = model->Q(Eigen::all, free);
  EXPECT_EQ((K * N).cwiseAbs().maxCoeff(), 0);
  for (int body = 2; body < jointed->num_bodies(); ++body) {
    const Matrix6X T = model->T_of(BodyIndex(body))(Eigen::all, free);
    EXPECT_EQ((T - model->T_of(BodyIndex(1))(Eigen::all, free)).cwiseAbs().maxCoeff(), 0) << body;
  }
}

// Generalized eigenvalues of dense M and K: the method that the library does not take.
std::vector<double> Dense(const Mechanism& m, std::size_t count) {
  const VectorX q = VectorX::Zero(m.num_coordinates());
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  MatrixX M;
  MassMatrix(m, kinematics, M);
  const VectorX root = m.stiffness().cwiseSqrt().cwiseInverse();
  const MatrixX scaled = root.asDiagonal() * M * root.asDiagonal();
  const VectorX mu = EigenvaluesOf(scaled).reverse();
  std::vector<double> hertz;
  for (std::size_t i = 0; i < count; ++i)
    hertz.push_back(1 / (2 * M_PI * std::sqrt(mu(static_cast<Eigen::Index>(i)))));
  return hertz;
}

TEST(Frequencies, IterativeModesOfALongChainAreTheDenseOnes) {
  const auto m = Share(testing::Chain(320, 0.01, 0.01, 50, 0, true));
  const VectorX q0 = VectorX::Zero(320);
  const auto dense = Dense(*m, 8), full = FullFrequencies(*m, q0, 8);
  ASSERT_EQ(full.size(), 8u);
  // 1/ω² falls with the fourth power along a beam: the eighth keeps about 1e-14 * 8^4 of its digits.
  for (std::size_t i = 0; i < 8; ++i) EXPECT_NEAR(full[i], dense[i], 1e-8 * dense[i]) << i;
  ReductionOptions options;
  options.modes = 8;
  const auto model = Reduce(m, q0, options);
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_EQ(model->num_modes, 8);
  // Fixed-interface modes diagonalise their block of M, in falling order of 1/ω².
  const MatrixX M = model->M.bottomRightCorner(8, 8);
  const VectorX mu = M.diagonal();
  EXPECT_LT((M - MatrixX(mu.asDiagonal())).cwiseAbs().maxCoeff(), 1e-10 * mu(0));
  for (Eigen::Index i = 1; i < 8; ++i) EXPECT_LT(mu(i), mu(i - 1) * (1 + 1e-12));
  const auto reduced = ReducedFrequencies(*model, 4);
  // Eight modes leave the first four of a chain with less than one part in a thousand.
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(reduced[i], dense[i], 1e-3 * dense[i]) << i;
}

TEST(Frequencies, AThousandJointsNeedNoSquareMatrix) {
  const int n = 1000;
  const auto m = Share(testing::Chain(n, 0.003, 0.003, 50, 0.1, true));
  const auto model = Reduce(m, VectorX::Zero(n));
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_TRUE(model->has_complement);
  EXPECT_EQ(model->k_inverse.size(), n);
  EXPECT_EQ(model->C_perp.size(), 0);
  EXPECT_EQ(model->Q.rows(), n);
  EXPECT_LE(model->size(), 10);
  EXPECT_EQ(model->T.cols(), m->num_bodies() * model->size());
  // A uniform cantilever of bending stiffness k l and length n l: β = 1.8751, within the 1/n of its discretisation.
  const double length = n * 0.003, EI = 50 * 0.003;
  const double beam = 1.875104 * 1.875104 / (2 * M_PI) * std::sqrt(EI / (1.0 * std::pow(length, 4)));
  const auto full = FullFrequencies(*m, VectorX::Zero(n), 4);
  ASSERT_EQ(full.size(), 4u);
  // Two joints of three bend about z, one about y: 3/2 and 3 times as stiff as if every joint did.
  EXPECT_NEAR(full[0], beam * std::sqrt(1.5), 5e-3 * beam);
  EXPECT_NEAR(full[1], beam * std::sqrt(3.0), 5e-3 * beam);
  const auto reduced = ReducedFrequencies(*model, 2);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_GT(reduced[i], full[i] * (1 - 1e-9));
    EXPECT_NEAR(reduced[i], full[i], 1e-3 * full[i]);
  }
}

// Equal limbs swing at equal frequencies, each of which counts as often as there are limbs: beyond a few
// dozen coordinates modes come from an iteration that may find one of several.
TEST(Frequencies, EqualLimbsHaveTheirModesOftenEnough) {
  for (const int limbs : {1, 2, 3}) {
    MechanismBuilder builder("limbs");
    BodyDef hub;
    hub.name = "hub";
    hub.parent = builder.base();
    hub.inertia.mass = 50;
    hub.inertia.rotational = Vector3::Constant(1).asDiagonal();
    const BodyIndex middle = builder.AddBody(hub);
    builder.AddJoint(JointDef::Slide("rise", middle, Vector3::UnitZ()).WithSpring(1e4));
    for (int l = 0; l < limbs; ++l) {
      const Matrix3 turned = ExpRotation(Vector3(0, 0, 2 * M_PI * l / limbs));
      BodyIndex last = middle;
      for (int k = 0; k < 18; ++k) {
        BodyDef link;
        link.name = "link" + std::to_string(l) + "_" + std::to_string(k);
        link.parent = last;
        link.X_PB = k == 0 ? RigidTransform(turned, Vector3::Zero()) : RigidTransform(Vector3(0.05, 0, 0));
        link.inertia.mass = 0.1;
        link.inertia.center = Vector3(0.025, 0, 0);
        link.inertia.rotational = Vector3::Constant(1e-4).asDiagonal();
        last = builder.AddBody(link);
        builder.AddJoint(JointDef::Hinge("bend" + link.name, last, Vector3::UnitY()).WithSpring(200));
      }
    }
    builder.SetInterfaces({"hub"});
    const auto m = Share(builder.definition());
    const auto full = FullFrequencies(*m, VectorX::Zero(m->num_coordinates()), 2 * limbs);
    const auto reduced = Reduced(m, 4 * limbs, 2 * limbs);
    ASSERT_EQ(reduced.size(), full.size());
    // Four modes a limb leave a thousandth of the second pair; a missed one shows as the next, six times as
    // high.
    for (std::size_t i = 0; i < full.size(); ++i)
      EXPECT_NEAR(reduced[i], full[i], 0.01 * full[i]) << limbs << ' ' << i;
  }
}

}  // namespace
}  // namespace fork1s
