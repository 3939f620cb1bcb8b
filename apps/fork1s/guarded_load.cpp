#include "guarded_load.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <thread>
#include <vector>

namespace fork1s::app {
namespace {

std::vector<std::string> OwnArguments() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> arguments;
  for (std::string argument; std::getline(file, argument, '\0');) arguments.push_back(argument);
  return arguments;
}

}  // namespace

Expected<void> LoadApart(const std::string& path, const std::atomic<bool>& stop) {
  std::vector<std::string> arguments = OwnArguments();
  if (arguments.empty()) return {};  // a system without /proc: unguarded
  arguments.push_back("--only-load");
  std::vector<char*> argv;
  for (std::string& a : arguments) argv.push_back(a.data());
  argv.push_back(nullptr);

  const pid_t child = fork();
  if (child < 0) return {};
  if (child == 0) {  // other threads may hold locks: nothing here may allocate
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGINT, SIG_IGN);  // Ctrl-C goes to the whole group; the parent ends this one
    const int nowhere = open("/dev/null", O_RDWR);
    for (int stream : {0, 1, 2}) dup2(nowhere, stream);
    execv("/proc/self/exe", argv.data());
    _exit(0);
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
  if (stop) return Fail(ErrorCode::kModel, path, "was not read to its end");
  if (!WIFSIGNALED(status)) return {};
  return Fail(
      ErrorCode::kModel, path,
      late ? std::string("could not be read in two minutes; simplify it")
           : fmt::format("brought its reader down ({}); the meshes and files that it names are the likely "
                         "cause, write them again",
                         strsignal(WTERMSIG(status))));
}

}  // namespace fork1s::app
