// Poses as arrays are those of one object a body, in f64 to rounding and in f32 to its own.
#include <cmath>
#include <cstring>
#include <fork1s/recovery/pose_arrays.hpp>
#include <random_mechanism.hpp>
#include <recovery/support.hpp>

namespace fork1s {
namespace {

using testing::Deflected;
using testing::MustReduce;
using testing::RandomSource;
using testing::Share;

std::vector<RigidTransform> OneByOne(const ReducedModel& model, const ReducedState& state) {
  std::vector<RigidTransform> X_RB;
  RecoverPosesTwist(model, state, X_RB);
  return X_RB;
}

double TurnBetween(const RigidTransform& a, const RigidTransform& b) {
  return (a.rotation() - b.rotation()).cwiseAbs().maxCoeff();
}

template <class Real>
std::vector<Real> Column(const VectorX& z) {
  std::vector<Real> out;
  for (const double value : z) out.push_back(static_cast<Real>(value));
  return out;
}

template <class Real>
void ExpectThoseOfTwists(const ReducedModel& model, const ReducedState& given, double turn, double share) {
  const std::vector<Real> z = Column<Real>(given.z);
  ReducedState state = given;  // what is left of z in Real, so that only the recovery differs
  for (Eigen::Index k = 0; k < state.z.size(); ++k)
    state.z(k) = static_cast<double>(z[static_cast<std::size_t>(k)]);
  const std::vector<RigidTransform> X_RB = OneByOne(model, state);
  const PoseRecovery<Real> recovery(model, Recovery::kTwist);
  PoseArrays<Real> poses;
  recovery.Recover(z.data(), poses);
  ASSERT_EQ(poses.size(), X_RB.size());
  double far = model.mechanism->length_scale();
  for (const RigidTransform& X : X_RB) far = std::max(far, X.translation().norm());
  for (std::size_t b = 0; b < X_RB.size(); ++b) {
    EXPECT_LT(TurnBetween(poses.Pose(b), X_RB[b]), turn) << b;
    EXPECT_LT((poses.Pose(b).translation() - X_RB[b].translation()).norm(), share * far) << b;
  }
}

// Trees of up to a few dozen bodies, so that blocks are full and not; small turns, large ones, and more than
// half a turn, where the series end.
TEST(PoseArrays, AreThoseOfOneTwistABody) {
  for (unsigned seed = 0; seed < 25; ++seed) {
    testing::RandomMechanismOptions options;
    options.bodies = 3 + static_cast<int>(seed) * 2;
    const ReducedModel model = MustReduce(Share(testing::RandomMechanismDef(seed, options)));
    RandomSource random(seed);
    for (const double angle : {0.0, 1e-6, 0.3, 1.5, 6.0}) {
      SCOPED_TRACE(std::to_string(seed) + ", " + std::to_string(angle));
      const ReducedState state = angle > 0 ? Deflected(model, random.Vector(model.size(), 1), angle)
                                           : ReducedState{VectorX::Zero(model.size()), {}, {}};
      // Products of sums of r terms, up to a full turn and more long.
      ExpectThoseOfTwists<double>(model, state, 2e-14 * (1 + angle), 2e-14 * (1 + angle));
      // The series are cut at 1e-8; T itself is rounded to 6e-8, times what the body turns.
      ExpectThoseOfTwists<float>(model, state, 5e-7 * (1 + angle), 1e-6 * (1 + angle));
    }
  }
}

// On either side of half a turn, where the series ends and one by one begins.
TEST(PoseArrays, AreTheSameOnBothSidesOfHalfATurn) {
  const ReducedModel model = MustReduce(Share(testing::Chain(1, 0.3, 0.2, 5, 0, true)));
  ASSERT_EQ(model.size(), 1);
  for (const double beside : {-1e-3, -1e-6, 1e-6, 1e-3}) {
    SCOPED_TRACE(beside);
    const ReducedState state = Deflected(model, VectorX::Ones(1), M_PI + beside);
    ExpectThoseOfTwists<double>(model, state, 1e-13, 1e-13);
    ExpectThoseOfTwists<float>(model, state, 2e-6, 2e-6);
  }
}

TEST(PoseArrays, ManyStatesAreTheBitsOfEach) {
  const ReducedModel model = MustReduce(Share(testing::RandomMechanismDef(7)));
  const PoseRecovery<float> recovery(model, Recovery::kTwist);
  constexpr std::size_t states = 37, stride = 40;  // two blocks and a part of one
  const auto r = static_cast<std::size_t>(model.size());
  std::vector<float> z(r * stride);
  RandomSource random(3);
  for (std::size_t i = 0; i < states; ++i) {
    const VectorX one = random.Vector(model.size(), i == 20 ? 9 : 0.3);  // one turns too far for the series
    for (std::size_t k = 0; k < r; ++k)
      z[k * stride + i] = static_cast<float>(one(static_cast<Eigen::Index>(k)));
  }
  std::vector<PoseArrays<float>> many(static_cast<std::size_t>(recovery.bodies()));
  recovery.RecoverMany(z.data(), stride, states, many.data());
  PoseArrays<float> one;
  for (std::size_t i = 0; i < states; ++i) {
    std::vector<float> own;
    for (std::size_t k = 0; k < r; ++k) own.push_back(z[k * stride + i]);
    recovery.Recover(own.data(), one);
    for (std::size_t b = 0; b < many.size(); ++b)
      for (int e = 0; e < 12; ++e)
        ASSERT_EQ(std::memcmp(one.row(e) + b, many[b].row(e) + i, sizeof(float)), 0)
            << i << ' ' << b << ' ' << e;
  }
}

}  // namespace
}  // namespace fork1s
