// Who sends many requests gets his share, and no more.
#include <gtest/gtest.h>

#include "server/command_queue.hpp"
#include "server/request_ration.hpp"

namespace fork1s::test {
namespace {

using internal::CommandQueue;

Command Make(Command::Kind kind, int viewer, const char* setting = "", double value = 0) {
  Command c;
  c.kind = kind;
  c.viewer = viewer;
  c.setting = setting;
  c.value = value;
  return c;
}

std::vector<Command> All(CommandQueue& queue) {
  std::vector<Command> all;
  while (auto c = queue.Pop()) all.push_back(*c);
  return all;
}

TEST(CommandQueue, SettingsThatAlternateStayTwo) {
  CommandQueue queue(1024);
  for (int i = 0; i < 600; ++i) {
    EXPECT_TRUE(queue.Push(Make(Command::Kind::kSet, 1, "friction", i)));
    EXPECT_TRUE(queue.Push(Make(Command::Kind::kSet, 2, "damping", i)));
  }
  const auto all = All(queue);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].setting, "friction");
  EXPECT_EQ(all[0].value, 599);
  EXPECT_EQ(all[1].value, 599);
}

TEST(CommandQueue, SlidersOfOneSettingAreTold) {
  CommandQueue queue(1024);
  Command first = Make(Command::Kind::kSet, 1, "control"), second = first;
  second.index = 1;
  queue.Push(first);
  queue.Push(second);
  EXPECT_EQ(All(queue).size(), 2u);
}

TEST(CommandQueue, APullMovesUntilItIsLetGo) {
  CommandQueue queue(1024);
  for (int i = 0; i < 5; ++i) queue.Push(Make(Command::Kind::kPull, 1, "", i));
  queue.Push(Make(Command::Kind::kSet, 1, "friction"));
  queue.Push(Make(Command::Kind::kPull, 1, "", 5));
  queue.Push(Make(Command::Kind::kPull, 2, "", 6));
  queue.Push(Make(Command::Kind::kRelease, 1));
  queue.Push(Make(Command::Kind::kPull, 1, "", 7));
  std::vector<double> pulls;
  for (const Command& c : All(queue))
    if (c.kind == Command::Kind::kPull) pulls.push_back(c.value);
  EXPECT_EQ(pulls, (std::vector<double>{5, 6, 7}));
}

TEST(CommandQueue, IsBounded) {
  CommandQueue queue(10);
  int taken = 0;
  for (int i = 0; i < 100; ++i) taken += queue.Push(Make(Command::Kind::kStep, 1)) ? 1 : 0;
  EXPECT_EQ(taken, 10);
  queue.PushAlways(Make(Command::Kind::kLeft, 1));
  EXPECT_EQ(All(queue).size(), 11u);
}

// Requests of 0.1 s each, as many as are allowed, beside frames of 1/60 s: half of the time stays.
TEST(RequestRation, LeavesItsShareToOthers) {
  RequestRation ration(0.5, 1.0 / 60);
  double now = 0, spent = 0, passed = 1.0 / 60;
  while (now < 100) {
    ration.Pass(passed);
    passed = 1.0 / 60;
    while (ration.Allows()) {
      ration.Spend(0.1);
      spent += 0.1;
      passed += 0.1;
    }
    now += passed;
  }
  EXPECT_NEAR(spent / now, 0.5, 0.02);
}

TEST(RequestRation, DoesNotSaveUp) {
  RequestRation ration(0.5, 1.0 / 60);
  ration.Pass(1000);
  ration.Spend(0.01);
  EXPECT_FALSE(ration.Allows());
}

}  // namespace
}  // namespace fork1s::test
