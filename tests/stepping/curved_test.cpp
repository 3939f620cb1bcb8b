// Loops closed by their curvature while a mechanism moves.
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

#include <algorithm>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::RandomMechanismOptions;
using testing::RandomSource;
using testing::Still;

// Four-bars, platforms and random loops swing from the same start. What `curved` changes is of third order of
// what moved since the refresh, and loops never open by more than the gap at which they are closed again.
TEST(Curved, SwingsAsExactDoes) {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  options.springs = 1;
  int bent = 0, refreshed = 0;
  std::vector<double> shares;
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
    for (unsigned seed = 0; seed < 10; ++seed) {
      SCOPED_TRACE(seed);
      options.base = base;
      const MechanismDef definition = testing::RandomMechanismDef(seed, options);
      const auto m = testing::Share(definition);
      RandomSource random(seed);
      const VectorX q_dot = random.Vector(m->num_coordinates(), 2);
      const Vector6 V = base == BaseKind::kFloating ? random.Six(1) : Vector6(Vector6::Zero());
      const auto start = [&](Recovery recovery) {
        return MustStart(definition, VectorX::Zero(m->num_coordinates()), q_dot, V,
                         testing::SteppedBy(recovery));
      };
      World exact = start(Recovery::kExact), curved = start(Recovery::kCurved);
      double gap = 0, far = 0, way = 0;
      MechanismState kept;
      const World at_start = start(Recovery::kExact);
      for (int i = 0; i < 120; ++i) {
        exact.Step(Still());
        const StepReport report = curved.Step(Still());
        ASSERT_TRUE(report.finite);
        if (i == 60) curved.mechanisms()[0].Save(kept);
        refreshed += report.refreshes;
        gap = std::max(gap, curved.mechanisms()[0].ClosureGapNow());
        far = std::max(far, testing::FarthestBody(exact, curved));
        way = std::max(way, testing::FarthestBody(exact, at_start));
      }
      EXPECT_LT(gap, MechanismDynamics::Options{}.refresh_gap);
      bent += gap > 1e-6 ? 1 : 0;
      // The worst of them passes near a dead centre.
      EXPECT_LT(far, 0.02 * way);
      shares.push_back(far / way);
      // The pose is a function of what is saved, and nothing else.
      MechanismDynamics& m_curved = curved.mechanisms()[0];
      m_curved.Restore(kept);
      const Configuration first = m_curved.configuration();
      m_curved.Restore(kept);
      EXPECT_EQ(first.q, m_curved.configuration().q);
    }
  EXPECT_GT(bent, 15);
  EXPECT_GT(refreshed, 20);
  std::sort(shares.begin(), shares.end());
  EXPECT_LT(shares[shares.size() / 2], 1e-3);
}

}  // namespace
}  // namespace fork1s
