#include "video.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>
#include <vector>

#include "base/system_error.hpp"
#include "base/temporary_folder.hpp"
#include "progress.hpp"
#include "record/output_file.hpp"
#include "server/launch_file.hpp"
#include "server/live_server.hpp"

namespace fork1s::app {
namespace {

namespace fs = std::filesystem;

std::string FindProgram(std::initializer_list<const char*> names) {
  const char* path = std::getenv("PATH");
  for (const char* name : names) {
    std::stringstream folders(path ? path : "");
    std::string folder;
    while (std::getline(folders, folder, ':'))
      if (const std::string file = folder + "/" + name; access(file.c_str(), X_OK) == 0) return file;
  }
  return {};
}

std::atomic<bool> interrupted{false};
void Interrupt(int) { interrupted = true; }

// Ctrl-C and the like, while a film is made: the browser and its folder must not stay behind.
class CatchSignals {
 public:
  CatchSignals() {
    for (std::size_t i = 0; i < kSignals.size(); ++i) before_[i] = std::signal(kSignals[i], Interrupt);
  }
  ~CatchSignals() {
    for (std::size_t i = 0; i < kSignals.size(); ++i) std::signal(kSignals[i], before_[i]);
  }
  CatchSignals(const CatchSignals&) = delete;
  CatchSignals& operator=(const CatchSignals&) = delete;

 private:
  static constexpr std::array kSignals = {SIGINT, SIGTERM, SIGHUP};
  std::array<void (*)(int), kSignals.size()> before_{};
};

tl::unexpected<Error> Interrupted(const std::string& out) {
  return Fail(ErrorCode::kFile, out, "was not written: the film was interrupted");
}

// The two pipes of --remote-debugging-pipe: commands for the browser's descriptor 3, answers from its
// descriptor
// 4. Without them it would listen on a TCP port, by which every user of the machine could make it read files.
// No command is sent; the browser ends when its commands do.
class ControlPipes {
 public:
  ControlPipes() : made_(pipe2(commands_.data(), O_CLOEXEC) == 0 && pipe2(answers_.data(), O_CLOEXEC) == 0) {}
  ~ControlPipes() {
    for (const int fd : {commands_[0], commands_[1], answers_[0], answers_[1]})
      if (fd >= 0) close(fd);
  }
  ControlPipes(const ControlPipes&) = delete;
  ControlPipes& operator=(const ControlPipes&) = delete;

  bool made() const { return made_; }
  /// In the child. Copies first: the pipes may be on 3 and 4 themselves.
  void PutInPlace() const {
    const int commands = fcntl(commands_[0], F_DUPFD, 5), answers = fcntl(answers_[1], F_DUPFD, 5);
    dup2(commands, 3);
    dup2(answers, 4);
  }

