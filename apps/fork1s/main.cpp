// The command line of fork1s.
#include <fcntl.h>
#include <unistd.h>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fork1s/record/recording.hpp>
#include <memory>
#include <new>
#include <sstream>
#include <system_error>

#include "base/system_error.hpp"
#include "command.hpp"
#include "command_line.hpp"
#include "model_arguments.hpp"
#include "print.hpp"
#include "record/child_reader.hpp"

namespace fork1s::app {
namespace {

// A standard stream that was closed would be given to the next file that is opened, and what is printed would
// stand in a recording. Opened the wrong way round, so that what is printed there is still noticed.
void HoldStandardStreams() {
  for (int stream : {0, 1, 2})
    if (fcntl(stream, F_GETFD) < 0 && open("/dev/null", stream == 0 ? O_WRONLY : O_RDONLY) != stream)
      _exit(kRefused);
}

// What was printed must have arrived, or whoever reads it takes half for the whole.
// Of notes and errors nothing can be said where standard error itself fails.
int CheckPrinted(int code) {
  errno = 0;
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    const int error = errno;
    PrintText(stderr,
              "fork1s: standard output: cannot be written{}{}; results are missing, send them elsewhere\n",
              error != 0 ? ": " : "", error != 0 ? std::strerror(error) : "");
    if (code == kDone) code = kRefused;
  }
  return std::ferror(stderr) != 0 && code == kDone ? kRefused : code;
}

constexpr const char* kOutOfMemory = "fork1s: out of memory; what was recorded up to here can be opened\n";

// Where not even what clears up after a failure gets memory: the JSON library's destructors ask for some.
[[noreturn]] void EndWithSentence() {
  try {
    if (const std::exception_ptr current = std::current_exception()) std::rethrow_exception(current);
  } catch (const std::bad_alloc&) {
    std::fputs(kOutOfMemory, stderr);
    _exit(kRefused);
  } catch (const std::exception& e) {
    PrintText(stderr, "fork1s: ended in the middle: {}\n", e.what());
  } catch (...) {
  }
  std::abort();
}

// What the command line asks for.
int Perform(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], kReaderArgument) == 0)
    return RunReader(argc - 1, argv + 1, ReadQuietly);
  CLI::App app{
      "FORK-1S: compliant mechanisms reduced to the bodies that touch the world, simulated in contact",
      "fork1s"};
  app.formatter(std::make_shared<HelpFormatter>());  // before the commands, which have the same
  app.require_subcommand(1);
  app.set_version_flag("--version", FORK1S_VERSION);
  app.footer("Exit codes: 0 done, 2 usage, 3 input refused, 4 numerics failed.");
  Action action;
  AddInspect(app, action);
  AddReduce(app, action);
  AddStatics(app, action);
  AddRun(app, action);
  AddCompare(app, action);
  AddReplay(app, action);
  AddExport(app, action);
  AddView(app, action);
  AddBench(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() != 0)
      if (const std::string unknown = UnknownWord(app, argc, argv); !unknown.empty()) {
        PrintText(stderr, "{}\nRun with --help for more information.\n", unknown);
        return kBadUsage;
      }
    std::ostringstream out, err;
    const bool done = app.exit(e, out, err) == 0;
    PrintText("{}", out.str());
    PrintText(stderr, "{}", err.str());
    return done ? kDone : kBadUsage;
  }
  return action();
}

int Guard(int argc, char** argv) {
  try {
    return Perform(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs(kOutOfMemory, stderr);
    return kRefused;
  } catch (const std::system_error& e) {  // a thread that cannot be started
    PrintText(stderr, "fork1s: the system refused {}\n", CauseAndRemedy(e.code().value(), "try again"));
    return kRefused;
  } catch (const std::exception& e) {
    PrintText(stderr, "fork1s: {}\n", e.what());
    return kNumericsFailed;
  }
}

}  // namespace
}  // namespace fork1s::app

int main(int argc, char** argv) {
  using namespace fork1s::app;
  HoldStandardStreams();
  std::set_terminate(EndWithSentence);
  fork1s::DisableHdf5Cleanup();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is told as a full disk is
  std::signal(SIGCHLD,
              SIG_DFL);  // whoever starts the program may ignore it, and then no child's end is known
  return CheckPrinted(Guard(argc, argv));
}
