#include "child_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "base/system_error.hpp"
#include "output.hpp"
#include "record/imported_scene_file.hpp"

namespace fork1s::app {
namespace {

constexpr int kResult = 3;         // descriptor of the child for what it read: HDF5, or an error as JSON
constexpr int kNotStarted = 127;   // exit code where the dynamic loader gave up
constexpr rlim_t kMaxFiles = 256;  // descriptors of the child: one file is open at a time

// A file in memory.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("model", MFD_CLOEXEC)) {}
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

std::string PathOf(int descriptor) { return fmt::format("/proc/self/fd/{}", descriptor); }

std::string Content(int descriptor) {
  std::string text;
  char buffer[4096];
  for (ssize_t got = 0;
       (got = pread(descriptor, buffer, sizeof buffer, static_cast<off_t>(text.size()))) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  return text;
}

// Half of the memory of the machine [bytes].
rlim_t MemoryShare() {
  return static_cast<rlim_t>(sysconf(_SC_PHYS_PAGES)) / 2 * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

Expected<pid_t> StartReader(const ModelArguments& model, int result) {
  std::vector<std::string> words{"fork1s", kReaderArgument};
  const std::vector<std::string> of_model = model.Words();
  words.insert(words.end(), of_model.begin(), of_model.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO,
                                   STDOUT_FILENO);  // results are the parent's to print
  posix_spawn_file_actions_adddup2(&actions, result, kResult);
  pid_t child = -1;
  const int failed = posix_spawn(&child, "/proc/self/exe", &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    return Fail(
        ErrorCode::kModel, model.path,
        "cannot be read: no process for its reader could be started " + CauseAndRemedy(failed, "try again"));
  return child;
}

// An error as the child writes it.
Json ErrorJson(const Error& error) {
  return {{"code", static_cast<int>(error.code)}, {"where", error.where}, {"message", error.message}};
}

Expected<ImportedScene> ReadResult(int result, const std::string& path) {
  char first = 0;
  if (pread(result, &first, 1, 0) == 1 && first == '{') {
    const Json said = Json::parse(Content(result));
    return Fail(said["code"].get<ErrorCode>(), said["where"].get<std::string>(),
                said["message"].get<std::string>());
  }
  auto imported = LoadImportedScene(PathOf(result));
  if (!imported)
    return Fail(imported.error().code, path, "what its reader found: " + imported.error().message);
  return imported;
}

// Why the child ended without a result.
std::string WhyNoResult(int status, bool late, double read_time) {
  if (WIFSIGNALED(status) && late)
    return fmt::format(
        "was not read within {:g} s; simplify it, replace pipes among its files, or allow more time (--read-time)",
        read_time);
  if (WIFSIGNALED(status))
    return fmt::format(
        "brought its reader down ({}); a mesh or file that it names, or memory that ran out, is the likely cause: "
        "write the files again or simplify the model",
        strsignal(WTERMSIG(status)));
  switch (WEXITSTATUS(status)) {
    case kRefused:
      return fmt::format(
          "takes more memory to be read than half of this machine's ({:.1f} GB) or than this shell allows (ulimit "
          "-v); simplify the model or raise the limit",
          1e-9 * static_cast<double>(MemoryShare()));
    case kNotStarted:
      return "cannot be read: its reader could not be started; descriptors, memory or processes are used up, "
             "raise their limits (ulimit -n, -v, -u)";
    default:
      return fmt::format("was not read: its reader ended with exit code {} and no result",
                         WEXITSTATUS(status));
  }
}

void SetLimit(int resource, rlim_t most) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return;
  limit.rlim_cur = std::min(limit.rlim_cur, most);
  setrlimit(resource, &limit);
}

// The share of memory comes on top of the addresses in use, of which sanitizers hold terabytes.
void LimitReader() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  SetLimit(RLIMIT_AS, pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + MemoryShare());
  SetLimit(RLIMIT_NOFILE, kMaxFiles);
  SetLimit(RLIMIT_CORE, 0);
}

// Writes the error in place of a result.
int HandOver(const Error& error) {
  const std::string text = ToText(ErrorJson(error));
  const bool whole = ftruncate(kResult, 0) == 0 &&
                     pwrite(kResult, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
  return whole ? kDone : kRefused;
}

int Read(const ModelArguments& model) {
  try {
    const auto imported = model.Read();
    if (!imported) return HandOver(imported.error());
    const auto saved = SaveImportedScene(*imported, PathOf(kResult));
    return saved ? kDone : HandOver({saved.error().code, model.path, saved.error().message});
  } catch (const std::bad_alloc&) {
    return kRefused;
  }
}

}  // namespace

Expected<ImportedScene> ReadInChild(const ModelArguments& model, const std::atomic<bool>& stop) {
  const MemoryFile result;
  if (result.descriptor() < 0)
    return Fail(ErrorCode::kFile, model.path,
                "cannot be read: its reader needs a file in memory " + CauseAndRemedy(errno, "try again"));
  const auto child = StartReader(model, result.descriptor());
  if (!child) return tl::unexpected(child.error());
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(model.read_time);
  int status = 0;
  bool late = false;
  while (waitpid(*child, &status, WNOHANG) == 0) {
    late = Clock::now() > end;
    if (stop || late) kill(*child, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (stop) return Fail(ErrorCode::kModel, model.path, "was not read to its end");
  if (WIFEXITED(status) && WEXITSTATUS(status) == kDone) return ReadResult(result.descriptor(), model.path);
  return Fail(ErrorCode::kModel, model.path, WhyNoResult(status, late, model.read_time));
}

int RunReader(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::signal(SIGINT, SIG_IGN);  // Ctrl-C goes to the whole group; the parent ends this one
  LimitReader();
  CLI::App app;
  ModelArguments model;
  model.AddTo(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError&) {
    return kBadUsage;
  }
  return Read(model);
}

}  // namespace fork1s::app