 private:
  std::array<int, 2> commands_{-1, -1}, answers_{-1, -1};
  bool made_;
};

// A program without input, whose output goes nowhere, and whose temporary files go into `temporary`: a
// browser that is killed removes none of its own. Of the descriptors that are open here it gets the pipes
// alone.
class Child {
 public:
  Child(std::vector<std::string> arguments, const std::string& temporary,
        const ControlPipes* pipes = nullptr) {
    std::vector<char*> argv;
    for (std::string& a : arguments) argv.push_back(a.data());
    argv.push_back(nullptr);
    prctl(PR_SET_CHILD_SUBREAPER, 1);  // helpers that outlive the child are waited for, here
    pid_ = fork();
    group_ = pid_;
    if (pid_ < 0) error_ = errno;
    if (pid_ > 0) setpgid(pid_, pid_);  // on both sides: whichever comes first
    if (pid_ != 0) return;
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // should this program be killed
    setenv("TMPDIR", temporary.c_str(), 1);
    const int nowhere = open("/dev/null", O_RDWR);
    for (int fd : {0, 1, 2}) dup2(nowhere, fd);
    if (pipes) pipes->PutInPlace();
    close_range(pipes ? 5 : 3, ~0U, 0);
    execv(argv[0], argv.data());
    _exit(127);
  }
  ~Child() {
    if (group_ <= 0 || waitpid(-group_, nullptr, WNOHANG) < 0) return;  // none is left
    kill(-group_, SIGKILL);  // with the helpers that it started, which may write until they are gone
    while (waitpid(-group_, nullptr, 0) > 0) continue;
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Why it could not be started, an errno value; 0: it was.
  int error() const { return error_; }
  /// Exit code once it has ended, else -1.
  int Ended() {
    int status = 0;
    if (pid_ <= 0 || waitpid(pid_, &status, WNOHANG) != pid_) return -1;
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
  }

 private:
  pid_t pid_, group_;
  int error_ = 0;
};

// What the page is asked to draw, behind the # of its address.
std::string Wish(const VideoOptions& o) {
  std::string wish = fmt::format("film={}x{}", o.width, o.height);
  if (o.at) wish += fmt::format("&at={:.6f}", *o.at);
  if (o.fps) wish += fmt::format("&fps={:.6f}", *o.fps);
  if (o.azimuth) wish += fmt::format("&azimuth={:.3f}", *o.azimuth);
  if (o.elevation) wish += fmt::format("&elevation={:.3f}", *o.elevation);
  if (o.zoom != 1) wish += fmt::format("&zoom={:.4f}", o.zoom);
  if (!o.forces) wish += "&forces=0";
  if (o.colouring != 0) wish += fmt::format("&colouring={}", o.colouring);
  if (o.body) wish += fmt::format("&body={}", *o.body);
  return wish;
}

// Frames come as PUT /frame/000001.png, then PUT /done.
struct Frames {
  std::string folder;
  std::atomic<int> count{0}, total{0};
  std::atomic<bool> done{false}, failed{false};

