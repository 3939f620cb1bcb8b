// Recordings of runs whose level of detail changes on the way.
#include <sim/gripper.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

TEST(RecordedFidelity, ReplaysBitByBitAndKeepsItsShape) {
  Folder folder;
  Simulation simulation = Gripper{}.Start();
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Squeeze(simulation, 0.01);
  const std::size_t bodies = simulation.bodies().size();
  std::vector<RigidTransform> ball;
  for (int i = 0; i < 200; ++i) {
    if (i == 120) {
      ASSERT_TRUE(simulation.SetFidelity({DetailLevel::kObject, 1, Recovery::kExact}));
    }
    if (i == 160) {
      ASSERT_TRUE(simulation.SetFidelity({DetailLevel::kAll, -1, Recovery::kExact}));
    }
    ASSERT_TRUE(recorder->Append(simulation, simulation.Step()));
    ASSERT_EQ(simulation.bodies().size(), bodies);
    ball.push_back(simulation.Pose("ball"));
  }
  ASSERT_TRUE(recorder->Finish());

  auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  const int b = simulation.FindBody("ball");
  EXPECT_EQ(recording->FidelityOf(119), Fidelity{});
  EXPECT_EQ(recording->FidelityOf(120), (Fidelity{DetailLevel::kObject, 1, Recovery::kExact}));
  EXPECT_EQ(recording->FidelityOf(199).level, DetailLevel::kAll);
  for (int i : {0, 119, 120, 159, 160, 199})
    EXPECT_LT((recording->Pose(i, b).translation() - ball[static_cast<std::size_t>(i)].translation()).norm(),
              1e-15);
  // Grip: two contacts on the ball, frozen or not, each with half of its weight.
  for (int i : {119, 159, 199}) {
    const auto contacts = recording->Contacts(i);
    ASSERT_EQ(contacts.size(), 2u) << i;
    for (const RecordedContact& c : contacts) {
      const Vector3 on_ball = c.body_b == b ? c.force : Vector3(-c.force);
      EXPECT_TRUE(c.body_a == b || c.body_b == b) << i;
      EXPECT_NEAR(on_ball.z(), 0.05 * 9.81, 0.01 * 0.05 * 9.81) << i;
    }
  }

  auto replay = Replay(*recording);
  ASSERT_TRUE(replay) << replay.error().Text();
  EXPECT_TRUE(replay->identical) << replay->first_difference_step;
}

}  // namespace
}  // namespace fork1s::testing
