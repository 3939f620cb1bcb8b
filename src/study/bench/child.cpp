#include "child.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <thread>

#include <fmt/format.h>

namespace fork1s::internal {

MemoryFile::MemoryFile() : descriptor_(memfd_create("fork1s", MFD_CLOEXEC)) {}
MemoryFile::~MemoryFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

std::string MemoryFile::Path() const { return fmt::format("/proc/{}/fd/{}", getpid(), descriptor_); }

std::string MemoryFile::Read() const {
  std::string out;
  char part[65536];
  for (off_t at = 0;;) {
    const ssize_t got = pread(descriptor_, part, sizeof part, at);
    if (got <= 0) return out;
    out.append(part, static_cast<std::size_t>(got));
    at += got;
  }
}

std::string FindOnPath(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::stringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (const std::string file = folder + "/" + name; access(file.c_str(), X_OK) == 0) return file;
  return {};
}

ChildEnd RunChild(const std::vector<std::string>& command, double seconds) {
  ChildEnd end;
  const MemoryFile out, error;
  std::vector<std::string> copies = command;
  std::vector<char*> argv;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) {
    end.how = "could not be started";
    return end;
  }
  if (child == 0) {  // other threads may hold locks: nothing here may allocate
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
    dup2(out.descriptor(), STDOUT_FILENO);
    dup2(error.descriptor(), STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  bool late = false;
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (!late && std::chrono::duration<double>(Clock::now() - start).count() > seconds) {
      late = true;
      kill(child, SIGKILL);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  end.done = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (late)
    end.how = fmt::format("took longer than {:.0f} s", seconds);
  else if (WIFSIGNALED(status))
    end.how = fmt::format("crashed ({})", strsignal(WTERMSIG(status)));
  else if (!end.done)
    end.how = fmt::format("ended with exit code {}", WEXITSTATUS(status));
  end.out = out.Read();
  end.error = error.Read();
  return end;
}

}  // namespace fork1s::internal
