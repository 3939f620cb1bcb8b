// A session that is watched and touched: no file that is saved over the model ends it, and Ctrl-C does.
#include <csignal>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "server/socket_client.hpp"

namespace fork1s::test {
namespace {

namespace fs = std::filesystem;

// `fork1s view` on a model, in a process group of its own.
class Session {
 public:
  /// `arguments`: of the command line, in place of the model alone.
  explicit Session(const std::vector<std::string>& arguments)
      : out_((ScratchFolder() / "view_out").string()) {
    fs::remove(out_);
    child_ = fork();
    if (child_ == 0) {
      setpgid(0, 0);
      if (!std::freopen(out_.c_str(), "w", stdout) || !std::freopen("/dev/null", "w", stderr)) _exit(126);
      std::vector<std::string> words{"fork1s", "view", "--no-open", "--port", "0", "--json", "--time", "300"};
      words.insert(words.end(), arguments.begin(), arguments.end());
      std::vector<char*> argv;
      for (std::string& word : words) argv.push_back(word.data());
      argv.push_back(nullptr);
      execv(FORK1S_BINARY, argv.data());
      _exit(127);
    }
    for (int i = 0; i < 3000 && address_.empty(); ++i) {
      usleep(10000);
      const std::string text = Slurp(out_);
      if (const auto at = text.find("http://127.0.0.1:"),
          end = text.find("\"}", at == std::string::npos ? 0 : at);
          at != std::string::npos && end != std::string::npos)
        address_ = text.substr(at, end - at);
    }
  }
  explicit Session(const std::string& model) : Session(std::vector<std::string>{model}) {}
  ~Session() {
    if (child_ <= 0) return;
    kill(-child_, SIGKILL);
    waitpid(child_, nullptr, 0);
  }

