// Too few descriptors to open what is needed: the program ends with a sentence, and loses nothing that was
// there.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(Descriptors, TooFewEndWithASentence) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP()
      << "the sanitizer opens a pipe of its own to look at an object, and calls it bad where it cannot";
#endif
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "few.h5").string(),
                    kept = (ScratchFolder() / "kept.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.1 --record " + kept + " " + model).code, 0);
  const std::string before = Slurp(kept);
  int failed = 0;
  for (int most = 3; most <= 8; ++most)
    for (const std::string& command :
         {"inspect " + model, "run --time 0.1 --record " + file + " " + model, "replay " + kept,
          "export " + kept + " " + (ScratchFolder() / "few").string(),
          "run --time 0.1 --record " + kept + " /no/such/" + model}) {
      const Outcome o = Shell("ulimit -n " + std::to_string(most) + "; exec " FORK1S_BINARY " " + command);
      if (o.code == 127) continue;  // not even its libraries were found
      EXPECT_TRUE(o.code == 0 || o.code == 3) << most << ' ' << command << ": " << o.code << o.err;
      if (o.code == 0) continue;
      ++failed;
      EXPECT_NE(o.err.find("fork1s: "), std::string::npos) << most << ' ' << command << o.err;
    }
  EXPECT_GT(failed, 5);
  EXPECT_EQ(Slurp(kept), before);
}

}  // namespace
}  // namespace fork1s::test
