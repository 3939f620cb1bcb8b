// A film that is interrupted, or whose browser dies, leaves nothing behind.
#include <csignal>
#include <cstdlib>
#include <string>
#include <vector>

#include "command.hpp"

namespace fork1s::test {
namespace {

namespace fs = std::filesystem;

// Processes that were started with these words.
std::vector<pid_t> Running(const std::string& words) {
  std::vector<pid_t> found;
  std::error_code gone;
  for (fs::directory_iterator it("/proc", gone), end; it != end; it.increment(gone))
    if (std::isdigit(static_cast<unsigned char>(it->path().filename().string()[0])) != 0 &&
        Slurp(it->path() / "cmdline").find(words) != std::string::npos)
      found.push_back(std::atoi(it->path().filename().c_str()));
  return found;
}

bool IsRunning(const std::string& words) { return !Running(words).empty(); }

TEST(Film, InterruptedLeavesNoBrowserAndNoFolder) {
  if (std::system("which chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "films are drawn by chromium";
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "film.h5").string(),
                    out = (ScratchFolder() / "frames").string();
  ASSERT_EQ(Fork1s("run --time 60 --no-load-factor --record " + file + " " + model).code, 0);
  for (const int signal : {SIGINT, SIGHUP, SIGKILL}) {  // the last one to the browser
    const fs::path temporary = ScratchFolder() / "temporary";
    fs::create_directories(temporary);
    const pid_t child = fork();
    if (child == 0) {
      setenv("TMPDIR", temporary.c_str(), 1);
      if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr)) _exit(126);
      execl(FORK1S_BINARY, "fork1s", "export", "--video", file.c_str(), out.c_str(),
            static_cast<char*>(nullptr));
      _exit(127);
    }
    int status = 0;
    bool ended = false;
    const auto drawing =
        [&] {  // its profile lies there: it is past its first words, at any moment of its start
          for (const fs::directory_entry& work : fs::directory_iterator(temporary))
            if (fs::exists(work.path() / "profile")) return IsRunning(temporary.string());
          return false;
        };
    for (int i = 0; i < 3000 && !ended && !drawing(); ++i) {
      usleep(10000);
      ended = waitpid(child, &status, WNOHANG) == child;
    }
    if (ended && WEXITSTATUS(status) == 3) GTEST_SKIP() << "this program was built without its page";
    ASSERT_FALSE(ended);
    if (signal == SIGKILL)
      for (const pid_t browser : Running(temporary.string())) kill(browser, signal);
    else
      kill(child, signal);
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 3) << signal << ' ' << status;
    EXPECT_TRUE(fs::is_empty(temporary)) << signal;
    bool left = true;
    for (int i = 0; i < 500 && left; ++i) {
      left = IsRunning(temporary.string());
      if (left) usleep(10000);
    }
    EXPECT_FALSE(left) << signal;
    fs::remove_all(temporary);
  }
}

}  // namespace
}  // namespace fork1s::test
