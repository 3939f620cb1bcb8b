// Going back to a moment of the last minute.
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <fmt/format.h>

#include "server/live_simulation.hpp"

namespace fork1s {

void LiveSimulation::StoreMoment() {
  if (paused_ || !past_.IsStored(latest_.sequence)) return;
  PastMoment m;
  m.sequence = latest_.sequence;
  m.epoch = latest_.epoch;
  m.time_offset = time_offset_;
  m.steps_before = steps_before_;
  m.time = time_offset_ + simulation_.time();
  m.steps = steps_before_ + static_cast<double>(simulation_.steps());
  m.snapshot = simulation_.Save();
  m.state = simulation_.State();
  m.targets = targets_;
  past_.Add(std::move(m));
}

// Of the present model every bit comes back; of one that was built since, poses, rates and set-points.
std::optional<Refusal> LiveSimulation::HandleResume(const Command& c) {
  const PastMoment* found = c.index > 0 ? past_.Find(static_cast<std::uint32_t>(c.index)) : nullptr;
  if (!found) return Refusal{"that moment is no longer kept; scrub to a later one"};
  const PastMoment then = *found;
  if (then.epoch == latest_.epoch) {
    if (auto done = simulation_.Restore(then.snapshot); !done) return OrSay(done);
    time_offset_ = then.time_offset;
    steps_before_ = then.steps_before;
  } else {
    const KeyframeDef state = SetDown(then.state);
    if (auto done = Rebuild(settings_, &state); !done) return OrSay(done);
    time_offset_ = then.time;
    steps_before_ = then.steps;
  }
  targets_ = then.targets;
  pull_.reset();
  pushes_.clear();
  carry_ = 0;
  ClearError();
  if (ghost_on_) BeginGhost();
  PublishSettings();
  return {};
}

}  // namespace fork1s
