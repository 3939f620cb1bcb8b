// Exact recovery leaves no gaps, twist recovery quadratic ones, and the same bits from any number of threads.
#include <fork1s/mechanism/kinematics.hpp>
#include <random_mechanism.hpp>
#include <recovery/support.hpp>

#include <cmath>
#include <cstring>

#include "parallel/parallel_for.hpp"

namespace fork1s {
namespace {

using testing::Deflected;
using testing::LargestGap;
using testing::MustReduce;
using testing::RandomMechanismOptions;
using testing::RandomSource;
using testing::Share;

constexpr double kDegree = M_PI / 180;

TEST(ExactRecovery, LeavesNoGapOnTrees) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    const auto m = Share(testing::RandomMechanismDef(seed));
    const ReducedModel model = MustReduce(m);
    RandomSource random(seed);
    const ReducedState state = Deflected(model, random.Vector(model.size(), 1), 0.7);
    Configuration scratch(model);
    std::vector<RigidTransform> X_RB;
    RecoverPosesExact(model, state, scratch, X_RB);
    // Products of a dozen poses of about a metre.
    EXPECT_LT(LargestGap(*m, X_RB), 1e-13);
    for (std::size_t b = 0; b < X_RB.size(); ++b) EXPECT_TRUE(X_RB[b].IsFinite());
  }
}

void ExpectClosed(const std::shared_ptr<const Mechanism>& m, double angle) {
  const ReducedModel model = MustReduce(m);
  RandomSource random(5);
  Configuration scratch(model);
  std::vector<RigidTransform> X_RB;
  for (int i = 0; i < 10; ++i) {
    const ReducedState state = Deflected(model, random.Vector(model.size(), 1), angle);
    RecoverPosesExact(model, state, scratch, X_RB);
    // Far below what anybody sees, and above the 1e-10 at which corrections stop.
    EXPECT_LT(LargestGap(*m, X_RB), 1e-9);
    EXPECT_LT(ClosureGap(*m, scratch.kinematics, scratch.q), 1e-9);
  }
}

TEST(ExactRecovery, ClosesTheFourBar) { ExpectClosed(Share(testing::FourBar().Definition()), 15 * kDegree); }

TEST(ExactRecovery, ClosesTheStewartPlatform) {
  ExpectClosed(Share(testing::CubicStewart(0.3, 1000)), 15 * kDegree);
}

// The pose without its derivative, in turn with the derived one in the same storage, as a step's trials have it: where
// poses lie near each other loops close to the same ones, and the derivative is that of a storage of its own.
TEST(ExactRecovery, ThePoseAloneIsThatOfTheDerivedOne) {
  const auto m = Share(testing::FourBar().Definition());
  const ReducedModel model = MustReduce(m);
  RandomSource random(7);
  Configuration scratch(model);
  VectorX z = random.Vector(model.size(), 1);
  for (int i = 0; i < 200; ++i) {
    z += random.Vector(model.size(), 0.3);
    const ReducedState state = Deflected(model, z, 0.3 * std::sin(0.1 * i) + 1e-3);
    Configuration own(model);
    Configure(model, state, own);
    if (random.Chance(0.7)) {
      ConfigurePose(model, state, scratch);
    } else {
      Configure(model, state, scratch);
      EXPECT_LT((scratch.Q_now - own.Q_now).norm(), 1e-8);
    }
    // Corrections stop at 1e-10.
    EXPECT_LT((scratch.q - own.q).cwiseAbs().maxCoeff(), 1e-8) << i;
  }
}

TEST(ExactRecovery, ClosesRandomLoops) {
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  options.couplings = 1;
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    // A random loop may come to its end anywhere; small motions it must follow.
    ExpectClosed(Share(testing::RandomMechanismDef(seed, options)), 2 * kDegree);
  }
}

