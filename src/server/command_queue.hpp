// Commands that wait for the simulation: of those that undo each other only the last.
#pragma once

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>

#include "server/command.hpp"

namespace fork1s::internal {

class CommandQueue {
 public:
  explicit CommandQueue(std::size_t most) : most_(most) {}

  /// False where it is full: the command is not taken.
  bool Push(Command command) {
    if (command.kind == Command::Kind::kPull) {
      if (Command* last = LastPull(command.viewer)) return *last = std::move(command), true;
    } else {
      // Whichever viewer asked before: a setting has one value, and two that alternate would else fill every
      // frame.
      std::erase_if(waiting_, [&](const Command& c) { return IsReplacedBy(c, command); });
    }
    if (waiting_.size() >= most_) return false;
    waiting_.push_back(std::move(command));
    return true;
  }
  /// Beyond the bound: for what must not be lost.
  void PushAlways(Command command) { waiting_.push_back(std::move(command)); }

  std::optional<Command> Pop() {
    if (waiting_.empty()) return {};
    Command first = std::move(waiting_.front());
    waiting_.pop_front();
    return first;
  }

 private:
  static bool IsReplacedBy(const Command& before, const Command& now) {
    if (before.kind != now.kind) return false;
    if (now.kind == Command::Kind::kSet) return before.setting == now.setting && before.index == now.index;
    if (now.kind == Command::Kind::kInterfaces) return before.index == now.index;
    if (now.kind == Command::Kind::kShape) return before.body == now.body;
    return now.kind == Command::Kind::kReset;
  }

  // That a further pull may take the place of: none where the viewer let go after it.
  Command* LastPull(int viewer) {
    const auto last = std::find_if(waiting_.rbegin(), waiting_.rend(), [&](const Command& c) {
      return c.viewer == viewer && (c.kind == Command::Kind::kPull || c.kind == Command::Kind::kRelease);
    });
    return last != waiting_.rend() && last->kind == Command::Kind::kPull ? &*last : nullptr;
  }

  std::size_t most_;
  std::deque<Command> waiting_;
};

}  // namespace fork1s::internal