  bool Store(const std::string& path, const std::string& body) {
    if (path == "/done") return done = true;
    if (path == "/total") return total = std::atoi(body.substr(0, 9).c_str()), true;
    int number = 0;
    if (std::sscanf(path.c_str(), "/frame/%6d.png", &number) != 1 || number < 0) return false;
    std::ofstream file(fmt::format("{}/{:06}.png", folder, number), std::ios::binary | std::ios::trunc);
    file.write(body.data(), static_cast<std::streamsize>(body.size()));
    file.close();
    if (!file) failed = true;
    ++count;
    return !failed;
  }
};

Expected<void> Draw(std::string_view page, const std::string& chromium, const std::string& folder,
                    const VideoOptions& options, Frames& frames) {
  ServerOptions serve;
  serve.port = 0;
  serve.page = page;
  serve.take_file = [&frames](const std::string& path, const std::string& body) {
    return frames.Store(path, body);
  };
  auto server = LiveServer::Create(serve);
  if (!server) return tl::unexpected(server.error());
  const ControlPipes pipes;
  if (!pipes.made())
    return Fail(
        ErrorCode::kFile, chromium,
        "cannot be started: no pipe to it could be made " + CauseAndRemedy(errno, "close other programs"));
  const std::string profile = folder + "/profile";
  if (mkdir(profile.c_str(), 0700) != 0)
    return Fail(ErrorCode::kFile, profile, "cannot be made " + CauseAndRemedy(errno, "the browser needs it"));
  const auto launch = LaunchFile::Create(folder, fmt::format("{}#{}", server->address(), Wish(options)));
  if (!launch) return tl::unexpected(launch.error());
  Child browser(
      {chromium, "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
       "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
       "--disable-sync", "--hide-scrollbars", "--remote-debugging-pipe", "--user-data-dir=" + profile,
       fmt::format("--window-size={},{}", options.width, options.height), launch->address()},
      folder, &pipes);
  if (browser.error() != 0)
    return Fail(ErrorCode::kFile, chromium,
                "cannot be started " + CauseAndRemedy(browser.error(), "try again"));
  ProgressBar bar("drawing");
  constexpr auto kPatience = std::chrono::seconds(60);
  auto last = std::chrono::steady_clock::now();
  for (int seen = 0; !frames.done;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (interrupted) return Interrupted(frames.folder);
    if (frames.failed)
      return Fail(ErrorCode::kFile, frames.folder,
                  "cannot be written; check its permissions and the disk's room");
    if (const int code = browser.Ended(); code >= 0 && !frames.done)
      return Fail(ErrorCode::kFile, chromium,
                  fmt::format("ended with code {} before the film was drawn", code));
    const auto now = std::chrono::steady_clock::now();
    if (frames.count > seen) {
      seen = frames.count;
      last = now;
    }
    bar.Update(frames.total > 0 ? static_cast<double>(seen) / frames.total : 0);
    if (now - last > kPatience)
      return Fail(ErrorCode::kFile, chromium,
                  "drew no frame for a minute; try a smaller --width and --height");
  }
  return {};
}

}  // namespace

Expected<int> RenderVideo(std::string_view page, const std::string& out, const VideoOptions& options) {
  std::signal(SIGPIPE, SIG_IGN);
  const CatchSignals catching;
  const bool film = fs::path(out).extension() == ".mp4";
  const std::string chromium = FindProgram({"chromium", "chromium-browser", "google-chrome"});
  if (chromium.empty())
    return Fail(ErrorCode::kFile, "chromium",
                "was not found; frames are drawn by it: apt-get install chromium");
  const std::string ffmpeg = film ? FindProgram({"ffmpeg"}) : std::string();
  if (film && ffmpeg.empty())
    return Fail(
        ErrorCode::kFile, "ffmpeg",
        "was not found; films are made by it: apt-get install ffmpeg, or name a folder for PNG frames");
  const TemporaryFolder work("fork1s-film");
  if (work.path.empty())
    return Fail(ErrorCode::kFile, fs::temp_directory_path(), "cannot hold a temporary folder");
  Frames frames;
  const bool picture = fs::path(out).extension() == ".png";
  frames.folder = film || picture ? work.path + "/frames" : out;
  std::error_code failed;
  fs::create_directories(frames.folder, failed);
  if (failed) return Fail(ErrorCode::kFile, frames.folder, "cannot be made (" + failed.message() + ")");
  if (auto drawn = Draw(page, chromium, work.path, options, frames); !drawn)
    return tl::unexpected(drawn.error());
  if (picture) {
    std::ifstream drawn(frames.folder + "/000000.png", std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(drawn)), std::istreambuf_iterator<char>());
    if (auto written = WriteFile(out, {"a PNG picture", "\211PNG"}, bytes); !written)
      return tl::unexpected(written.error());
  }
  if (!film) return frames.count.load();

  // The first bytes of an MP4 file are the length of what begins with "ftyp".
  auto output = OutputFile::Create(out, {"an MP4 film", std::string_view("\0\0\0", 3)});
  if (!output) return tl::unexpected(output.error());
  Child encoder(
      {ffmpeg, "-y", "-loglevel", "error", "-framerate", fmt::format("{:.6f}", options.fps.value_or(60)),
       "-i", frames.folder + "/%06d.png", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p",
       "-movflags", "+faststart", output->part()},
      work.path);
  if (encoder.error() != 0)
    return Fail(ErrorCode::kFile, ffmpeg,
                "cannot be started " + CauseAndRemedy(encoder.error(), "try again"));
  int code = -1;
  ProgressBar bar("encoding");
  while ((code = encoder.Ended()) < 0) {
    bar.Update(0);
    if (interrupted) return Interrupted(out);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  if (code != 0)
    return Fail(ErrorCode::kFile, out,
                fmt::format("was not written: ffmpeg ended with code {}; check the folder", code));
  if (auto kept = output->Commit(); !kept) return tl::unexpected(kept.error());
  return frames.count.load();
}

}  // namespace fork1s::app
