#include "server/live_loop.hpp"

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "server/request_ration.hpp"

namespace fork1s {
namespace {

void Answer(const std::optional<Refusal>& refusal, const Command& command, LiveServer& server) {
  if (!refusal) return;
  if (refusal->passing)
    server.Notify(command.viewer, refusal->sentence);
  else
    server.SendProblem(command.viewer, "request", refusal->sentence);
}

}  // namespace

void RunLive(LiveSimulation& live, LiveServer& server, const std::function<bool()>& go_on) {
  using Clock = std::chrono::steady_clock;
  const auto frame = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / 60));
  auto next = Clock::now(), before = next;
  RequestRation ration(0.5, 1.0 / 60);
  while (go_on()) {
    const auto begun = Clock::now();
    ration.Pass(std::chrono::duration<double>(begun - std::exchange(before, begun)).count());
    while (ration.Allows()) {
      const auto command = server.PopCommand();
      if (!command) break;
      const auto asked = Clock::now();
      Answer(live.Handle(*command), *command, server);
      ration.Spend(std::chrono::duration<double>(Clock::now() - asked).count());
    }
    live.Advance(0.9 / 60);
    for (const LiveFault& fault : live.PopFaults()) server.SendProblem(0, fault.about, fault.sentence);
    for (const LiveReply& reply : live.PopReplies()) server.Send(reply.viewer, reply.message);
    server.Publish(live.Capture(server.num_viewers()));
    next += frame;
    const auto now = Clock::now();
    if (next < now) next = now;  // behind: go on from here rather than hurry
    std::this_thread::sleep_until(next);
  }
}

}  // namespace fork1s
