#include "guarded_load.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <fork1s/base/system_error.hpp>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <memory>
#include <thread>

#include "output.hpp"

namespace fork1s::app {
namespace {

constexpr int kNotStarted = 127;  // exit code of the child where the program could not be run again

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using TemporaryFile = std::unique_ptr<std::FILE, FileCloser>;

std::string Content(std::FILE* file) {
  std::string text;
  std::rewind(file);
  for (char buffer[4096]; const std::size_t n = std::fread(buffer, 1, sizeof buffer, file);)
    text.append(buffer, n);
  return text;
}

// What a reader that ended by itself said on standard output (--json) and standard error.
Error ErrorOf(int code, const std::string& path, const std::string& out, const std::string& err) {
  const ErrorCode kind = code == kBadUsage         ? ErrorCode::kUsage
                         : code == kNumericsFailed ? ErrorCode::kNumerics
                                                   : ErrorCode::kModel;
  const Json said = Json::parse(out, nullptr, false);
  if (said.is_object() && said.contains("error"))
    return {kind, said["error"]["where"].get<std::string>(), said["error"]["message"].get<std::string>()};
  if (code == kNotStarted) return {kind, path, "cannot be read: no process for its reader could be started"};
  const std::string last = err.substr(err.find_last_of('\n', err.size() - 2) + 1);  // with its line's end
  return {kind, path, "could not be read: " + last.substr(0, last.find('\n'))};
}

}  // namespace

Expected<void> LoadApart(const ModelArguments& model, const std::vector<std::string>& options,
                         const std::atomic<bool>& stop) {
  ModelArguments told = model;
  told.json = true;
  std::vector<std::string> words{"fork1s", "view", "--only-load"};
  words.insert(words.end(), options.begin(), options.end());
  const std::vector<std::string> of_model = told.Words();
  words.insert(words.end(), of_model.begin(), of_model.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const TemporaryFile out(std::tmpfile()), err(std::tmpfile());
  if (!out || !err)
    return Fail(ErrorCode::kFile, model.path,
                "cannot be read: its reader needs a temporary file " +
                    CauseAndRemedy(errno, "make room in " P_tmpdir));

  const pid_t child = fork();
  if (child < 0)
    return Fail(
        ErrorCode::kModel, model.path,
        "cannot be read: no process for its reader could be started " + CauseAndRemedy(errno, "try again"));
  if (child == 0) {  // other threads may hold locks: nothing here may allocate
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGINT, SIG_IGN);  // Ctrl-C goes to the whole group; the parent ends this one
    dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
    dup2(fileno(out.get()), STDOUT_FILENO);
    dup2(fileno(err.get()), STDERR_FILENO);
    execv("/proc/self/exe", argv.data());
    _exit(kNotStarted);
  }
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  int status = 0;
  bool late = false;
  while (waitpid(child, &status, WNOHANG) == 0) {
    late = Clock::now() - start > std::chrono::minutes(2);
    if (stop || late) kill(child, SIGKILL);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (stop) return Fail(ErrorCode::kModel, model.path, "was not read to its end");
  if (WIFSIGNALED(status))
    return Fail(
        ErrorCode::kModel, model.path,
        late ? std::string("could not be read in two minutes; simplify it")
             : fmt::format("brought its reader down ({}); the meshes and files that it names are the likely "
                           "cause, write them again",
                           strsignal(WTERMSIG(status))));
  if (WEXITSTATUS(status) == kDone) return {};
  return tl::unexpected(ErrorOf(WEXITSTATUS(status), model.path, Content(out.get()), Content(err.get())));
}

}  // namespace fork1s::app
