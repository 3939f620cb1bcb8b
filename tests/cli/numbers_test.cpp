// Numbers that are none, on the command line: exit code 2 and a sentence, before anything is read.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(Numbers, OfOptionsAreFiniteAndWithinReason) {
  for (const char* bad : {"nan", "-nan", "inf", "-inf", "1e300", "1e999", "0x", "1,5x", "''"})
    for (const char* command : {"run --time", "run --dt", "run --stiffness-scale", "view --no-open --time",
                                "view --no-open --dt", "compare --time", "compare --dt", "inspect --time",
                                "export none.h5 none.png --at", "export none.h5 none.html --zoom",
                                "export none.h5 none.glb --fps", "export none.h5 none.mp4 --from 0"}) {
      const std::string line = std::string(command) + (std::string(command).back() == '0' ? "," : " ") + bad;
      // Neither file is there: what is said first is about the number.
      const Outcome o = Fork1s(line + (line.find("export") == 0 ? "" : " /no/such/model.xml"));
      EXPECT_EQ(o.code, 2) << line << o.err;
      EXPECT_FALSE(o.err.empty()) << line;
    }
}

TEST(Numbers, OfListsAreFiniteAndWithinReason) {
  const std::string model = Write("finger.xml", FingerModel());
  for (const std::string bad : {"nan", "inf", "1e300", "1e999"})
    for (const std::string& arguments :
         {"run --pd " + bad + ",1", "run --pd knuckle=1," + bad, "run --q knuckle=" + bad,
          "run --base-pose 0,0," + bad, "run --ground=" + bad, "statics --body tip --force 0,0," + bad,
          "statics --body tip --torque 0,0," + bad, "statics --body tip --gravity 0,0," + bad}) {
      const Outcome o = Fork1s(arguments + " " + model);
      EXPECT_EQ(o.code, 2) << arguments << o.err;
      EXPECT_NE(o.err.find(bad), std::string::npos) << o.err;
    }
}

TEST(Numbers, OfModesAreCounted) {
  for (const char* bad : {"-1", "nan", "1.5", "99999999999999999999"}) {
    const Outcome o = Fork1s(std::string("run --modes ") + bad + " /no/such/model.xml");
    EXPECT_EQ(o.code, 2) << bad << o.err;
    EXPECT_LT(o.err.size(), 200u) << o.err;
  }
}

TEST(Numbers, OfStepsCanBeCounted) {
  const std::string model = Write("finger.xml", FingerModel());
  const Outcome o = Fork1s("run --time 1e9 " + model);
  EXPECT_EQ(o.code, 2);
  EXPECT_NE(o.err.find("6e+10 steps"), std::string::npos) << o.err;
}

TEST(Names, ThatAreNoTextStillPrint) {
  std::string text = FingerModel();
  text.replace(text.find("knuckle"), 7, "kn\xFF\xFEle!");
  const std::string model = Write("bytes.xml", text);
  for (const char* command : {"inspect", "reduce", "statics --body tip --force 0,0,1", "run --time 0.1"}) {
    const Outcome o = Fork1s(std::string(command) + " --json " + model);
    EXPECT_EQ(o.code, 0) << command << o.err;
    EXPECT_NO_THROW(o.Json()) << command;
  }
}

}  // namespace
}  // namespace fork1s::test
