// What a page sends to a live session, one message a line: read, carried out, and the session goes on.
#include <fork1s/importer/importer.hpp>

#include "fuzz.hpp"
#include "server/live_simulation.hpp"

namespace {

const fork1s::Scene& WatchedScene() {
  static const fork1s::Scene scene = [] {
    auto model = fork1s::LoadMechanismFromString(
        "<mujoco><worldbody><geom type=\"plane\" size=\"1 1 1\"/><body name=\"a\" pos=\"0 0 .3\"><joint "
        "name=\"j\" "
        "axis=\"0 1 0\" stiffness=\"10\" damping=\"1\"/><geom size=\".05\"/><body name=\"b\" pos=\".2 0 "
        "0\"><joint "
        "name=\"k\" axis=\"0 1 0\" stiffness=\"5\" damping=\"1\"/><geom size=\".05\"/></body></body><body "
        "name=\"ball\" "
        "pos=\".2 0 .05\"><freejoint/><geom size=\".05\"/></body></worldbody><actuator><position name=\"u\" "
        "joint=\"j\" "
        "kp=\"20\" ctrlrange=\"-1 1\"/></actuator></mujoco>",
        "watched.xml");
    if (!model) throw std::runtime_error(model.error().Text());
    return model->scene;
  }();
  return scene;
}

}  // namespace

FORK1S_FUZZ_TARGET(message, 400) {
  using namespace fork1s;
  std::optional<LiveSimulation> live;
  std::string_view rest = fuzz::Text(input);
  for (int messages = 0; !rest.empty() && messages < 8; ++messages) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    auto command = ParseCommand(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (!command) {
      fuzz::DemandNamed(command.error());
      continue;
    }
    if (!live) {
      auto created = LiveSimulation::Create(WatchedScene(), {}, "fuzz");
      fuzz::Demand(created.has_value(), "the watched scene opens");
      live = std::move(*created);
    }
    command->viewer = 1;
    if (const auto refusal = live->Handle(*command))
      fuzz::Demand(!refusal->sentence.empty(), "a refusal says why");
    live->Advance(0.002);
    live->Capture(1);
    for (std::size_t b = 0; b < live->simulation().bodies().size(); ++b)
      fuzz::Demand(live->simulation().Pose(static_cast<int>(b)).translation().allFinite(),
                   "poses stay finite");
  }
}
