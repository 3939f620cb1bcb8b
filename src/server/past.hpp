// The last minute of a live simulation, to go back to.
#pragma once

#include <cstdint>
#include <deque>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {

struct PastMoment {
  std::uint32_t sequence = 0;  // of the frame that shows it
  std::uint32_t epoch = 0;     // of the model; `snapshot` fits that one alone
  double time = 0;             // s, as frames count it
  double steps = 0;
  double time_offset = 0, steps_before = 0;
  Simulation::Snapshot snapshot;
  KeyframeDef state;  // for another model of the same scene
  VectorX targets;
};

class Past {
 public:
  /// Ten moments a second; fewer where they are large, so that all take some 100 MB at most.
  explicit Past(std::size_t bodies = 0) : spacing_(static_cast<std::uint32_t>(6 + bodies / 20)) {}
  bool IsStored(std::uint32_t sequence) const { return sequence % spacing_ == 0; }

  void Add(PastMoment moment) {
    constexpr std::size_t kFrames = 3600;  // a minute; a pause adds none
    moments_.push_back(std::move(moment));
    while (moments_.size() > kFrames / spacing_ + 1) moments_.pop_front();
  }
  /// The last one at or before a frame; null where that is no longer kept.
  const PastMoment* Find(std::uint32_t sequence) const {
    const PastMoment* best = nullptr;
    for (const PastMoment& m : moments_)
      if (m.sequence <= sequence) best = &m;
    return best;
  }
  std::size_t size() const { return moments_.size(); }

 private:
  std::uint32_t spacing_;
  std::deque<PastMoment> moments_;
};

}  // namespace fork1s
