// The live page of a simulation.
#include <nanobind/nanobind.h>
#include <nanobind/stl/shared_ptr.h>
#include "text.hpp"

#include <atomic>
#include <filesystem>
#include <fork1s/record/recording.hpp>
#include <memory>
#include <thread>

#include "arguments.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "page.hpp"
#include "runner.hpp"
#include "server/launch_file.hpp"
#include "server/live_loop.hpp"
#include "server/wire.hpp"

namespace fork1s::python {
namespace {

/// A copy of a simulation that goes on by itself, with a thread of its own, until it is closed.
class Page {
 public:
  Page(LiveSimulation live, LiveServer server)
      : parts_(std::make_unique<Parts>(std::move(live), std::move(server))) {}
  ~Page() { Close(); }
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  const std::string& address() const { return address_; }
  bool closed() const { return !parts_; }
  /// Address of a file that goes on to the page, to start a browser with; it goes with the page.
  std::string Launch() {
    if (!parts_) return address_;
    if (!parts_->launch)
      parts_->launch =
          ValueOrThrow(LaunchFile::Create(std::filesystem::temp_directory_path().string(), address_));
    return parts_->launch->address();
  }
  int NumViewers() const { return parts_ ? parts_->server.num_viewers() : 0; }
  void Close() {
    // Of a page that is the parent's a child has no thread that could be joined.
    if (generation_ != ForkGeneration()) static_cast<void>(parts_.release());
    parts_.reset();
  }

 private:
  struct Parts {
    Parts(LiveSimulation of, LiveServer shown_by) : live(std::move(of)), server(std::move(shown_by)) {}
    ~Parts() {
      stop = true;
      thread.join();
    }
    void Run() {
      const ForkSafeWork work;
      RunLive(live, server, [this] {
        ForkSafeWork::LetForkPass();
        return !stop;
      });
    }
    LiveSimulation live;
    LiveServer server;
    std::optional<LaunchFile> launch;
    std::atomic<bool> stop = false;
    std::thread thread{[this] { Run(); }};
  };
  std::unique_ptr<Parts> parts_;
  std::string address_ = parts_->server.address();
  int generation_ = ForkGeneration();
};

// The scene with the present state of the simulation to begin from.
std::unique_ptr<Page> Open(Runner& runner, const Whole& given_port) {
  const int port = given_port.Within("port", 0, 65535);
  if (app::ViewerPage().empty()) throw Refused{app::NoPage()};
  auto live = ValueOrThrow(runner.With([&](Simulation& s) {
    Scene scene = s.scene();
    SimulationOptions options = s.options();
    scene.keyframes.push_back(s.State());
    options.initial_keyframe = static_cast<int>(scene.keyframes.size()) - 1;
    return LiveSimulation::Create(std::move(scene), options, runner.model()->origin());
  }));
  ServerOptions options;
  options.port = static_cast<unsigned short>(port);
  options.page = app::ViewerPage();
  auto server = ValueOrThrow(LiveServer::Create(options));
  return std::make_unique<Page>(std::move(live), std::move(server));
}

}  // namespace

void BindShow(nb::module_& m) {
  m.def(
      "replay_page",
      [](const std::string& path) {
        if (app::ViewerPage().empty()) throw Refused{app::NoPage()};
        const ReleasedGil others_run;
        const Recording recording = ValueOrThrow(Recording::Open(path), path);
        return ReplayPage(app::ViewerPage(),
                          ValueOrThrow(EncodeRecording(recording, recording.scene().name), path));
      },
      nb::arg("path"));
  nb::class_<Page>(m, "LivePage", "What fork1s.Page holds.")
      .def_prop_ro("address", &Page::address)
      .def_prop_ro("closed", &Page::closed)
      .def_prop_ro("viewers", &Page::NumViewers)
      .def("launch", &Page::Launch)
      .def("close", &Page::Close);
  m.def(
      "show",
      [](const std::shared_ptr<Runner>& runner, const Whole& port) { return Open(*runner, port).release(); },
      nb::arg("simulation"), nb::arg("port"), nb::rv_policy::take_ownership);
}

}  // namespace fork1s::python
