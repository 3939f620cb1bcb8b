// The command line of fork1s.
#include <fmt/core.h>
#include <exception>

#include "command.hpp"

int main(int argc, char** argv) {
  using namespace fork1s::app;
  CLI::App app{
      "FORK-1S: compliant mechanisms reduced to the bodies that touch the world, simulated in contact"};
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
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kBadUsage;
  }
  try {
    return action();
  } catch (const std::exception& e) {
    fmt::print(stderr, "fork1s: {}\n", e.what());
    return kNumericsFailed;
  }
}
