// Memory that runs out at the n-th allocation of main(), once or for good: the program ends by itself with a
// sentence and an exit code that says so, and what it had recorded opens or is refused. Preloads
// preload/fail_new.cpp.
#include <string>
#include <vector>

#include "command.hpp"

namespace fork1s::test {
namespace {

Outcome WithFailingNew(const std::string& arguments, long at, bool from_then_on) {
  return Fork1s(arguments, "timeout -s KILL 60 env LD_PRELOAD=" FORK1S_FAIL_NEW " FORK1S_FAIL_NEW_AT=" +
                               std::to_string(at) + " FORK1S_FAIL_NEW_ON=" + (from_then_on ? "1" : "0"));
}

// Allocations at which to fail: ever farther apart, other ones for each command.
std::vector<long> Places(double factor, double first) {
  std::vector<long> places;
  for (double at = first; at < 1e5; at *= factor) places.push_back(static_cast<long>(at));
  return places;
}

// Returns how many runs failed.
int Try(const std::string& arguments, double factor, double first) {
  int failed = 0;
  for (const bool from_then_on : {false, true})
    for (const long at : Places(factor, first)) {
      const Outcome o = WithFailingNew(arguments, at, from_then_on);
      const std::string which =
          arguments + ", allocation " + std::to_string(at) + (from_then_on ? " and all later" : "");
      EXPECT_TRUE(o.code == 0 || o.code == 3 || o.code == 4) << which << ": " << o.code << '\n' << o.err;
      if (o.code == 0) continue;
      ++failed;
      EXPECT_NE(o.err.find("memory"), std::string::npos) << which << '\n' << o.err;
    }
  return failed;
}

TEST(OutOfMemory, EveryCommandEndsWithASentence) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer has an allocator of its own";
#endif
  const std::string model = Write("scarce.xml", FingerModel()),
                    record = (ScratchFolder() / "scarce.h5").string();
  EXPECT_GT(Try("run " + model + " --time 0.2 --record " + record, 1.8, 1), 20);
  const Outcome left = Fork1s("replay " + record);
  EXPECT_TRUE(left.code == 0 || left.code == 3) << left.err;
  ASSERT_EQ(Fork1s("run " + model + " --time 0.2 --record " + record).code, 0);
  EXPECT_GT(Try("replay " + record, 1.15, 5), 20);
  EXPECT_GT(Try("inspect " + model, 6, 7), 3);
  EXPECT_GT(Try("reduce " + model, 6, 9), 3);
}

}  // namespace
}  // namespace fork1s::test
