#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fork1s/record/recording.hpp>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "checks.hpp"
#include "copy_writer.hpp"
#include "model_arguments.hpp"
#include "model_watch.hpp"
#include "output.hpp"
#include "page.hpp"
#include "print.hpp"
#include "run_inputs.hpp"
#include "server/launch_file.hpp"
#include "server/live_loop.hpp"

namespace fork1s::app {
namespace {

struct ViewArguments {
  std::optional<Integrator> integrator;  // as given
  ModelArguments model;
  int port = 8080;
  bool no_open = false, no_token = false, no_watch = false;
  double dt = 0, time = 0;
  std::string controls;  // path; empty: none
  Recovery recovery = Recovery::kExact;
};

std::atomic<bool> stop_requested{false};

// A step, a reduction or a file may take long, and nothing here is lost: after a second it ends in any case.
void RequestStop(int) {
  stop_requested = true;
  alarm(1);
}
void EndNow(int) { _exit(kDone); }

// Where there is a display; a browser that fails to start is no reason to stop. The file that it is started
// with stays as long as the result.
std::optional<LaunchFile> OpenBrowser(const std::string& page) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) return {};
  std::error_code none;
  auto launch = LaunchFile::Create(std::filesystem::temp_directory_path(none).string(), page);
  if (!launch) return {};
  const std::string address = launch->address();
  const pid_t child = fork();
  if (child > 0) waitpid(child, nullptr, 0);
  if (child != 0) return std::move(*launch);
  if (fork() != 0) _exit(0);  // nobody has to wait for the browser
  setsid();
  if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr)) _exit(127);
  execlp("xdg-open", "xdg-open", address.c_str(), static_cast<char*>(nullptr));
  _exit(127);
}

Expected<LiveSimulation> Prepare(const ViewArguments& args, const std::atomic<bool>& stop) {
  auto imported = args.model.Load(stop);
  if (!imported) return tl::unexpected(imported.error());
  InputArguments table;
  table.controls = args.controls;
  auto inputs = ReadInputs(table);
  if (!inputs) return tl::unexpected(inputs.error());
  if (!args.model.json) PrintNotes(imported->report);
  SimulationOptions options;
  options.dt = args.dt;
  options.recovery = args.recovery;
  options.step.integrator = args.integrator.value_or(Integrator::kTwoStage);
  options.step.controls_move = !args.controls.empty();  // as of run
  options.initial_keyframe = imported->initial_keyframe;
  // With its folder: many models are called scene.xml.
  const std::filesystem::path path(args.model.path);
  const std::string title = (path.parent_path().filename() / path.filename()).string();
  ModelFile file = FileOf(args.model, imported->report, stop_requested);
  auto live = LiveSimulation::Create(std::move(imported->scene), options, title, std::move(file));
  if (!live) {
    Error error = live.error();
    error.where = args.model.path + (error.where.empty() ? "" : ": " + error.where);
    return tl::unexpected(error);
  }
  if (args.controls.empty()) return live;
  if (auto ok = CheckInputs(*inputs, table, live->simulation()); !ok) return tl::unexpected(ok.error());
  constexpr double kWithoutEnd = std::numeric_limits<double>::infinity();  // s
  for (const std::string& sentence : InputLimits(*inputs, table, live->simulation(), kWithoutEnd))
    PrintText(stderr, "warning: {}\n", sentence);
  live->Play(std::move(inputs->controls), std::move(inputs->pushes.front()));
  return live;
}

// The model goes on as it was while its file cannot be used, and the pages say why.
void UseChangedFile(Expected<LiveSimulation> loaded, LiveSimulation& live) {
  if (loaded)
    live.Replace(std::move(*loaded));
  else
    live.SetFileProblem(loaded.error().Text());
}

// Until told to stop, or until `time` [s] has passed where it is above 0.
void Loop(LiveSimulation& live, LiveServer& server, ModelWatch* watch, double time) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  RunLive(live, server, [&] {
    if (watch)
      if (auto loaded = watch->Pop()) UseChangedFile(std::move(*loaded), live);
    return !stop_requested && !(time > 0 && Clock::now() - start > std::chrono::duration<double>(time));
  });
}

