#include <fmt/format.h>
#include <unistd.h>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fork1s/server/live_server.hpp>
#include <fork1s/server/live_simulation.hpp>
#include <memory>
#include <thread>

#include "model_arguments.hpp"
#include "output.hpp"
#include "page.hpp"

namespace fork1s::app {
namespace {

struct Arguments {
  ModelArguments model;
  int port = 8080;
  bool no_open = false;
  double dt = 0, time = 0;
  std::string recovery = "exact";
};

std::atomic<bool> stop_requested{false};

void RequestStop(int) { stop_requested = true; }

// Where there is a display; a browser that fails to start is no reason to stop.
void OpenBrowser(const std::string& address) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) return;
  const pid_t child = fork();
  if (child != 0) return;
  setsid();
  if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr)) _exit(127);
  execlp("xdg-open", "xdg-open", address.c_str(), static_cast<char*>(nullptr));
  _exit(127);
}

Expected<LiveSimulation> Prepare(const Arguments& args) {
  auto imported = args.model.Load();
  if (!imported) return tl::unexpected(imported.error());
  if (!args.model.json) PrintNotes(imported->report);
  SimulationOptions options;
  options.dt = args.dt;
  options.recovery = args.recovery == "twist" ? Recovery::kTwist : Recovery::kExact;
  options.initial_keyframe = imported->initial_keyframe;
  // With its folder: many models are called scene.xml.
  const std::filesystem::path path(args.model.path);
  const std::string title = (path.parent_path().filename() / path.filename()).string();
  auto live = LiveSimulation::Create(std::move(imported->scene), options, title);
  if (!live) {
    Error error = live.error();
    error.where = args.model.path + (error.where.empty() ? "" : ": " + error.where);
    return tl::unexpected(error);
  }
  return live;
}

// Sixty frames a second: commands, steps, one snapshot. The server thread does the rest.
void Loop(LiveSimulation& live, LiveServer& server, double time) {
  using Clock = std::chrono::steady_clock;
  const auto frame = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / 60));
  const auto start = Clock::now();
  auto next = start;
  while (!stop_requested) {
    for (const Command& command : server.TakeCommands())
      if (auto refusal = live.Handle(command)) server.Tell(command.viewer, *refusal);
    live.Advance(0.9 / 60);
    if (auto fault = live.TakeFault()) server.Tell(0, *fault);
    server.Publish(live.Capture(server.num_viewers()));
    if (time > 0 && Clock::now() - start > std::chrono::duration<double>(time)) break;
    next += frame;
    const auto now = Clock::now();
    if (next < now) next = now;  // behind: go on from here rather than hurry
    std::this_thread::sleep_until(next);
  }
}

int Run(const Arguments& args) {
  const std::string_view page = ViewerPage();
  if (page.empty())
    return Report(
        {ErrorCode::kFile, "view",
         "this program was built without its page, because npm was not found; install nodejs and npm, run "
         "cmake again and build"},
        args.model.json);
  auto live = Prepare(args);
  if (!live) return Report(live.error(), args.model.json);
  ServerOptions options;
  options.port = static_cast<unsigned short>(args.port);
  options.page = page;
  auto server = LiveServer::Create(options);
  if (!server) return Report(server.error(), args.model.json);

  const std::string address = fmt::format("http://127.0.0.1:{}/", server->port());
  if (args.model.json)
    fmt::print("{}\n", Json{{"address", address}}.dump());
  else
    fmt::print("watch and touch it at {}   (Ctrl-C ends it)\n", address);
  std::fflush(stdout);
  std::signal(SIGINT, RequestStop);
  std::signal(SIGTERM, RequestStop);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGCHLD, SIG_IGN);
  if (!args.no_open) OpenBrowser(address);
  Loop(*live, *server, args.time);
  return kDone;
}

}  // namespace

void AddView(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("view", "watch and touch a model in the browser while it is simulated");
  auto args = std::make_shared<Arguments>();
  args->model.AddTo(*command);
  command->add_option("--port", args->port, "port on 127.0.0.1 (default 8080; 0: any that is free)")
      ->check(CLI::Range(0, 65535));
  command->add_flag("--no-open", args->no_open, "only print the address, start no browser");
  command->add_option("--dt", args->dt, "time step in s (default: the file's)")->check(CLI::PositiveNumber);
  command->add_option("--recovery", args->recovery, "exact or twist")
      ->check(CLI::IsMember({"exact", "twist"}));
  command->add_option("--time", args->time, "end after this many seconds (default: when told to)")
      ->check(CLI::PositiveNumber);
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
