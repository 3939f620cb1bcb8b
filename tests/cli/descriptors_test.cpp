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
      const bool there = command.find("/no/such/") == std::string::npos;
      EXPECT_TRUE(!there || o.err.find("ulimit -n") != std::string::npos) << most << ' ' << command << o.err;
    }
  EXPECT_GT(failed, 5);
  EXPECT_EQ(Slurp(kept), before);
}

TEST(Descriptors, FilesOfAFolderThatCannotBeOpenedAreListed) {
  const auto folder = ScratchFolder() / "one_model";
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "finger.xml") << FingerModel();
  int failed = 0;
  for (int most = 4; most <= 8; ++most) {
    const Outcome o =
        Shell("ulimit -n " + std::to_string(most) + "; exec " FORK1S_BINARY " inspect " + folder.string());
    if (o.code == 127) continue;
    EXPECT_NE((o.out + o.err).find(o.code == 0 ? "finger.xml" : "fork1s: "), std::string::npos)
        << most << o.out << o.err;
    failed += o.out.find("ulimit -n") != std::string::npos ? 1 : 0;
  }
  EXPECT_GT(failed, 0);
}

TEST(Limits, MemoryThatIsUsedUpIsSaid) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer takes terabytes of addresses";
#endif
  const std::string model = Write("finger.xml", FingerModel());
  int failed = 0;
  for (int kilobytes = 40000; kilobytes <= 110000; kilobytes += 2000) {
    const Outcome o =
        Shell("ulimit -v " + std::to_string(kilobytes) + "; exec " FORK1S_BINARY " inspect " + model);
    if (o.code == 127 || o.code == 0) continue;  // not even its libraries were found, or enough
    ++failed;
    EXPECT_EQ(o.code, 3) << kilobytes << o.err;
    EXPECT_NE(o.err.find("memory"), std::string::npos) << kilobytes << o.err;
    EXPECT_EQ(o.err.find("correct the element"), std::string::npos) << kilobytes << o.err;
  }
  EXPECT_GT(failed, 0);
}

TEST(Limits, ProcessesAndThreadsThatCannotBeStartedAreSaid) {
  const std::string model = Write("finger.xml", FingerModel());
  // Root has no such limit.
  const std::string prefix = geteuid() == 0 ? "setpriv --reuid=65534 --regid=65534 --clear-groups " : "";
  std::filesystem::permissions(ScratchFolder(), std::filesystem::perms::others_exec,
                               std::filesystem::perm_options::add);
  const Outcome o =
      Shell(prefix + "prlimit --nproc=1 " FORK1S_BINARY " view --no-open --port 0 --time 0.1 " + model);
  if (o.code == 0) GTEST_SKIP() << "the limit is not enforced here";
  if (o.err.find("page") != std::string::npos) GTEST_SKIP() << "this program was built without its page";
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("ulimit -u"), std::string::npos) << o.err;
}

}  // namespace
}  // namespace fork1s::test
