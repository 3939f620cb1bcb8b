// The same program gives the same bits whatever memory it was given: steps that were recorded in one layout
// of memory are stepped again in others.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

TEST(SameBits, WhereverMemoryLies) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the address sanitizer has an allocator of its own";
#endif
  const std::string scenes = FORK1S_SOURCE_DIR "/scenes/", file = (ScratchFolder() / "bits.h5").string();
  for (const std::string& scene :
       {"--controls " + scenes + "hammer.csv " + scenes + "hammer.xml", scenes + "firemen.xml"}) {
    ASSERT_EQ(Fork1s("run --time 2 --no-load-factor --record " + file + " " + scene).code, 0);
    for (const char* shift : {"0", "16"}) {
      const Outcome o = Fork1s("replay --json " + file,
                               "env LD_PRELOAD=" FORK1S_SHIFT_MEMORY " FORK1S_SHIFT=" + std::string(shift));
      ASSERT_EQ(o.code, 0) << o.err;
      EXPECT_TRUE(o.Json()["identical"].get<bool>()) << scene << shift;
    }
  }
}

}  // namespace
}  // namespace fork1s::test
