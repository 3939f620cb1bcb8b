#include <fork1s/server/live_loop.hpp>

#include <chrono>
#include <thread>

namespace fork1s {

void RunLive(LiveSimulation& live, LiveServer& server, const std::function<bool()>& go_on) {
  using Clock = std::chrono::steady_clock;
  const auto frame = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / 60));
  auto next = Clock::now();
  while (go_on()) {
    for (const Command& command : server.TakeCommands()) {
      const auto refusal = live.Handle(command);
      if (!refusal) continue;
      if (refusal->passing)
        server.Tell(command.viewer, refusal->sentence);
      else
        server.TellProblem(command.viewer, "request", refusal->sentence);
    }
    live.Advance(0.9 / 60);
    for (const LiveFault& fault : live.TakeFaults()) server.TellProblem(0, fault.about, fault.sentence);
    server.Publish(live.Capture(server.num_viewers()));
    next += frame;
    const auto now = Clock::now();
    if (next < now) next = now;  // behind: go on from here rather than hurry
    std::this_thread::sleep_until(next);
  }
}

}  // namespace fork1s
