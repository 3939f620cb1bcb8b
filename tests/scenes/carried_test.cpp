// What two carry, as one mechanism with both of them.
#include "run.hpp"

namespace fork1s::examples {
namespace {

TEST(BeamWalkers, WalkAsOneMechanismWhileTheBeamIsFrozenToThem) {
  SceneRun run("beam_walkers"), touching("beam_walkers");
  run.Until(1.5);
  touching.Until(1.5);
  const Vector3 before = run.Position("beam");
  auto set = run.simulation().SetFidelity({DetailLevel::kObject, -1, Recovery::kExact});
  ASSERT_TRUE(set) << set.error().Text();
  EXPECT_LT((run.Position("beam") - before).norm(), 1e-12);
  EXPECT_EQ(run.simulation().place(1).mechanism, 0);
  EXPECT_TRUE(run.simulation().world().free_bodies().empty());
  EXPECT_EQ(run.simulation().frozen_grasps()[0].contacts.size(), 4u);
  Course course = run.Until(6);
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_LT(course.gap, 1e-8);
  touching.Until(6);
  // Where it is not frozen the beam slips on its bars by a millimetre or two.
  for (const char* body : {"lead_trunk", "tail_trunk", "beam"})
    EXPECT_LT((run.Position(body) - touching.Position(body)).norm(), 5e-3) << body;
  EXPECT_GT((run.Position("lead_trunk") - before).x(), 0.2) << "on their way";
  // They carry on with a beam that only lies on them.
  const Vector3 then = run.Position("beam");
  ASSERT_TRUE(run.simulation().SetFidelity({}));
  EXPECT_LT((run.Position("beam") - then).norm(), 1e-12);
  course = run.Until(14.5);
  EXPECT_TRUE(course.finite);
  EXPECT_EQ(course.unconverged, 0);
  EXPECT_NEAR((run.Position("beam") - before).x(), 1.26, 0.06);
  EXPECT_NEAR(ContactForce(run.simulation(), "beam").z(), 0.8 * 9.81, 1e-3);
}

}  // namespace
}  // namespace fork1s::examples