TEST(ExactRecovery, RatesFollowTheLoops) {
  // Q_now is the derivative of q(z).
  for (const MechanismDef& definition : {testing::FourBar().Definition(), testing::CubicStewart(0.3, 1000)}) {
    const ReducedModel model = MustReduce(Share(definition));
    RandomSource random(7);
    const VectorX direction = random.Vector(model.size(), 1);
    const ReducedState state = Deflected(model, direction, 10 * kDegree);
    Configuration scratch(model);
    scratch.closing_tolerance = 1e-14;
    Configure(model, state, scratch);
    const VectorX rate = scratch.Q_now * direction;
    const double h = 1e-2 * state.z.norm() / direction.norm();
    auto at = [&](double t) {
      ReducedState moved = state;
      moved.z += t * direction;
      Configure(model, moved, scratch);
      return VectorX(scratch.q);
    };
    // Differences of sixth order: (1e-2)^6 of the rate is truncated, 1e-14 / h rounded.
    const VectorX difference =
        (45 * (at(h) - at(-h)) - 9 * (at(2 * h) - at(-2 * h)) + (at(3 * h) - at(-3 * h))) / (60 * h);
    EXPECT_LT((rate - difference).norm(), 1e-10 * rate.norm());
  }
}

TEST(TwistRecovery, ErrorIsQuadratic) {
  RandomMechanismOptions hinges;
  hinges.hinges_only = true;
  for (const MechanismDef& definition :
       {testing::Chain(6, 0.1, 0.1, 30, 0, true), testing::RandomMechanismDef(1, hinges),
        testing::CubicStewart(0.3, 1000), testing::FourBar().Definition()}) {
    const auto m = Share(definition);
    SCOPED_TRACE(m->name());
    const ReducedModel model = MustReduce(m, 100);
    RandomSource random(11);
    const VectorX z = random.Vector(model.size(), 1);
    std::vector<RigidTransform> X_RB;
    double gap[2];
    const double angle[2] = {1 * kDegree, 4 * kDegree};
    for (int i = 0; i < 2; ++i) {
      RecoverPosesTwist(model, Deflected(model, z, angle[i]), X_RB);
      gap[i] = LargestGap(*m, X_RB);
    }
    ASSERT_GT(gap[0], 0);
    EXPECT_NEAR(std::log(gap[1] / gap[0]) / std::log(angle[1] / angle[0]), 2.0, 0.1);
  }
}

TEST(TwistRecovery, NoGapAtTheReferenceAndForOneJoint) {
  const auto m = Share(testing::Chain(1, 0.3, 1, 10));
  const ReducedModel model = MustReduce(m);
  std::vector<RigidTransform> twist, exact;
  const ReducedState state = Deflected(model, VectorX::Ones(1), 1.0);
  RecoverPosesTwist(model, state, twist);
  Configuration scratch(model);
  RecoverPosesExact(model, state, scratch, exact);
  for (std::size_t b = 0; b < twist.size(); ++b) EXPECT_LT(Log(twist[b].inverse() * exact[b]).norm(), 1e-15);
}

TEST(TwistRecovery, SameBitsInParallel) {
  const auto m = Share(testing::Chain(5000, 0.001, 0.001, 50, 0, true));
  const ReducedModel model = MustReduce(m, 0);
  RandomSource random(3);
  const ReducedState state = Deflected(model, random.Vector(model.size(), 1), 0.01);
  std::vector<RigidTransform> serial, parallel;
  RecoverPosesTwist(model, state, parallel);
  WithThreads(1, [&] { RecoverPosesTwist(model, state, serial); });
  ASSERT_EQ(parallel.size(), 5002u);
  for (int b = 0; b < m->num_bodies(); ++b) {
    const auto i = static_cast<std::size_t>(b);
    ASSERT_EQ(std::memcmp(&serial[i], &parallel[i], sizeof serial[i]), 0) << b;
    const RigidTransform own = Exp(model.T_of(BodyIndex(b)) * state.z) * model.X_RB_ref[i];
    ASSERT_LT(Log(own.inverse() * parallel[i]).norm(), 1e-13) << b;  // rounding of turns, on metres
  }
}

}  // namespace
}  // namespace fork1s