// Serves the page until `loop` returns.
int Serve(const ViewArguments& args, std::string_view page, const std::function<void(LiveServer&)>& loop) {
  ServerOptions options;
  options.port = static_cast<unsigned short>(args.port);
  options.page = page;
  options.require_token = !args.no_token;
  auto server = LiveServer::Create(options);
  if (!server) return Report(server.error(), args.model.json);

  const std::string address = server->address();
  if (args.model.json)
    PrintText("{}\n", ToText(Json{{"address", address}}));
  else
    PrintText("watch and touch it at {}   (Ctrl-C ends it)\n", address);
  std::fflush(stdout);
  std::signal(SIGINT, RequestStop);
  std::signal(SIGTERM, RequestStop);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGALRM, EndNow);
  std::optional<LaunchFile> launch;
  if (!args.no_open) launch = OpenBrowser(address);
  loop(*server);
  return kDone;
}

// A recording on the page that `export` writes.
int RunReplay(const ViewArguments& args) {
  ModelArguments plain;
  plain.path = args.model.path;
  plain.json = args.model.json;
  if (args.model.Words() != plain.Words() || args.dt > 0 || args.integrator || !args.controls.empty() ||
      args.recovery != Recovery::kExact)
    return Report(
        {ErrorCode::kUsage, args.model.path,
         "is a recording, which is shown as it was simulated; leave out the options of the model, of its "
         "steps and controls"},
        args.model.json);
  auto recording = Recording::Open(args.model.path);
  if (!recording) return Report(recording.error(), args.model.json);
  const auto page = MakeReplayPage(*recording);
  if (!page) return Report(page.error(), args.model.json);
  return Serve(args, *page, [&](LiveServer&) {
    const auto start = std::chrono::steady_clock::now();
    while (!stop_requested && !(args.time > 0 && std::chrono::steady_clock::now() - start >
                                                     std::chrono::duration<double>(args.time)))
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
  });
}

int Run(const ViewArguments& args) {
  const std::string_view page = ViewerPage();
  if (page.empty()) return Report(NoPage(), args.model.json);
  if (IsHdf5(args.model.path)) return RunReplay(args);
  const auto seen = StampOf(args.model.path);  // before it is read, so that no change is missed
  auto live = Prepare(args, stop_requested);
  if (!live) return Report(live.error(), args.model.json);
  return Serve(args, page, [&](LiveServer& server) {
    std::optional<ModelWatch> watch;
    if (!args.no_watch)
      watch.emplace(args.model.path, seen,
                    [&args](const std::atomic<bool>& stop) { return Prepare(args, stop); });
    Loop(*live, server, watch ? &*watch : nullptr, args.time);
  });
}

}  // namespace

void AddView(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand(
      "view", "watch and touch a model in the browser while it is simulated, or play a recording there");
  auto args = std::make_shared<ViewArguments>();
  args->model.AddTo(*command);
  command->add_option("--port", args->port, "port on 127.0.0.1 (default 8080; 0: any that is free)")
      ->check(CLI::Range(0, 65535));
  command->add_flag("--no-open", args->no_open, "only print the address, start no browser");
  command->add_flag("--no-token", args->no_token,
                    "serve the page without a token in its address, to every user of this machine");
  command->add_flag("--no-watch", args->no_watch, "do not load the model again when its file changes");
  command->add_option("--dt", args->dt, "time step in s (default: the file's)")
      ->transform(PositiveSecondsUpTo(kMostStep));
  command->add_option("--controls", args->controls,
                      "CSV of control values and pushes, as of run; a slider takes its control out of it");
  AddIntegratorTo(*command, args->integrator);
  AddRecoveryTo(*command, args->recovery);
  command->add_option("--time", args->time, "end after this many seconds (default: when told to)")
      ->transform(PositiveSecondsUpTo(kMostSeconds));
  command->callback([&action, args] { action = [args] { return Run(*args); }; });
}

}  // namespace fork1s::app
