// What is written: never over an input, never over another's work, whole or not at all, and told when it did
// not arrive.
#include <csignal>
#include <string>

#include <fcntl.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include "command.hpp"

namespace fork1s::test {
namespace {

namespace fs = std::filesystem;

std::string At(const std::string& name) { return (ScratchFolder() / name).string(); }

TEST(Outputs, NeverOverWhatIsRead) {
  const std::string model = Write("finger.xml", FingerModel());
  const std::string table = Write("bend.csv", "time,bend\n0,0\n");
  fs::remove(At("hard.h5"));
  fs::create_hard_link(model, At("hard.h5"));
  fs::remove(At("soft.h5"));
  fs::create_symlink(model, At("soft.h5"));
  for (const std::string& out :
       {model, At("hard.h5"), At("soft.h5"), ScratchFolder().string() + "/./finger.xml"})
    for (const char* command :
         {"run --time 0.1 --record ", "reduce --out ", "compare --time 0.1 --report "}) {
      const Outcome o = Fork1s(command + out + " " + model);
      EXPECT_EQ(o.code, 2) << command << out << o.err;
      EXPECT_NE(o.err.find("choose another name"), std::string::npos) << o.err;
      ASSERT_EQ(Slurp(model), FingerModel()) << command << out;
    }
  EXPECT_EQ(Fork1s("run --time 0.1 --controls " + table + " --record " + table + " " + model).code, 2);
  EXPECT_EQ(Slurp(table), "time,bend\n0,0\n");
}

TEST(Outputs, ExportsLeaveTheRecordingAlone) {
  const std::string model = Write("finger.xml", FingerModel());
  for (const char* name : {"a.h5", "a.glb", "a.gltf", "a.html"}) {
    ASSERT_EQ(Fork1s("run --time 0.1 --record " + At(name) + " " + model).code, 0);
    const std::string before = Slurp(At(name));
    EXPECT_EQ(Fork1s("export " + At(name) + " " + At(name)).code, 2) << name;
    EXPECT_EQ(Slurp(At(name)), before) << name;
    fs::remove(At(name));
  }
}

TEST(Outputs, NeverOverFilesOfAnotherKind) {
  const std::string model = Write("finger.xml", FingerModel()),
                    notes = Write("notes.txt", "remember the milk\n");
  for (const char* command : {"run --time 0.1 --record ", "reduce --out ", "compare --time 0.1 --report "}) {
    const Outcome o = Fork1s(command + notes + " " + model);
    EXPECT_EQ(o.code, 3) << command << o.err;
    EXPECT_NE(o.err.find("notes.txt"), std::string::npos) << o.err;
    EXPECT_EQ(Slurp(notes), "remember the milk\n") << command;
  }
}

TEST(Outputs, BuffersGoIntoAFolder) {
  const std::string model = Write("finger.xml", FingerModel()), notes = Write("notes.txt", "milk\n");
  Outcome o = Fork1s("reduce --buffers " + notes + " " + model);
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("notes.txt: cannot be made a folder"), std::string::npos) << o.err;
  EXPECT_EQ(Slurp(notes), "milk\n");
  o = Fork1s("reduce --buffers /dev/full/x " + model);
  EXPECT_EQ(o.code, 3) << o.err;
  const std::string folder = At("buffers/of the finger");
  for (int i = 0; i < 2; ++i) {  // into a new folder, and over its own files
    o = Fork1s("reduce --recovery twist --buffers '" + folder + "' " + model);
    EXPECT_EQ(o.code, 0) << o.err;
    EXPECT_EQ(Slurp(folder + "/recovery.bin").rfind("fork1s recovery\n", 0), 0u);
    EXPECT_NE(Slurp(folder + "/recovery.json").find("\"recovery\": \"twist\""), std::string::npos);
  }
  EXPECT_EQ(Fork1s("reduce --recovery twist " + model).code, 2);  // of the buffers only
  std::ofstream(folder + "/recovery.json") << "{\"notes\": \"of somebody else\"}\n";
  o = Fork1s("reduce --buffers '" + folder + "' " + model);
  EXPECT_EQ(o.code, 3) << o.err;
  EXPECT_NE(o.err.find("recovery.json"), std::string::npos) << o.err;
  EXPECT_EQ(Slurp(folder + "/recovery.json"), "{\"notes\": \"of somebody else\"}\n");
}

TEST(Outputs, DevicesAndLinksAreLeftAsTheyAre) {
  const std::string model = Write("finger.xml", FingerModel());
  for (const char* device : {"/dev/full", "/dev/null"})
    for (const char* command : {"run --time 0.1 --record ", "reduce --out "}) {
      const Outcome o = Fork1s(std::string(command) + device + " " + model);
      EXPECT_EQ(o.code, 3) << command << device << o.err;
      EXPECT_NE(o.err.find("is a device"), std::string::npos) << o.err;
      EXPECT_TRUE(fs::is_character_file(device));
    }
  fs::create_symlink("target.h5", At("link.h5"));
  for (int i = 0; i < 2; ++i) {  // where it leads to nothing, and where it leads to a file
    EXPECT_EQ(Fork1s("reduce --out " + At("link.h5") + " " + model).code, 0);
    EXPECT_TRUE(fs::is_symlink(At("link.h5")));
    EXPECT_GT(fs::file_size(At("target.h5")), 1000u);
  }
}

TEST(Outputs, AnOldRecordingStaysUntilTheNewOneBegins) {
  const std::string model = Write("finger.xml", FingerModel()), file = At("old.h5");
  ASSERT_EQ(Fork1s("run --time 0.1 --record " + file + " " + model).code, 0);
  const std::string before = Slurp(file);
  for (const std::string& arguments :
       {"--time 1e9 " + model, "--dt 1e-9 --time 1000 " + model, "--controls /no/such.csv " + model,
        "--detail nothing " + model, std::string("/no/such/model.xml")}) {
    const Outcome o = Fork1s("run --record " + file + " " + arguments);
    EXPECT_TRUE(o.code == 2 || o.code == 3) << arguments << o.code << o.err;
    EXPECT_EQ(Slurp(file), before) << arguments;
  }
}

TEST(Outputs, OneRunARecording) {
  const std::string model = Write("finger.xml", FingerModel()), file = At("shared.h5");
  const pid_t first = fork();
  if (first == 0) {
    std::freopen("/dev/null", "w", stdout);
    std::freopen("/dev/null", "w", stderr);
    execl(FORK1S_BINARY, "fork1s", "run", "--no-load-factor", "--time", "1e6", "--record", file.c_str(),
          model.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  while (!fs::exists(file)) usleep(1000);
  const Outcome second = Fork1s("run --time 0.1 --record " + file + " " + model);
  EXPECT_EQ(second.code, 3);
  EXPECT_NE(second.err.find("another run"), std::string::npos) << second.err;
  EXPECT_EQ(Fork1s("reduce --out " + file + " " + model).code, 3);
  kill(first, SIGKILL);
  waitpid(first, nullptr, 0);
  const Outcome replay = Fork1s("export " + file + " " + At("tables"));
  EXPECT_EQ(replay.code, 0) << replay.err;
  EXPECT_EQ(Fork1s("run --time 0.1 --record " + file + " " + model).code, 0);  // a dead one holds nothing
}

// A file system of `size` bytes, where it can be mounted.
class SmallDisk {
 public:
  explicit SmallDisk(const std::string& size) : path_(At("disk" + size)) {
    fs::create_directories(path_);
    mounted_ = mount("none", path_.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) umount(path_.c_str());
  }
  bool mounted() const { return mounted_; }
  std::string operator/(const char* name) const { return path_ + "/" + name; }

 private:
  std::string path_;
  bool mounted_ = false;
};

TEST(Outputs, AFullDiskKeepsEveryWholeStep) {
  const SmallDisk small("8k"), larger("2m");
  if (!small.mounted() || !larger.mounted()) GTEST_SKIP() << "mounting a small disk needs root";
  const std::string model = Write("finger.xml", FingerModel());
  for (const char* command : {"run --time 1 --record ", "reduce --out "}) {
    const Outcome o = Fork1s(command + (small / "run.h5") + " " + model);
    EXPECT_EQ(o.code, 3) << command << o.err;
    EXPECT_NE(o.err.find("No space left"), std::string::npos) << o.err;
    EXPECT_EQ(std::distance(fs::directory_iterator(small / ""), fs::directory_iterator()), 0);
  }
  const std::string file = larger / "run.h5";
  const Outcome o = Fork1s("run --no-load-factor --time 1e4 --record " + file + " " + model);
  EXPECT_EQ(o.code, 3);
  EXPECT_NE(o.err.find("steps are safe"), std::string::npos) << o.err;
  const Outcome replay = Fork1s("replay --json " + file);
  EXPECT_EQ(replay.code, 0) << replay.err;
  EXPECT_TRUE(replay.Json()["identical"].get<bool>());
  EXPECT_GT(replay.Json()["steps"].get<int>(), 1000);
}

TEST(Outputs, FilesThatMayNotGrow) {
  const std::string model = Write("finger.xml", FingerModel()), file = At("limited.h5");
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit limit{1 << 20, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const Outcome o = Fork1s("run --no-load-factor --time 1e4 --record " + file + " " + model);
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(o.code, 3) << o.err;
  const Outcome replay = Fork1s("replay --json " + file);
  EXPECT_EQ(replay.code, 0) << replay.err;
  EXPECT_GT(replay.Json()["steps"].get<int>(), 100);
}

TEST(Outputs, PrintedResultsMustArrive) {
  const std::string model = Write("finger.xml", FingerModel()), file = At("closed.h5");
  const auto code = [](const std::string& arguments) {
    const int status =
        std::system((std::string(FORK1S_BINARY) + " " + arguments + " 2>" + At("stderr")).c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  };
  for (const char* command :
       {"inspect ", "inspect --json ", "reduce ", "run --time 0.1 ", "run --time 0.1 --json "}) {
    EXPECT_EQ(code(command + model + " >/dev/full"), 3) << command;
    EXPECT_NE(Slurp(At("stderr")).find("standard output"), std::string::npos);
    EXPECT_EQ(code(command + model + " >&-"), 3) << command;
  }
  EXPECT_EQ(code("--help >/dev/full"), 3);
  // A pipe that nobody reads any more.
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  close(ends[0]);
  EXPECT_NE(code("inspect " + model + " >&" + std::to_string(ends[1])), 0);
  close(ends[1]);
  // One that is full, and whose reader does not read on.
  ASSERT_EQ(pipe2(ends, O_NONBLOCK), 0);
  const std::string some(4096, 'x');
  while (write(ends[1], some.data(), some.size()) > 0) {
  }
  EXPECT_EQ(code("inspect " + model + " >&" + std::to_string(ends[1])), 3);
  EXPECT_EQ(code("run --time 0.1 --json " + model + " >&" + std::to_string(ends[1])), 3);
  close(ends[0]);
  close(ends[1]);
  // The recording does not take the place of the closed stream.
  EXPECT_EQ(code("run --time 0.1 --record " + file + " " + model + " >&-"), 3);
  EXPECT_EQ(Fork1s("replay " + file).code, 0);
}

// Notes and errors are results too.
TEST(Outputs, NotesAndErrorsMustArrive) {
  const std::string model = Write("finger.xml", FingerModel());
  const auto code = [](const std::string& arguments) {
    const int status = std::system((std::string(FORK1S_BINARY) + " " + arguments + " >/dev/null").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  };
  for (const std::string& command :
       {"inspect " + At("missing.xml"), "inspect " + Write("damaged.xml", "<mujoco>"), "reduce " + model,
        "run --time 0.1 " + model, "compare --time 0.1 " + model}) {
    EXPECT_EQ(code(command + " 2>/dev/full"), 3) << command;
    EXPECT_EQ(code(command + " 2>&-"), 3) << command;
  }
  EXPECT_EQ(code("--no-such-option 2>&-"), 2);
  EXPECT_EQ(code("inspect --json " + model + " 2>&-"), 0);  // it has nothing to say there
}

// Licenses go with every copy, into exported pages too.
TEST(Outputs, PagesCarryTheLicensesOfTheirPackages) {
  const std::string recording = At("licensed.h5"), page = At("licensed.html");
  ASSERT_EQ(Fork1s("run --time 0.1 --record " + recording + " " + Write("finger.xml", FingerModel())).code,
            0);
  if (Fork1s("export " + recording + " " + page).code == 3)
    GTEST_SKIP() << "this program was built without its page";
  const std::string text = Slurp(page);
  for (const char* package : {"\nthree\n", "\nlil-gui\n", "\nuplot\n"}) {
    const auto at = text.find(package);
    ASSERT_NE(at, std::string::npos) << package;
    EXPECT_NE(text.find("Permission is hereby granted", at), std::string::npos) << package;
  }
}

// The first control character that would reach a terminal as it is, as a number; -1: none.
int ControlIn(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if ((c < 0x20 && c != '\n' && c != '\t') || c == 0x7F) return c;
    if (c == 0xC2 && next >= 0x80 && next < 0xA0) return next;
  }
  return -1;
}

TEST(Outputs, ControlCharactersOfNamesAreEscaped) {
  const std::string model = Write("escapes.xml", R"(<mujoco model="m&#27;[31m"><worldbody>
<body name="b&#27;]0;title&#7;&#155;31m"><joint name="j&#27;[2J" type="hinge" axis="0 1 0" stiffness="1"/>
<geom name="g&#13;&#127;" type="sphere" size=".1" mass="1"/></body></worldbody>
<actuator><motor name="a&#27;[31m" joint="j&#27;[2J"/></actuator></mujoco>)");
  const std::string bad =
      Write("bad_escapes.xml", R"(<mujoco><worldbody><body name="b&#27;[31m"><joint type="&#27;[2J"/>
</body></worldbody></mujoco>)");
  const std::string robot = Write(
      "escapes.urdf",
      "<robot name=\"r\xC2\x9B"
      "31m\"><link name=\"base\"/><link name=\"l\xE2\x80\xAE"
      "abc\xC2\x9B\">"
      "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" "
      "iyz=\"0\"/></inertial></link>"
      "<joint name=\"j\xC2\x9B\" type=\"revolute\"><parent link=\"base\"/><child link=\"l\xE2\x80\xAE"
      "abc\xC2\x9B\"/>"
      "<axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint></robot>");
  const std::string recording = At("escapes.h5");
  int escaped = 0;
  for (const std::string& command :
       {"inspect " + model, "inspect --json " + model, "reduce " + model, "run --time 0.1 " + model,
        "run --time 0.1 --record " + recording + " " + model, "replay " + recording,
        "export " + recording + " " + At("escapes_tables"), "compare --time 0.1 " + model, "statics " + model,
        "inspect --interface none " + model, "inspect " + bad, "inspect --json " + bad, "inspect " + robot,
        "inspect --json " + robot, "reduce " + robot, "run --time 0.1 " + robot,
        std::string("inspect '/no/such/\033[31m'"), std::string("'\033[31m'")}) {
    const Outcome o = Fork1s(command);
    EXPECT_EQ(ControlIn(o.out), -1) << command << '\n' << o.out;
    EXPECT_EQ(ControlIn(o.err), -1) << command << '\n' << o.err;
    EXPECT_EQ((o.out + o.err).find("\xE2\x80\xAE"), std::string::npos) << command;
    escaped += (o.out + o.err).find("\\u001b") != std::string::npos ||
                       (o.out + o.err).find("\\u009b") != std::string::npos
                   ? 1
                   : 0;
  }
  EXPECT_GT(escaped, 12);
  EXPECT_EQ(Fork1s("inspect --json " + robot).Json()["name"],
            "r\xC2\x9B"
            "31m");
}

}  // namespace
}  // namespace fork1s::test
