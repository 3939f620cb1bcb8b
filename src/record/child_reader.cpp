#include "record/child_reader.hpp"

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
#include <optional>
#include <string>
#include <thread>

#include "base/system_error.hpp"
#include "json_archive.hpp"
#include "record/imported_scene_file.hpp"
#include "record/scene_json.hpp"

namespace fork1s {
namespace {

using internal::JsonReader;
using internal::JsonWriter;

// Descriptor of the child: holds the options as JSON, then what it read as HDF5, or an error as JSON.
constexpr int kExchange = 3;
constexpr int kDone = 0, kNoMemory = 3;  // exit codes of the child
constexpr int kNotStarted = 127;         // exit code where the dynamic loader gave up
constexpr rlim_t kMaxFiles = 256;        // descriptors of the child: one file is open at a time

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

std::string ReadAll(int descriptor) {
  std::string text;
  char buffer[4096];
  for (ssize_t got = 0;
       (got = pread(descriptor, buffer, sizeof buffer, static_cast<off_t>(text.size()))) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  return text;
}

bool WriteAll(int descriptor, const std::string& text) {
  return ftruncate(descriptor, 0) == 0 &&
         pwrite(descriptor, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
}

// Half of the memory of the machine [bytes].
rlim_t MemoryShare() {
  return static_cast<rlim_t>(sysconf(_SC_PHYS_PAGES)) / 2 * static_cast<rlim_t>(sysconf(_SC_PAGESIZE));
}

Expected<pid_t> StartReader(const std::string& program, std::string path, int exchange) {
  std::string name = "fork1s", argument = kReaderArgument;
  char* argv[] = {name.data(), argument.data(), path.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, exchange, kExchange);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  // Results are the parent's to print.
  if (fcntl(STDERR_FILENO, F_GETFD) >= 0)
    posix_spawn_file_actions_adddup2(&actions, STDERR_FILENO, STDOUT_FILENO);
  pid_t child = -1;
  const int failed = posix_spawn(&child, program.c_str(), &actions, nullptr, argv, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    return Fail(ErrorCode::kModel, path,
                fmt::format("cannot be read: no process for its reader ({}) could be started {}", program,
                            CauseAndRemedy(failed, "install fork1s again")));
  return child;
}

// An error as the child writes it.
std::string WriteError(const Error& error) {
  ModelText none;
  JsonWriter writer(none);
  return internal::Json{{"code", static_cast<int>(error.code)},
                        {"where", writer.Encode(error.where)},
                        {"message", writer.Encode(error.message)}}
      .dump();
}

Error ReadError(const std::string& text) {
  const ModelText none;
  const internal::Json json = internal::Json::parse(text);
  JsonReader reader(json, none);
  int code = 0;
  Error error;
  reader("code", code), reader("where", error.where), reader("message", error.message);
  error.code = static_cast<ErrorCode>(code);
  return error;
}

Expected<ImportedScene> ReadResult(int exchange, const std::string& path) {
  char first = 0;
  if (pread(exchange, &first, 1, 0) == 1 && first == '{') return tl::unexpected(ReadError(ReadAll(exchange)));
  auto imported = LoadImportedScene(PathOf(exchange));
  if (!imported)
    return Fail(imported.error().code, path, "what its reader found: " + imported.error().message);
  return imported;
}

// Why the child ended without a result; `status` of waitpid, where it is known.
std::string WhyNoResult(std::optional<int> status, bool late, const ChildReader& reader) {
  if (late)
    return fmt::format(
        "was not read within {:g} s; simplify it, replace pipes among its files, or allow more time ({})",
        reader.max_time, reader.time_option);
  if (!status || WIFSIGNALED(*status))
    return fmt::format(
        "brought its reader down ({}); a mesh or file that it names, or memory that ran out, is the likely cause: "
        "write the files again or simplify the model",
        status ? strsignal(WTERMSIG(*status)) : "the caller ignores SIGCHLD and so its signal");
  switch (WEXITSTATUS(*status)) {
    case kNoMemory:
      return fmt::format(
          "takes more memory to be read than half of this machine's ({:.1f} GB) or than this shell allows (ulimit "
          "-v); simplify the model or raise the limit",
          1e-9 * static_cast<double>(MemoryShare()));
    case kNotStarted:
      return "cannot be read: its reader could not be started; descriptors, memory or processes are used up, "
             "raise their limits (ulimit -n, -v, -u)";
    default:
      return fmt::format(
          "was not read: its reader ended with exit code {} and no result; memory that ran out is the likely cause: "
          "raise its limit (ulimit -v) or simplify the model",
          WEXITSTATUS(*status));
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

using Reader = std::function<Expected<ImportedScene>(const std::string&, const ImportOptions&)>;

// Takes the options and leaves nothing in their place until there is a result.
Expected<ImportOptions> ReadOptions(const std::string& path) {
  const std::string text = ReadAll(kExchange);
  if (!WriteAll(kExchange, "")) return Fail(ErrorCode::kFile, path, "no options came with it");
  return ReadImportOptions(text, path);
}

Expected<void> ReadAndStore(const std::string& path, const Reader& read) {
  const auto options = ReadOptions(path);
  if (!options) return tl::unexpected(options.error());
  const auto imported = read(path, *options);
  if (!imported) return tl::unexpected(imported.error());
  const auto saved = SaveImportedScene(*imported, PathOf(kExchange));
  if (!saved) return Fail(saved.error().code, path, saved.error().message);
  return {};
}

}  // namespace

Expected<ImportedScene> ReadInChild(const ChildReader& reader, const std::string& path,
                                    const ImportOptions& options, const std::function<bool()>& stop) {
  const MemoryFile exchange;
  if (exchange.descriptor() < 0 || !WriteAll(exchange.descriptor(), WriteImportOptions(options)))
    return Fail(ErrorCode::kFile, path,
                "cannot be read: its reader needs a file in memory " + CauseAndRemedy(errno, "try again"));
  const auto child = StartReader(reader.program, path, exchange.descriptor());
  if (!child) return tl::unexpected(child.error());
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(reader.max_time);
  int status = 0;
  pid_t ended = 0;
  bool late = false, stopped = false;
  while ((ended = waitpid(*child, &status, WNOHANG)) == 0) {
    late = Clock::now() > end;
    stopped = stopped || stop();
    if (stopped || late) kill(*child, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (stopped) return Fail(ErrorCode::kModel, path, "was not read to its end");
  // A caller that ignores SIGCHLD, or waits for every child, leaves no status: the file has the answer.
  const bool is_known = ended == *child;
  const bool is_done =
      is_known ? WIFEXITED(status) && WEXITSTATUS(status) == kDone : !ReadAll(exchange.descriptor()).empty();
  if (is_done) return ReadResult(exchange.descriptor(), path);
  return Fail(ErrorCode::kModel, path,
              WhyNoResult(is_known ? std::optional(status) : std::nullopt, late, reader));
}

int RunReader(int argc, char** argv, const Reader& read) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::signal(SIGINT, SIG_IGN);  // Ctrl-C goes to the whole group; the parent ends this one
  LimitReader();
  try {
    const auto stored = ReadAndStore(argc > 1 ? argv[1] : "", read);
    return stored || WriteAll(kExchange, WriteError(stored.error())) ? kDone : kNoMemory;
  } catch (const std::bad_alloc&) {
    return kNoMemory;
  }
}

}  // namespace fork1s
