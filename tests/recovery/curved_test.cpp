// Loops closed by their curvature: the second order of what closing them exactly does, and a pose whose
// derivative is exact.
#include <fork1s/mechanism/kinematics.hpp>
#include <random_mechanism.hpp>
#include <recovery/support.hpp>

namespace fork1s {
namespace {

using testing::Deflected;
using testing::MustReduce;
using testing::RandomSource;
using testing::Share;

ReducedModel Curved(ReducedModel model) {
  model.curvature = LoopCurvature(model);
  return model;
}

// Loops in a plane and in space, two that are independent of each other, couplings, slides, ball joints.
std::vector<MechanismDef> Looped() {
  std::vector<MechanismDef> all = {testing::FourBar().Definition(), testing::CubicStewart(0.3, 1000)};
  testing::RandomMechanismOptions options;
  options.bodies = 8;
  options.rigid_closures = 2;
  options.couplings = 1;
  options.coupling_terms = 1;
  for (unsigned seed = 0; seed < 12; ++seed) all.push_back(testing::RandomMechanismDef(seed, options));
  return all;
}

TEST(CurvedRecovery, IsExactToSecondOrder) {
  int with_loops = 0;
  for (const MechanismDef& definition : Looped()) {
    const auto m = Share(definition);
    SCOPED_TRACE(m->name());
    const ReducedModel exact = MustReduce(m), curved = Curved(exact);
    ASSERT_TRUE(curved.curvature.exists());
    RandomSource random(3);
    const VectorX z = random.Vector(exact.size(), 1);
    // ½ N[z, z] by the other method: differences of the µ that close the loops exactly.
    Configuration at(exact), by_curve(curved);
    at.closing_tolerance = 1e-14;
    const ReducedState small = Deflected(exact, z, 1e-3);
    ReducedState back = small;
    back.z = -small.z;
    Configure(exact, small, at);
    VectorX mu = 0.5 * at.mu;
    Configure(exact, back, at);
    mu += 0.5 * at.mu;
    Configure(curved, small, by_curve);
    const VectorX way = [&] {
      VectorX q = VectorX::Zero(exact.num_coordinates());
      exact.loops.SubtractTransposed(exact.B, by_curve.mu, q);
      return q;
    }();
    // What is left is of fourth order of a thousandth, over the second, times how bent a random loop is.
    EXPECT_LT((mu - by_curve.mu).norm(), 1e-3 * mu.norm() + 1e-13);
    with_loops += way.norm() > 1e-9 ? 1 : 0;
    // So loops open with the third power of the angle.
    double gap[2];
    for (int i = 0; i < 2; ++i) {
      Configure(curved, Deflected(exact, z, i == 0 ? 4e-3 : 8e-3), by_curve);
      gap[i] = ClosureGap(*m, by_curve.kinematics, by_curve.q);
    }
    if (gap[0] > 1e-12) {
      EXPECT_NEAR(std::log2(gap[1] / gap[0]), 3, 0.2);
    }
  }
  EXPECT_GT(with_loops, 10);
}

TEST(CurvedRecovery, RatesAreThoseOfThePose) {
  for (const MechanismDef& definition : Looped()) {
    const ReducedModel model = Curved(MustReduce(Share(definition)));
    RandomSource random(7);
    const VectorX direction = random.Vector(model.size(), 1);
    ReducedState state = Deflected(model, random.Vector(model.size(), 1), 0.3);
    Configuration at(model);
    Configure(model, state, at);
    const VectorX rate = at.Q_now * direction;
    // The pose is quadratic in z, so that a central difference has nothing but rounding.
    const double h = state.z.norm() / direction.norm();
    state.z += h * direction;
    Configure(model, state, at);
    VectorX difference = at.q;
    state.z -= 2 * h * direction;
    Configure(model, state, at);
    difference = (difference - at.q) / (2 * h);
    EXPECT_LT((rate - difference).norm(), 1e-13 * (rate.norm() + at.q.norm() / h)) << definition.name;
  }
}

// Whatever was asked before: the pose is a function of the state.
TEST(CurvedRecovery, HasNoMemory) {
  const ReducedModel model = Curved(MustReduce(Share(testing::CubicStewart(0.3, 1000))));
  RandomSource random(1);
  const ReducedState a = Deflected(model, random.Vector(model.size(), 1), 0.2),
                     b = Deflected(model, random.Vector(model.size(), 1), 0.3);
  Configuration first(model), second(model);
  Configure(model, a, first);
  Configure(model, b, second);
  Configure(model, a, second);
  EXPECT_EQ(first.q, second.q);
  EXPECT_EQ(first.Q_now, second.Q_now);
}

}  // namespace
}  // namespace fork1s