  /// Of the page, as printed.
  const std::string& address() const { return address_; }
  pid_t process() const { return child_; }
  bool Runs() { return kill(child_, 0) == 0 && waitpid(child_, nullptr, WNOHANG) == 0; }
  /// The exit code after a signal, or the signal that ended it as a negative number.
  int End(int signal) {
    kill(child_, signal);
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  /// Reads what the page gets until a problem with the file is told that holds `words`.
  bool IsTold(SocketClient& page, const std::string& words) {
    for (int i = 0; i < 3000; ++i) {
      const auto frame = page.ReadFrame();
      if (!frame) return false;
      if (frame->opcode == 1 && frame->payload.find("\"problem\"") != std::string::npos &&
          frame->payload.find(words) != std::string::npos)
        return true;
    }
    return false;
  }

 private:
  std::string out_, address_;
  pid_t child_ = -1;
};

#define REQUIRE_PAGE(session) \
  if (session.address().empty()) GTEST_SKIP() << "this program was built without its page"

TEST(View, BadFilesSavedOverTheModelAreToldAndEndNothing) {
  const std::string model = Write("watched.xml", FingerModel());
  Session session(model);
  REQUIRE_PAGE(session);
  SocketClient page(session.address());
  page.Upgrade();
  Write("face_alone.obj", "f 1 2 3\n");
  Write("watched.xml",
        "<mujoco><asset><mesh name=\"m\" file=\"face_alone.obj\"/></asset><worldbody><body><joint/>"
        "<geom type=\"mesh\" mesh=\"m\"/></body></worldbody></mujoco>");
  EXPECT_TRUE(session.IsTold(page, "face_alone.obj"));
  Write("watched.xml", "<mujoco><size nuser_body=\"2000000000\"/><worldbody/></mujoco>");
  EXPECT_TRUE(session.IsTold(page, "nuser_body"));
  fs::remove(model);
  EXPECT_TRUE(session.IsTold(page, "is gone"));
  fs::create_directory(model);
  EXPECT_TRUE(session.Runs());
  fs::remove(model);
  Write("watched.xml", FingerModel());
  EXPECT_TRUE(session.IsTold(page, "\"message\":\"\""));  // all is well again
  EXPECT_EQ(session.End(SIGINT), 0);
}

TEST(View, PlaysARecording) {
  const std::string file = (ScratchFolder() / "viewed.h5").string();
  ASSERT_EQ(Fork1s("run --time 0.2 --record " + file + " " + Write("viewed.xml", FingerModel())).code, 0);
  Session session(file);
  REQUIRE_PAGE(session);
  EXPECT_TRUE(session.Runs());
  const Outcome page = Shell("curl -s '" + session.address() + "'");
  if (page.code != 127) {  // the same page as from export
    ASSERT_EQ(Fork1s("export " + file + " " + (ScratchFolder() / "viewed.html").string()).code, 0);
    EXPECT_EQ(page.out, Slurp(ScratchFolder() / "viewed.html"));
  }
  EXPECT_EQ(session.End(SIGINT), 0);
  const Outcome other = Fork1s("view --no-open --base fixed " + file);
  EXPECT_EQ(other.code, 2);
  EXPECT_NE(other.err.find("is a recording"), std::string::npos) << other.err;
  const std::string damaged = Write("damaged.h5", Slurp(file).substr(0, 100));
  EXPECT_EQ(Fork1s("view --no-open " + damaged).code, 3);
}

TEST(View, PlaysATableOfControls) {
  const std::string model = Write("played.xml", FingerModel());
  const std::string table = Write("played.csv", "time,bend\n0,0\n0.5,0.75\n");
  Session session({model, "--controls", table});
  REQUIRE_PAGE(session);
  SocketClient page(session.address());
  page.Upgrade();
  bool told = false;
  for (int i = 0; i < 3000 && !told; ++i) {
    const auto frame = page.ReadFrame();
    ASSERT_TRUE(frame);
    if (frame->opcode != 1 || frame->payload.find("\"settings\"") == std::string::npos) continue;
    told = nlohmann::json::parse(frame->payload)["controls"] == nlohmann::json{0.75};
  }
  EXPECT_TRUE(told);
  EXPECT_EQ(session.End(SIGINT), 0);

  const std::string other = Write("other.csv", "time,bent\n0,0\n");
  const Outcome missing = Fork1s("view --no-open --port 0 --time 1 " + model + " --controls " + other);
  EXPECT_EQ(missing.code, 3);
  for (const char* words : {"other.csv", "column 'bent' is no control", "bend"})
    EXPECT_NE(missing.err.find(words), std::string::npos) << missing.err;
  const std::string far = Write("far.csv", "time,bend\n0,0\n1,4\n");
  const Outcome beyond = Fork1s("view --no-open --port 0 --time 0.1 " + model + " --controls " + far);
  EXPECT_EQ(beyond.code, 0);
  EXPECT_NE(beyond.err.find("asks 'bend' for 4"), std::string::npos) << beyond.err;
}

TEST(View, AFolderInPlaceOfTheModelIsTold) {
  const std::string model = Write("replaced.xml", FingerModel());
  Session session(model);
  REQUIRE_PAGE(session);
  SocketClient page(session.address());
  page.Upgrade();
  fs::remove(model);
  fs::create_directory(model);
  EXPECT_TRUE(session.IsTold(page, "is a folder now"));
  EXPECT_EQ(session.End(SIGTERM), 0);
  fs::remove(model);
}

std::optional<pid_t> ChildOf(pid_t parent) {
  for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(parent) + "/task"))
    if (const std::string children = Slurp(task.path() / "children"); !children.empty())
      return std::atoi(children.c_str());
  return {};
}

// The process in which the session reads a model, once it has read for a while.
std::optional<pid_t> ReaderOf(const Session& session) {
  for (int i = 0; i < 3000; ++i) {
    usleep(10000);
    if (const auto reader = ChildOf(session.process())) {
      usleep(300000);
      if (ChildOf(session.process()) == reader) return reader;
    }
  }
  return {};
}

// The arguments of the session reach the process that reads, whatever stands before and after the model.
TEST(View, AReaderThatCrashesIsTold) {
  const std::string model = Write("crashing.xml", FingerModel());
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{model},
                                                    {"--", model},
                                                    {"--dt", "0.001", "--interface", "tip", "--", model}}) {
    Write("crashing.xml", FingerModel());
    Session session(arguments);
    REQUIRE_PAGE(session);
    SocketClient page(session.address());
    page.Upgrade();
    Write("crashing.xml", SlowModel());
    const std::optional<pid_t> reader = ReaderOf(session);
    ASSERT_TRUE(reader) << "the model is not read in a process of its own";
    kill(*reader, SIGSEGV);
    EXPECT_TRUE(session.IsTold(page, "brought its reader down"));
    EXPECT_TRUE(session.Runs());
  }
}

