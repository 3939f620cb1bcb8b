// A film that is interrupted, or whose browser dies, leaves nothing behind; while it is drawn nobody else
// reaches the browser.
#include <csignal>
#include <cstdlib>
#include <iterator>
#include <set>
#include <sstream>
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

// Inodes of TCP sockets that listen, of this network namespace.
std::set<std::string> ListeningSockets() {
  std::set<std::string> inodes;
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::istringstream lines(Slurp(table));
    std::string line;
    std::getline(lines, line);  // the heading
    while (std::getline(lines, line)) {
      std::istringstream words(line);
      std::vector<std::string> fields{std::istream_iterator<std::string>(words), {}};
      if (fields.size() > 9 && fields[3] == "0A") inodes.insert(fields[9]);
    }
  }
  return inodes;
}

bool Listens(pid_t process) {
  static const std::string kSocket = "socket:[";
  const std::set<std::string> listening = ListeningSockets();
  std::error_code gone;
  for (fs::directory_iterator it("/proc/" + std::to_string(process) + "/fd", gone), end; !gone && it != end;
       it.increment(gone)) {
    std::error_code closed;
    const std::string target = fs::read_symlink(it->path(), closed).string();
    if (target.rfind(kSocket, 0) == 0 &&
        listening.contains(target.substr(kSocket.size(), target.size() - kSocket.size() - 1)))
      return true;
  }
  return false;
}

bool HasChromium() { return std::system("which chromium >/dev/null 2>&1") == 0; }

// `fork1s export --video`, with temporary files of its own.
pid_t StartFilm(const std::string& recording, const std::string& out, const fs::path& temporary) {
  const pid_t child = fork();
  if (child != 0) return child;
  setenv("TMPDIR", temporary.c_str(), 1);
  if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr)) _exit(126);
  execl(FORK1S_BINARY, "fork1s", "export", "--video", recording.c_str(), out.c_str(),
        static_cast<char*>(nullptr));
  _exit(127);
}

// Any user of the machine could make a browser with an open debugging port read the files of its owner.
TEST(Film, BrowserListensNowhereAndItsProfileIsPrivate) {
  if (!HasChromium()) GTEST_SKIP() << "films are drawn by chromium";
  const std::string file = (ScratchFolder() / "private.h5").string();
  const fs::path out = ScratchFolder() / "private_frames", temporary = ScratchFolder() / "private_temporary";
  ASSERT_EQ(
      Fork1s("run --time 20 --no-load-factor --record " + file + " " + Write("finger.xml", FingerModel()))
          .code,
      0);
  fs::create_directories(temporary);
  const pid_t child = StartFilm(file, out.string(), temporary);
  int status = 0;
  bool ended = false;
  for (int i = 0; i < 6000 && !ended && !fs::exists(out / "000001.png"); ++i) {  // the page runs
    usleep(10000);
    ended = waitpid(child, &status, WNOHANG) == child;
  }
  if (ended && WIFEXITED(status) && WEXITSTATUS(status) == 3)
    GTEST_SKIP() << "this program was built without its page";
  ASSERT_FALSE(ended);
  const std::vector<pid_t> browser = Running(temporary.string());
  EXPECT_GT(browser.size(), 1u);  // with its helpers
  for (const pid_t process : browser) {
    EXPECT_FALSE(Listens(process)) << process;
    const std::string words = Slurp("/proc/" + std::to_string(process) + "/cmdline");
    EXPECT_EQ(words.find("token="), std::string::npos) << words;
  }
  EXPECT_TRUE(Listens(child));  // the page's server, so that this test sees who listens
  int profiles = 0;
  for (const fs::directory_entry& work : fs::directory_iterator(temporary)) {
    EXPECT_EQ(fs::status(work.path()).permissions(), fs::perms::owner_all) << work.path();
    if (!fs::exists(work.path() / "profile")) continue;
    ++profiles;
    EXPECT_EQ(fs::status(work.path() / "profile").permissions(), fs::perms::owner_all);
    EXPECT_TRUE(fs::exists(work.path() / "profile" / "Default"));  // the browser took it
  }
  EXPECT_EQ(profiles, 1);
  kill(child, SIGINT);
  waitpid(child, &status, 0);
  EXPECT_TRUE(fs::is_empty(temporary));
  EXPECT_EQ(Slurp(out / "000000.png").substr(0, 4), "\211PNG");
  fs::remove_all(temporary);
}

// Ten frames a second of a recording at 60 steps a second: a sixth of the steps, played in real time.
TEST(Film, FramesASecondOfSimulatedTime) {
  const std::string file = (ScratchFolder() / "fps.h5").string(),
                    out = (ScratchFolder() / "fps_frames").string();
  ASSERT_EQ(Fork1s("run --steps 31 --record " + file + " " + Write("fps.xml", FingerModel())).code, 0);
  EXPECT_EQ(Fork1s("export --fps 10 " + file + " " + (ScratchFolder() / "fps.html").string()).code, 2);
  EXPECT_EQ(Fork1s("export --video --fps 1e5 " + file + " " + out).code, 2);
  if (!HasChromium()) GTEST_SKIP() << "films are drawn by chromium";
  const Outcome o = Fork1s("export --video --fps 10 --width 64 --height 64 " + file + " " + out);
  if (o.err.find("built without its page") != std::string::npos) GTEST_SKIP() << o.err;
  ASSERT_EQ(o.code, 0) << o.err;
  EXPECT_NE(o.out.find("wrote 6 frames"), std::string::npos) << o.out;
}

TEST(Film, InterruptedLeavesNoBrowserAndNoFolder) {
  if (!HasChromium()) GTEST_SKIP() << "films are drawn by chromium";
  const std::string model = Write("finger.xml", FingerModel());
  const std::string file = (ScratchFolder() / "film.h5").string(),
                    out = (ScratchFolder() / "frames").string();
  ASSERT_EQ(Fork1s("run --time 60 --no-load-factor --record " + file + " " + model).code, 0);
  for (const int signal : {SIGINT, SIGHUP, SIGKILL}) {  // the last one to the browser
    const fs::path temporary = ScratchFolder() / "temporary";
    fs::create_directories(temporary);
    const pid_t child = StartFilm(file, out, temporary);
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