// Crashes the next process in which the session reads, other than `last`; returns it.
std::optional<pid_t> CrashReader(const Session& session, pid_t last = -1) {
  for (int i = 0; i < 30000; ++i) {
    usleep(1000);
    const auto reader = ChildOf(session.process());
    if (!reader || *reader == last) continue;
    kill(*reader, SIGSEGV);
    return reader;
  }
  return {};
}

// Keep reads the file, which may have changed meanwhile, and then the copy that it wrote.
TEST(View, AReaderThatCrashesOnKeepingIsTold) {
  const std::string model = Write("kept.xml", FingerModel());
  const fs::path copy = ScratchFolder() / "kept_tuned.xml";
  Session session(std::vector<std::string>{"--no-watch", model});
  REQUIRE_PAGE(session);
  SocketClient page(session.address());
  page.Upgrade();
  const auto answered = [&](const std::string& words) {
    for (int i = 0; i < 3000; ++i) {
      const auto frame = page.ReadFrame();
      if (!frame) return false;
      if (frame->opcode == 1 && frame->payload.find(words) != std::string::npos) return true;
    }
    return false;
  };
  const std::string keep = R"({"type":"write","tuned":false,"moment":0,"text_only":false})";
  page.SendFrame(1, keep);
  ASSERT_TRUE(CrashReader(session)) << "the file is not read in a process of its own";
  EXPECT_TRUE(answered("brought its reader down"));
  EXPECT_TRUE(session.Runs());
  EXPECT_FALSE(fs::exists(copy));
  page.SendFrame(1, keep);
  std::optional<pid_t> first;
  for (int i = 0; i < 30000 && !first; ++i) {
    usleep(1000);
    first = ChildOf(session.process());
  }
  ASSERT_TRUE(first);
  ASSERT_TRUE(CrashReader(session, *first)) << "the copy is not read in a process of its own";
  EXPECT_TRUE(answered("the copy cannot be read"));
  EXPECT_TRUE(session.Runs());
  EXPECT_TRUE(fs::exists(copy));
  // Undisturbed, the next copy is written and read.
  page.SendFrame(1, keep);
  EXPECT_TRUE(answered("\"notes\":[]"));
  EXPECT_TRUE(fs::exists(ScratchFolder() / "kept_tuned2.xml"));
}

TEST(View, EndsWhileItReads) {
  const std::string model = Write("ending.xml", FingerModel());
  Session session(model);
  REQUIRE_PAGE(session);
  Write("ending.xml", SlowModel());
  std::optional<pid_t> reader;
  for (int i = 0; i < 3000 && !reader; ++i) {
    usleep(10000);
    reader = ChildOf(session.process());
  }
  ASSERT_TRUE(reader);
  EXPECT_EQ(session.End(SIGINT), 0);
  for (int i = 0; i < 1000 && kill(*reader, 0) == 0; ++i) usleep(10000);
  EXPECT_NE(kill(*reader, 0), 0) << "the reader outlives its session";
}

}  // namespace
}  // namespace fork1s::test
